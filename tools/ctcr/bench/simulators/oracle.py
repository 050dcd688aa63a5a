"""A robot whose pose another program computes, on the simulated bench instead of the model."""

import json
import subprocess
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr.arrays import Array, ArrayLike
from ctcr.errors import InputError, Problem
from ctcr.frames import base_to_tracker
from ctcr.robot.description import Robot


class Oracle:
    """Moves and reads like MovingModel; the program answers each line of JSON with one.

    Given t [s], beta (N,) [m], alpha (N,) [rad], force (3,) [N], it answers position (3,) [m] and rotation (3, 3)
    of the sensor in the base frame, or null where it has no solution.
    """

    def __init__(self, command: Sequence[str], robot: Robot):
        """Raises InputError where the program does not start."""
        self._robot, self._command, self._asked = robot, list(command), None
        self._pose: tuple[Array, Array] = np.full(3, np.nan), np.full(4, np.nan)
        try:
            self._program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        except OSError as error:
            raise InputError(Problem(f"does not start: {error.strerror}", command[0])) from None

    def move(self, t: float, beta: ArrayLike, alpha: ArrayLike, force: ArrayLike) -> None:
        """Joints [m], [rad] as in a table of measurements, and the tip force [N], at the time t [s]."""
        rows = self._robot.joints_of_table(np.array([beta], float), np.array([alpha], float))
        asked = {"beta": rows[0][0].tolist(), "alpha": rows[1][0].tolist(), "force": np.asarray(force).tolist()}
        if asked != self._asked:
            self._asked = asked
            self._pose = self._answer({"t": t} | asked)

    def reading(self) -> tuple[Array, Array]:
        """Position (3,) [m] and quaternion (4,) in the tracker frame, without noise; NaN where unsolved."""
        return self._pose

    def _answer(self, asked: dict) -> tuple[Array, Array]:
        try:
            self._program.stdin.write(json.dumps(asked) + "\n")
            self._program.stdin.flush()
            answer = json.loads(self._program.stdout.readline())
        except (OSError, ValueError):
            raise InputError(Problem("the oracle does not answer", " ".join(self._command))) from None
        if answer is None:
            return np.full(3, np.nan), np.full(4, np.nan)
        quaternion = np.roll(Rotation.from_matrix(answer["rotation"]).as_quat(), 1)
        position, turned = base_to_tracker(self._robot.tracker, np.array([answer["position"]]), quaternion[None])
        return position[0], turned[0]
