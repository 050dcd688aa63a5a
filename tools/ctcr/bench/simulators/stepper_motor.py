"""A stepper motor with its encoder: a shaft that follows the field of its coils, or falls out of step."""

ENCODER_COUNTS = 4096  # a turn: 1024 lines, four edges each
STEP_COUNTS = 12800  # a turn: 200 full steps of 64 microsteps, the internal counter
ACCELERATION = 200.0  # [turns/s^2]: the terminal's ramp in direct velocity control is that of the motor
MICROSTEP = 1 / STEP_COUNTS
HEATING_S = 0.2  # at too much current, until the terminal switches off
SLIP = 0.1  # fraction of the steps that a slipping motor loses


class StepperMotor:
    """Shaft in turns. Faults: `jammed`, `slipping` (loses steps), `shorted`, `unpowered`."""

    def __init__(self) -> None:
        self.shaft = 0.0  # [turns]
        self.jammed = self.slipping = self.shorted = self.unpowered = False
        self.power_on()

    def power_on(self) -> None:
        """The counters start at 0; the shaft stays."""
        self.speed = 0.0  # commanded [turns/s]
        self.full_speed = 10.0
        self.enabled, self.heat = False, 0.0
        self._stepped = 0.0  # turns commanded so far
        self._offsets = {True: -self.shaft * ENCODER_COUNTS, False: 0.0}
        self._wanted_speed, self._target, self._ramp = 0.0, None, (10.0, ACCELERATION)
        self._last_target = None
        self._time = None

    # ---- counter

    def counter(self, from_encoder: bool) -> int:
        """The counter of the encoder, or of the steps that the terminal has commanded."""
        turned = self.shaft * ENCODER_COUNTS if from_encoder else self._stepped * STEP_COUNTS
        return round(turned + self._offsets[from_encoder])

    def set_counter(self, value: int, from_encoder: bool) -> None:
        self._offsets[from_encoder] += value - self.counter(from_encoder)

    def jump(self, counts: int) -> None:
        """A disturbed encoder: the counter jumps, the shaft does not."""
        self._offsets[True] += counts

    # ---- commands

    def command_velocity(self, fraction: float) -> None:
        """A signed fraction of the full speed."""
        self._target, self._wanted_speed = None, fraction * self.full_speed
        self._ramp = self.full_speed, ACCELERATION

    def command_position(self, counter: int, from_encoder: bool, speed_fraction: float, ramp_s: float) -> None:
        """A position on the counter, with a trapezoidal velocity profile."""
        scale = ENCODER_COUNTS if from_encoder else STEP_COUNTS
        self._target = self._last_target = self._stepped + (counter - self.counter(from_encoder)) / scale
        self._ramp = speed_fraction * self.full_speed, speed_fraction * self.full_speed / ramp_s

    def end_positioning(self) -> None:
        if self._target is not None:
            self._target, self._wanted_speed = None, 0.0

    @property
    def is_positioning(self) -> bool:
        return self._target is not None and abs(self._target - self._stepped) > MICROSTEP

    @property
    def in_target(self) -> bool:
        return self._last_target is not None and abs(self._last_target - self._stepped) < 2 * MICROSTEP

    # ---- motion

    @property
    def stalled(self) -> bool:
        return self.enabled and self.jammed and self.speed != 0

    def advance(self, now: float, overload: bool) -> None:
        """Moves on to the time `now` [s], by 0.05 s at most; while `overload` lasts, the motor heats up."""
        step = 0.0 if self._time is None else min(0.05, now - self._time)
        self._time = now
        if not self.enabled:
            self.speed = self._wanted_speed = 0.0
            return
        self.heat = self.heat + step if overload else 0.0
        most, acceleration = self._ramp
        wanted = self._wanted_speed
        if self._target is not None:
            left = self._target - self._stepped
            wanted = min(most, (2 * acceleration * abs(left)) ** 0.5, abs(left) / max(step, 1e-6))
            wanted = wanted if left > 0 else -wanted
        change = acceleration * step
        self.speed += max(-change, min(change, wanted - self.speed))
        turned = self.speed * step
        self._stepped += turned
        if not self.jammed:
            self.shaft += (1 - SLIP) * turned if self.slipping else turned
