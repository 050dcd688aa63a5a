"""An effect of one's own, without a compiler: hidden in simulated measurements, fitted, and gone from the error.

The same file serves the command line: ctcr add .. --effects examples/05_own_effect.py (see docs/effects.md).
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
from ctcr.arrays import Array
from ctcr.user_effects import Effect, Parameter, Rows, load

HOME = np.array([-0.298, -0.2205, -0.145])  # [m] translations at which the angles are set to zero


class RotationPickup(Effect):
    id = "rotation_pickup"
    title = "Rotation picked up with translation"
    physics = "The carriage twists a tube a little while it pushes it."
    signature = "The error grows with how far a tube is pushed in, and turns with the tube."
    measure = "Push one tube in small steps without turning any."
    look_alikes = ("delay",)
    parameters = [
        Parameter("gain", unit="rad/m", sigma=1.0, bounds=(-5, 5), per_tube=True, meaning="turn per insertion")
    ]

    def joints(self, rows: Rows, values: SimpleNamespace) -> tuple[Array, Array]:
        """What the tubes get where the controller asks for rows.beta and rows.alpha."""
        return rows.beta, rows.alpha + values.gain * (rows.beta - HOME)


def main() -> None:
    from ctcr.diagnose import add
    from ctcr.effects import catalogue
    from ctcr.model import simulation
    from ctcr.robot import robot_file
    from ctcr.table import measurements

    examples = Path(__file__).parent
    load(__file__)
    robot = robot_file.load(examples / "robots" / "table2.yaml")
    plan = measurements.load(examples / "data" / "plan.csv", robot.n_tubes)

    truth = catalogue.with_values(robot, ["rotation_pickup"], {"effects.rotation_pickup.gain.1": 2.0})
    readings = simulation.simulate(truth, plan, noise="jitter", seed=5)
    added = add.add(robot, readings, ["rotation_pickup"])
    for stage in added.stages:
        print(f"{stage.name:16} {stage.rms_mm:.3f} mm RMS on runs that the fit has not seen")
    for name, found in added.parameters().items():
        print(f"{name}: {found['value']:.3f} +- {found['sd']:.3f} rad/m")


if __name__ == "__main__":
    main()
