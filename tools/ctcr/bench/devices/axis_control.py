"""What the motors of a robot do in each cycle: follows moves, watches limits and lag, and stops for good at a fault."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.bench.devices.motion import StraightMove, VelocityMove

Array = NDArray[np.float64]

GAIN = 20.0  # [1/s] of the position loop around the encoders
STOP_RAMPS = 4.0  # a stop brakes so much harder than a move
SETTLED, SETTLE_S = (0.01, 0.5)  # a move ends this near to its target, as a share of the largest lag, or so long after
SLACK_M, SLACK_RAD = (0.5e-3, 5e-3)  # of the encoders beyond limits, before it is a fault: overshoot of the loop
JOG_M, JOG_RAD = 25e-3, 0.6  # longest move without limits, before homing
JUMP_FACTOR = 4.0  # an encoder that moves so many times faster than its motor can has jumped,
JUMP_LAG = 0.5  # when it is also this share of the largest lag off; readings come at uneven times


@dataclass(frozen=True)
class AxisSettings:
    """Of the joints (2N,), translations [m] then rotations [rad]."""

    speeds: Array  # highest [1/s]
    ramp_s: float  # to the highest speed
    lag: Array  # largest distance between where a joint is to be and where its encoder says it is
    limits: JointLimits

    @property
    def accelerations(self) -> Array:
        return self.speeds / self.ramp_s


class AxisControl:
    """One robot's joints. Until homing, joints count from power on, and only short moves are possible.

    `fault` is the reason of a stop; it stays until a new connection is made.
    """

    def __init__(self, settings: AxisSettings, joints: ArrayLike, homed: bool):
        self._settings, self.homed = settings, homed
        self.wanted = self.joints = np.array(joints, float)
        self._speeds = 0 * self.wanted
        self._motion: StraightMove | VelocityMove | None = None
        self._settling = 0.0  # [s] since the end of the motion
        self._watched = False  # a velocity whose way has to be watched
        self.limited = False  # the last velocity ended at a limit
        self.fault: DeviceFault | None = None
        if homed and (problem := settings.limits.problem(self.joints, SLACK_M, SLACK_RAD)):
            self.fault = _fault(problem, "move the carriages by hand, or home again with `ctcr move --home`")

    @property
    def is_moving(self) -> bool:
        return self._motion is not None

    # ---- what to do

    def move(self, target: ArrayLike, speed: float = 1.0) -> None:
        """A straight line to `target` (2N,) at a share of the highest speed. Raises DeviceFault where it may not be."""
        self._require(homed=True)
        if problem := self._settings.limits.problem(target):
            raise _fault(problem, "choose other joints; nothing has moved")
        self._start(target, speed)

    def jog(self, way: ArrayLike, speed: float = 0.5) -> None:
        """A short move by `way` (2N,) without limits, for homing. Raises DeviceFault where it is too long."""
        self._require(homed=False)
        n = len(self.wanted) // 2
        longest = np.repeat([JOG_M, JOG_RAD], n)
        if (np.abs(way) > longest + 1e-9).any():
            text = f"a jog is at most {1e3 * JOG_M:g} mm and {np.rad2deg(JOG_RAD):.0f} deg long"
            raise _fault(text, "jog in several steps")
        self._start(self.wanted + way, speed)

    def velocity(self, speeds: ArrayLike, valid_s: float) -> None:
        """Speeds (2N,) [m/s], [rad/s] for `valid_s`, unless new ones come; stops before a limit."""
        self._require(homed=True)
        settings = self._settings
        wanted = np.clip(speeds, -settings.speeds, settings.speeds)
        self._motion = VelocityMove(self.wanted, self._speeds, wanted, settings.accelerations, valid_s)
        self._watched, self.limited = True, False

    def halt(self, ramps: float = 1.0) -> None:
        """To rest, with a ramp that is `ramps` times as steep as that of a move."""
        if self._motion or self._speeds.any():
            accelerations = ramps * self._settings.accelerations
            self._motion = VelocityMove(self.wanted, self._speeds, 0 * self._speeds, accelerations, 0.0)
            self._watched = False

    def stop(self, fault: DeviceFault) -> None:
        """To rest at once, and nothing more from now on."""
        if not self.fault:
            self.fault = fault
            self.halt(STOP_RAMPS)

    def place(self, joints: ArrayLike) -> None:
        """The joints are at these values now: homing."""
        self.wanted = self.joints = np.array(joints, float)
        self._motion, self.homed = None, True
        self._speeds = 0 * self.wanted

    # ---- every cycle

    def cycle(self, dt: float, joints: Array) -> Array:
        """Speeds (2N,) for the motors, from where the encoders say the joints are."""
        settings = self._settings
        if not self.fault:
            jump = np.abs(joints - self.joints) > JUMP_FACTOR * settings.speeds * dt + JUMP_LAG * settings.lag
            lag = np.abs(joints - self.wanted) > settings.lag
            if jump.any():
                self.stop(self._axis_fault(jump, "its encoder jumped", "check the encoder's cable, then home again"))
            elif lag.any():
                remedy = "something blocks it, or its motor is too weak: look, then move slower"
                self.stop(self._axis_fault(lag, "it does not follow", remedy))
            elif self.homed and (problem := settings.limits.problem(joints, SLACK_M, SLACK_RAD)):
                self.stop(_fault(problem, "move back by `ctcr move` after releasing the stop"))
        self.joints = joints
        if self._motion:
            self.wanted, self._speeds = self._motion.advance(dt)
            if self._watched and settings.limits.problem(self._motion.resting_place()):
                self.halt()
                self.limited = True
            if self._motion.is_finished:
                self._settling += dt
                left = np.abs(self.wanted - joints)
                if (left < SETTLED * settings.lag).all() or self._settling > SETTLE_S:
                    self._motion, self._speeds, self._settling = None, 0 * self._speeds, 0.0
        if self.fault and not self._motion:
            self.wanted = joints  # hold, do not push
            return 0 * joints
        return self._speeds + GAIN * (self.wanted - joints)

    def _start(self, target: ArrayLike, speed: float) -> None:
        if self._speeds.any():
            raise _fault("the joints are still moving", "wait, or stop them first")
        settings = self._settings
        share = min(max(speed, 0.01), 1.0)
        self._motion = StraightMove(self.wanted, target, share * settings.speeds, settings.ramp_s)
        self._watched = False

    def _require(self, homed: bool) -> None:
        if self.fault:
            raise self.fault
        if homed and not self.homed:
            raise _fault("where the joints are is not known since power on", "home first: `ctcr move --home`")

    def _axis_fault(self, which: NDArray[np.bool_], what: str, remedy: str) -> DeviceFault:
        n, axis = len(which) // 2, int(np.flatnonzero(which)[0])
        kind = "translation" if axis < n else "rotation"
        return DeviceFault(f"{kind} of tube {axis % n + 1}", what, remedy)


def _fault(what: str, remedy: str) -> DeviceFault:
    return DeviceFault("joints", what, remedy)
