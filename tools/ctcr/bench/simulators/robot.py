"""The robot on the simulated bench: motors turn, its tip moves, a tracker sees it."""

import json
import subprocess
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr.arrays import Array, ArrayLike
from ctcr.bench.shared.transmission import joints_of_turns
from ctcr.effects.one_tube import one_tube
from ctcr.errors import InputError, Problem
from ctcr.frames import base_to_tracker
from ctcr.model.moving import MovingModel
from ctcr.model.simulation import ReadingNoise
from ctcr.robot.description import Robot

INSIDE_M = 2e-4  # a tip that stands out no farther than this counts as behind the plate


class Oracle:
    """A program that computes the tip instead of the model. Moves and reads like MovingModel.

    The program answers each line of JSON with one. Given t [s], beta (N,) [m], alpha (N,) [rad], force (3,) [N], it
    answers position (3,) [m] and rotation (3, 3) of the sensor in the base frame, or null where it has no solution.
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


class SimulatedRobot:
    """A robot with its effects, known or hidden. `force`: of the weight at its tip [N], base frame."""

    def __init__(self, robot: Robot, noise: str = "jitter", seed: int = 1, oracle: Oracle | None = None):
        """`noise`: none, jitter or realistic; see `model.simulation`; `oracle`: its physics instead of the model.

        Raises InputError where ratios are unknown.
        """
        self.robot, self.force = robot, np.zeros(3)
        self._model = oracle or MovingModel(robot)
        self._noise = ReadingNoise(robot, noise, seed) if noise != "none" else None
        self.fasten(robot.tracker.sensor_on_tube - 1)
        self.turn(0.0, np.zeros(2 * robot.n_tubes))

    def turn(self, t: float, turns: ArrayLike) -> None:
        """Moves the motors' shafts to so many turns (2N,) from home, at the time t [s]."""
        n = self.robot.n_tubes
        self._joints = joints_of_turns(self.robot, turns)
        self._model.move(t, self._joints[:n], self._joints[n:], self.force)
        if self.sensor is not None:
            own = [self.sensor]
            self._alone.move(t, self._joints[:n][own], self._joints[n:][own], self.force)

    def fasten(self, tube: int | None) -> None:
        """Puts the sensor at the tip of a tube (0: innermost), or takes it off."""
        self.sensor = tube
        if tube is not None:
            self._alone = MovingModel(one_tube(self.robot, tube))

    def reading(self) -> tuple[Array, Array] | None:
        """Position (3,) [m] and quaternion (4,) in the tracker frame; None where the model has no solution."""
        if self.sensor is None:
            return None
        if (np.delete(self.deployed(), self.sensor) < INSIDE_M).all():
            pose = self._alone.reading()
        elif self.sensor == self.robot.tracker.sensor_on_tube - 1:
            pose = self._model.reading()
        else:
            return None
        return self.as_read(*pose) if np.isfinite(pose[0]).all() else None

    def as_read(self, position: Array, quaternion: Array) -> tuple[Array, Array]:
        """A pose in the tracker frame with the noise of the tracker."""
        if not self._noise:
            return position, quaternion
        position, quaternion = self._noise.added(position[None], quaternion[None])
        return position[0], quaternion[0]

    def deployed(self) -> Array:
        """How far each tube's tip stands out of the front plate (N,) [m], as a person sees it."""
        n = self.robot.n_tubes
        beta, _ = self.robot.joints_of_table(self._joints[None, :n], self._joints[None, n:])
        return beta[0] + self.robot.lengths
