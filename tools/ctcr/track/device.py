"""What a controller needs of a robot: the interface of include/ctcr/control/device.hpp, for devices in Python."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Device(Protocol):
    """Called once a period, in this order. What a method raises ends the run and is raised by it."""

    def measure(self) -> tuple[Array, Array, Array]:
        """Motor angles (2N,) [rad] from home, position (3,) [m] and rotation (3, 3) of the sensor, tracker frame.

        It sets the pace: it returns when the next period starts.
        """

    def record(self, so_far, row: int) -> None:
        """Row `row` of the result, a LoopResult, is complete; not called while the robot settles at the start."""

    def move(self, velocity: Array, period: float) -> None:
        """Velocities (2N,) of the motors [rad/s] for one period [s]."""
