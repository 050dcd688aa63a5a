"""Motion profiles of the joints: straight moves and velocities, with ramps."""

import numpy as np

from ctcr.arrays import Array, ArrayLike


class StraightMove:
    """All joints along one straight line of joint space, from rest to rest, with a trapezoidal velocity profile.

    The joint that needs longest at its own speed sets the duration.
    """

    def __init__(self, start: ArrayLike, end: ArrayLike, speeds: ArrayLike, ramp_s: float):
        """`speeds` (K,): highest of each joint [1/s], reached after `ramp_s`."""
        self._start, self._way = np.array(start, float), np.subtract(end, start)
        cruise = float((np.abs(self._way) / np.asarray(speeds, float)).max())  # [s] at full speed
        self._ramp = min(ramp_s, (cruise * ramp_s) ** 0.5)  # shorter: full speed is never reached, a triangle as steep
        self.duration = max(cruise, self._ramp) + self._ramp
        self._peak = 1 / (self.duration - self._ramp) if cruise else 0.0  # of the fraction of the way [1/s]
        self._t = 0.0

    @property
    def is_finished(self) -> bool:
        return self._t >= self.duration

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Setpoints of position and velocity after another `dt` [s]."""
        self._t = min(self._t + dt, self.duration)
        t, left, ramp, peak = self._t, self.duration - self._t, self._ramp, self._peak
        if not peak:
            fraction, rate = 0.0, 0.0
        elif t < ramp:
            fraction, rate = 0.5 * peak * t * t / ramp, peak * t / ramp
        elif left < ramp:
            fraction, rate = 1 - 0.5 * peak * left * left / ramp, peak * left / ramp
        else:
            fraction, rate = peak * (t - 0.5 * ramp), peak
        return self._start + fraction * self._way, rate * self._way


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
        """Like StraightMove.advance."""
        self._joints, self._speeds = self._after(dt)
        self._left -= dt
        return self._joints, self._speeds

    def rest(self, dt: float = 0.0) -> Array:
        """Where the joints come to rest if they go on for `dt` [s] and brake then."""
        joints, speeds = self._after(dt)
        return joints + speeds * np.abs(speeds) / (2 * self._most)

    def _after(self, dt: float) -> tuple[Array, Array]:
        wanted = self._wanted if self._left > 0 else 0 * self._wanted
        change = np.clip(wanted - self._speeds, -self._most * dt, self._most * dt)
        changing, speeds = np.abs(change) / self._most, self._speeds + change
        return self._joints + (self._speeds + 0.5 * change) * changing + speeds * (dt - changing), speeds
