"""The robot that stands on the simulated bench: motors turn, its tip moves, a tracker sees it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr.devices.transmission import joints_of_turns
from ctcr.moving_model import MovingModel
from ctcr.robot import Robot
from ctcr.simulation import ReadingNoise

Array = NDArray[np.float64]


class SimulatedRobot:
    """A robot with its effects, known or hidden. `force` is what hangs at its tip [N], base frame."""

    def __init__(self, robot: Robot, noise: str = "jitter", seed: int = 1):
        """`noise`: none, jitter or realistic, as in `ctcr.simulation`. Raises InputError where ratios are unknown."""
        self.robot, self.force = robot, np.zeros(3)
        self._model = MovingModel(robot)
        self._noise = ReadingNoise(robot, noise, seed) if noise != "none" else None
        self.turn(0.0, np.zeros(2 * robot.n_tubes))

    def turn(self, t: float, turns: ArrayLike) -> None:
        """The motors' shafts stand so many turns (2N,) from home at the time t [s]."""
        n = self.robot.n_tubes
        self._joints = joints_of_turns(self.robot, turns)
        self._model.move(t, self._joints[:n], self._joints[n:], self.force)

    def reading(self) -> tuple[Array, Array] | None:
        """Position (3,) [m] and quaternion (4,) in the tracker frame; None where the model has no solution."""
        position, quaternion = self._model.reading()
        if not np.isfinite(position).all():
            return None
        if self._noise:
            position, quaternion = (row[0] for row in self._noise.added(position[None], quaternion[None]))
        return position, quaternion

    def deployed(self) -> Array:
        """How far each tube's tip stands out of the front plate (N,) [m]: what a person sees."""
        n = self.robot.n_tubes
        beta, _ = self.robot.joints_of_table(self._joints[None, :n], self._joints[None, n:])
        return beta[0] + np.array([tube.length for tube in self.robot.tubes])
