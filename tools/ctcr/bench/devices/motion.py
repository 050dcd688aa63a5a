"""How joints get from here to there: straight moves and velocities, with ramps."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class StraightMove:
    """All joints in one straight line of joint space, from rest to rest; the slowest joint sets the time."""

    def __init__(self, start: ArrayLike, end: ArrayLike, speeds: ArrayLike, ramp_s: float):
        """`speeds` (K,) are the highest of each joint [1/s]; they are reached after `ramp_s`."""
        self._start, self._way = np.array(start, float), np.subtract(end, start)
        needed = np.abs(self._way) / np.asarray(speeds, float)
        self._cruise = float(needed.max())  # [s] at full speed
        self._ramp = max(ramp_s, 1e-3)
        if self._cruise < self._ramp:  # never at full speed: ramps alone, as steep
            self._ramp = (self._cruise * self._ramp) ** 0.5
        self.duration = self._cruise + ramp_s if self._cruise >= ramp_s else 2 * self._ramp
        self._peak = 1 / (self.duration - self._ramp) if self._cruise else 0.0  # share of the way per second
        self._t = 0.0

    @property
    def is_finished(self) -> bool:
        return self._t >= self.duration

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Where the joints are to be after another `dt` [s], and how fast."""
        self._t = min(self._t + dt, self.duration)
        if not self._cruise:
            return self._start.copy(), 0 * self._way
        t, ramp, peak = self._t, self._ramp, self._peak
        left = self.duration - t
        if t < ramp:
            share, rate = 0.5 * peak * t * t / ramp, peak * t / ramp
        elif left < ramp:
            share, rate = 1 - 0.5 * peak * left * left / ramp, peak * left / ramp
        else:
            share, rate = peak * (t - 0.5 * ramp), peak
        return self._start + share * self._way, rate * self._way


class VelocityMove:
    """Joints at wanted speeds for a while, then to rest; speeds change no faster than `accelerations` (K,)."""

    def __init__(
        self, joints: ArrayLike, speeds: ArrayLike, wanted: ArrayLike, accelerations: ArrayLike, valid_s: float
    ):
        """From `joints` moving at `speeds`."""
        self._joints, self._speeds = np.array(joints, float), np.array(speeds, float)
        self._wanted, self._most = np.array(wanted, float), np.asarray(accelerations, float)
        self._left = valid_s

    @property
    def is_finished(self) -> bool:
        return self._left <= 0 and not self._speeds.any()

    def advance(self, dt: float) -> tuple[Array, Array]:
        """As StraightMove.advance."""
        wanted = self._wanted if self._left > 0 else 0 * self._wanted
        self._left -= dt
        change = np.clip(wanted - self._speeds, -self._most * dt, self._most * dt)
        self._joints = self._joints + (self._speeds + 0.5 * change) * dt
        self._speeds = self._speeds + change
        return self._joints, self._speeds

    def resting_place(self) -> Array:
        """Where the joints come to rest if they are stopped now."""
        return self._joints + self._speeds * np.abs(self._speeds) / (2 * self._most)
