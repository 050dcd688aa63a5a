"""The oracle as the robot of a simulated bench: `ctcr sim bench ROBOT --oracle "python tools/oracle/serve.py"`.

    python tools/oracle/serve.py [--friction COEFFICIENT] ROBOT.yaml

Reads a line of JSON for every place that the joints come to: t [s], beta (N,) [m], alpha (N,) [rad], as they are, and
force (3,) [N] at the tip. Answers a line: position (3,) [m] and rotation (3, 3) of the sensor in the base frame, or
null where there is no equilibrium. Ends with its input.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from friction import FrictionLaw
from kernel import NoEquilibriumError
from mechanics import Mechanics
from robot import from_description, read_description
from session import ELEMENT_LENGTH, HISTORY_ELEMENT_LENGTH
from specimen import Specimen, small_moves

CONTACT_STIFFNESS = 0.1  # [N m/rad]


class Served:
    """The robot that remembers, moved from place to place."""

    def __init__(self, description: dict, friction: float) -> None:
        law = FrictionLaw(friction, CONTACT_STIFFNESS) if friction else None
        self._history = law is not None
        element = HISTORY_ELEMENT_LENGTH if law else ELEMENT_LENGTH
        sensor = description["tracker"]["sensor_on_tube"] - 1
        self._specimen = Specimen(Mechanics(from_description(description), friction=law), element, sensor)
        self._joints: np.ndarray | None = None

    def answer(self, asked: dict) -> dict | None:
        joints, force = np.concatenate([asked["beta"], asked["alpha"]]), np.array(asked["force"], float)
        remembers = self._history and self._joints is not None
        moves = small_moves(self._joints, joints) if remembers else [joints]
        try:
            for move in moves:
                pose = self._specimen.settle(*np.split(move, 2), force, asked["t"])
        except NoEquilibriumError:
            return None
        self._joints = joints
        return {"position": pose.position.tolist(), "rotation": pose.rotation.tolist()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", type=Path)
    parser.add_argument("--friction", type=float, default=0.0, help="coefficient")
    given = parser.parse_args()
    served = Served(read_description(given.robot), given.friction)
    for line in sys.stdin:
        print(json.dumps(served.answer(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
