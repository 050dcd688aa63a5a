"""Control of the joints in each cycle: follows moves, watches limits and following errors, latches faults."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ctcr.arrays import Array, ArrayLike, Mask
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.bench.devices.motion import StraightMove, VelocityMove

GAIN = 20.0  # [1/s] of the position loop, closed on the encoders
STOP_RAMPS = 4.0  # a stop brakes so much harder than a move
SETTLED, SETTLE_S = 0.01, 0.5  # a move ends within this fraction of the following error allowed, or after so long
SLACK_M, SLACK_RAD = 0.5e-3, 5e-3  # overshoot of the position loop: encoders this far beyond a limit are no fault
JOG_M, JOG_RAD, JOG_SPEED = 25e-3, 0.6, 0.5  # longest move without limits, before homing; fraction of the highest speed
# An encoder has jumped where it moves so many times faster than its motor can, and also further than this fraction of
# the following error allowed: readings come at uneven times.
JUMP_FACTOR, JUMP_ERROR = 4.0, 0.5
_fault = partial(DeviceFault, "joints")


@dataclass(frozen=True)
class AxisSettings:
    """Limits and gains of the joints (2N,): translations [m] first, then rotations [rad]."""

    speeds: Array  # highest [1/s]
    ramp_s: float  # to the highest speed
    following_error: Array  # largest allowed between setpoint and encoder
    limits: JointLimits

    @property
    def accelerations(self) -> Array:
        return self.speeds / self.ramp_s


class AxisControl:
    """One robot's joints. Until homing, joints count from power on, and only jogs are possible.

    `fault` is the reason of a stop; it stays until a new connection is made.
    """

    def __init__(self, settings: AxisSettings, joints: ArrayLike, homed: bool):
        self._settings, self.homed = settings, homed
        self.setpoint = self.joints = np.array(joints, float)
        self._speeds = 0 * self.setpoint
        self._motion: StraightMove | VelocityMove | None = None
        self._settling = 0.0  # [s] since the end of the motion
        self._guarded = False  # a velocity, which must stop before a limit
        self.limited = False  # the last velocity ended at a limit
        self.fault: DeviceFault | None = None
        self._come_to_rest()

    @property
    def is_moving(self) -> bool:
        return self._motion is not None

    # ---- requests

    def move(self, target: ArrayLike, speed: float = 1.0) -> None:
        """A straight line to `target` (2N,) at a fraction of the highest speed. Raises DeviceFault where forbidden.

        Joints that rest outside of a limit may come back: no limit may be violated by more than there.
        """
        self._require(homed=True)
        _finite(target, speed)
        if problem := self._settings.limits.problem(target, allowed=self._allowed):
            raise _fault(problem, "choose other joints; nothing has moved")
        self._start(target, speed)

    def jog(self, way: ArrayLike) -> None:
        """A short move by `way` (2N,) without limits, for homing. Raises DeviceFault where it is too long.

        From now on the joints are not known: limits of a wrong homing must not hinder the next one.
        """
        self._require(homed=False)
        _finite(way)
        longest = np.repeat([JOG_M, JOG_RAD], len(self.setpoint) // 2)
        if (np.abs(way) > longest + 1e-9).any():
            text = f"a jog is at most {1e3 * JOG_M:g} mm and {np.rad2deg(JOG_RAD):.0f} deg long"
            raise _fault(text, "jog in several steps")
        self._start(self.setpoint + way, JOG_SPEED)
        self.homed = False

    def velocity(self, speeds: ArrayLike, valid_s: float) -> None:
        """Speeds (2N,) [m/s], [rad/s] for `valid_s` or until the next request; brakes before a limit."""
        self._require(homed=True)
        _finite(speeds, valid_s)
        most = self._settings.speeds
        self._go_at(np.clip(speeds, -most, most), 1.0, valid_s)
        self._guarded, self.limited = True, False

    def halt(self, ramps: float = 1.0) -> None:
        """Brakes to rest, `ramps` times as hard as a move does."""
        if self._motion or self._speeds.any():
            self._go_at(np.zeros_like(self._speeds), ramps, 0.0)

    def stop(self, fault: DeviceFault) -> None:
        """Brakes hard and refuses all motion from now on."""
        if not self.fault:
            self.fault = fault
            self.halt(STOP_RAMPS)

    def set_joints(self, joints: ArrayLike) -> None:
        """Homing: the joints (2N,) are at these values [m], [rad] now, and at rest."""
        self.setpoint = self.joints = np.array(joints, float)
        self._motion, self.homed = None, True
        self._speeds = 0 * self.setpoint
        self._come_to_rest()

    # ---- every cycle

    def cycle(self, dt: float, joints: Array) -> Array:
        """Speeds (2N,) for the motors, from the joints that the encoders read."""
        if not self.fault:
            self._watch(dt, joints)
        self.joints = joints
        if self._motion:
            # Before the step: a late cycle makes it long, and one that ends too near a limit cannot be undone.
            if self._guarded and self._settings.limits.problem(self._motion.rest(dt)):
                self.halt()
                self.limited = True
            self.setpoint, self._speeds = self._motion.advance(dt)
            if self._motion.is_finished:
                self._settling += dt
                left = np.abs(self.setpoint - joints)
                if (left < SETTLED * self._settings.following_error).all() or self._settling > SETTLE_S:
                    self._motion, self._speeds, self._settling = None, 0 * self._speeds, 0.0
                    self._come_to_rest()
        if self.fault and not self._motion:
            self.setpoint = joints  # hold, do not push
            return np.zeros_like(joints)
        speeds = self._speeds + GAIN * (self.setpoint - joints)
        return speeds if np.isfinite(speeds).all() else self._rest(joints)

    def _rest(self, joints: Array) -> Array:
        """Ends a motion that has no numbers, and so neither a direction nor an end. Requests let none in."""
        self.fault = self.fault or _fault("the speeds of a motion are not numbers", "connect again, and report it")
        self.setpoint, self._motion, self._speeds = joints, None, np.zeros_like(joints)
        return self._speeds

    def _come_to_rest(self) -> None:
        """Notes by how much limits are violated here: the next motion may not violate them more."""
        self._allowed = np.maximum(0.0, self._settings.limits.excess(self.setpoint, SLACK_M))

    def _watch(self, dt: float, joints: Array) -> None:
        settings = self._settings
        allowed = settings.following_error
        jumped = np.abs(joints - self.joints) > JUMP_FACTOR * settings.speeds * dt + JUMP_ERROR * allowed
        behind = np.abs(joints - self.setpoint) > allowed
        if jumped.any():
            self.stop(_axis_fault(jumped, "its encoder jumped", "check the encoder's cable, then home again"))
        elif behind.any():
            remedy = "something blocks it, or its motor is too weak: look, then move slower"
            self.stop(_axis_fault(behind, "it does not follow", remedy))
        elif self.homed and (problem := settings.limits.problem(joints, SLACK_M, SLACK_RAD, self._allowed)):
            self.stop(_fault(problem, "move back by `ctcr move` after releasing the stop"))

    def _start(self, target: ArrayLike, speed: float) -> None:
        if self._speeds.any():
            raise _fault("the joints are still moving", "wait, or stop them first")
        speeds = min(max(speed, 0.01), 1.0) * self._settings.speeds
        self._motion, self._guarded = StraightMove(self.setpoint, target, speeds, self._settings.ramp_s), False

    def _go_at(self, speeds: ArrayLike, ramps: float, valid_s: float) -> None:
        """Changes to other speeds, with ramps so many times as steep as those of a move."""
        accelerations = ramps * self._settings.accelerations
        self._motion = VelocityMove(self.setpoint, self._speeds, speeds, accelerations, valid_s)
        self._guarded = False

    def _require(self, homed: bool) -> None:
        if self.fault:
            raise self.fault
        if homed and not self.homed:
            raise _fault("the joints are not known since power on", "home first: `ctcr move --home`")


def _finite(*values: ArrayLike) -> None:
    """Raises DeviceFault for NaN, which passes every comparison with a limit, and for infinity."""
    if not all(np.isfinite(value).all() for value in values):
        raise _fault("a joint, speed or time is not a number", "give finite numbers; nothing has moved")


def _axis_fault(which: Mask, what: str, remedy: str) -> DeviceFault:
    """The fault of the first axis that a mask (2N,) marks."""
    tube, n = int(np.flatnonzero(which)[0]), len(which) // 2
    kind = "translation" if tube < n else "rotation"
    return DeviceFault(f"{kind} of tube {tube % n + 1}", what, remedy)
