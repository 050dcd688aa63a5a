"""A stepper motor terminal EL70x1: its object dictionary, its motor and its process data."""

from ctcr.bench.shared.ethercat import DIAGNOSIS, ProcessImage, State, Values, signed
from ctcr.bench.simulators.object_dictionary import OUT_OF_RANGE, Abort, Entry, ObjectDictionary, ServiceDataServer
from ctcr.bench.simulators.sii import Identity, SyncManager
from ctcr.bench.simulators.slave_controller import Application
from ctcr.bench.simulators.stepper_motor import HEATING_S, StepperMotor

MAILBOX = 128  # bytes
ENCODER, STEPPER, POSITIONING = 0x7000, 0x7010, 0x7020  # outputs; inputs are 0x1000 lower
SATURATED, OVER_TEMPERATURE, UNDER_VOLTAGE, SHORT_CIRCUIT, OTHER, STALL = 1, 2, 4, 6, 9, 11  # subindices of DIAGNOSIS
MOTOR_LIMIT_MA = 1500  # more burns the motor that is connected
ABSOLUTE, ABSOLUTE_CHANGE = 1, 0x1001  # start types of the positioning interface
RX, TX = 0x1C12, 0x1C13  # PDO assignment of outputs and inputs
VARIANTS = {"EL7041": (0x1B813052, 0x1A06), "EL7031": (0x1B773052, 0x1A05)}  # product, first POS status


def _entry(index: int, subindex: int, bits: int) -> int:
    return index << 16 | subindex << 8 | bits


def _bits(index: int, count: int, padding: int = 0) -> list[int]:
    return [_entry(index, i, 1) for i in range(1, count + 1)] + [_entry(0, 0, padding)] * bool(padding)


def _mappings(positioning: int) -> dict[int, tuple[str, list[int]]]:
    """Every PDO with its entries. The numbers of the last two differ between variants of the terminal."""
    encoder, command, target = _bits(ENCODER, 4, 12), _bits(POSITIONING, 2, 14), _entry(POSITIONING, 0x11, 32)
    read, status = _bits(0x6000, 16), _bits(0x6020, 8, 8)
    more_status = [_entry(0x6020, 0x11, 32), _entry(0x6020, 0x21, 16), _entry(0x6020, 0x22, 32)]
    return {
        0x1600: ("ENC Control compact", [*encoder, _entry(ENCODER, 0x11, 16)]),
        0x1601: ("ENC Control", [*encoder, _entry(ENCODER, 0x11, 32)]),
        0x1602: ("STM Control", _bits(STEPPER, 3, 13)),
        0x1603: ("STM Position", [_entry(STEPPER, 0x11, 32)]),
        0x1604: ("STM Velocity", [_entry(STEPPER, 0x21, 16)]),
        0x1605: ("POS Control compact", [*command, target]),
        0x1606: ("POS Control", [*command, target, *(_entry(POSITIONING, i, 16) for i in range(0x21, 0x25))]),
        0x1A00: ("ENC Status compact", [*read, _entry(0x6000, 0x11, 16), _entry(0x6000, 0x12, 16)]),
        0x1A01: ("ENC Status", [*read, _entry(0x6000, 0x11, 32), _entry(0x6000, 0x12, 32)]),
        0x1A03: ("STM Status", _bits(0x6010, 16)),
        positioning: ("POS Status compact", status),
        positioning + 1: ("POS Status", [*status, *more_status]),
    }


class StepperTerminal(Application):
    """EL7041 by default, or another of VARIANTS."""

    sync_managers = (
        SyncManager(0x1000, MAILBOX, 0x26, 1),
        SyncManager(0x1080, MAILBOX, 0x22, 2),
        SyncManager(0x1100, 8, 0x24, 3),
        SyncManager(0x1180, 8, 0x20, 4),
    )

    def __init__(self, number: int, variant: str = "EL7041"):
        product, positioning = VARIANTS[variant]
        super().__init__(Identity(variant, product, 0x00190000, 1000 + number))
        self._mappings = _mappings(positioning)
        self.motor = StepperMotor()
        self.power_on()

    def power_on(self) -> None:
        """Settings and the counter are lost; the motor's shaft stays where it is."""
        self.objects = self._dictionary()
        self.mail = ServiceDataServer(self.objects, MAILBOX).answer
        self._outputs, self._inputs = self._images()
        self._toggle = self._executing = self._error = self._failed = self._set_done = False
        self.motor.power_on()

    def fail(self) -> None:
        """An error that no reset ends."""
        self._failed = True

    # ---- settings

    def _dictionary(self) -> ObjectDictionary:
        objects, identity = ObjectDictionary(self._check), self.identity
        objects.variable(0x1000, "I", 0x00001389, "Device type")
        objects.variable(0x1008, "s", identity.name, "Device name")
        objects.variable(0x1009, "s", "05", "Hardware version")
        objects.variable(0x100A, "s", "12", "Software version")
        numbers = {"Vendor ID": identity.vendor, "Product code": identity.product}
        numbers |= {"Revision": identity.revision, "Serial number": identity.serial}
        entries = {i: Entry("I", value, name=name) for i, (name, value) in enumerate(numbers.items(), start=1)}
        objects.record(0x1018, "Identity", entries)
        for index, (name, mapped) in self._mappings.items():
            objects.record(index, name, {i: Entry("I", value) for i, value in enumerate(mapped, start=1)})
        objects.record(0x1C00, "Sync manager type", {i: Entry("B", i) for i in range(1, 5)})
        for index, assigned in ((RX, (0x1600, 0x1602, 0x1604, 0)), (TX, (0x1A00, 0x1A03, 0, 0))):
            slots = {i: Entry("H", value, writable=True) for i, value in enumerate(assigned, start=1)}
            objects.record(index, "Sync manager PDO assignment", slots, resizable=True)
            objects.set(index, 0, sum(map(bool, assigned)))
        for index, (name, settings) in _SETTINGS.items():
            entries = {i: Entry(kind, value, True, text) for i, kind, value, text in settings}
            objects.record(index, name, entries)
        diagnosis = {i: Entry("?", 0, name=text) for i, text in enumerate(_DIAGNOSES, start=1)}
        objects.record(DIAGNOSIS, "STM Diag data", diagnosis | {0x11: Entry("B", 0, name="Actual operation mode")})
        return objects

    def _check(self, index: int, subindex: int, value: int) -> None:
        """Aborts the writing of a value that the terminal does not accept."""
        first = {RX: 0x1600, TX: 0x1A00}.get(index)
        if first and subindex and value and (value not in self._mappings or value & 0xFF00 != first):
            raise Abort(OUT_OF_RANGE)
        if (index, subindex) == (0x8010, 1) and not 0 < value <= 5000:
            raise Abort(OUT_OF_RANGE)

    def _images(self) -> tuple[ProcessImage, ProcessImage]:
        """The process images of outputs and inputs."""

        def image(assignment: int) -> ProcessImage:
            count, *slots = (entry.value for entry in self.objects[assignment].entries.values())
            return ProcessImage(entry for index in slots[:count] if index for entry in self._mappings[index][1])

        return image(RX), image(TX)

    def lengths(self) -> tuple[int, int]:
        outputs, inputs = self._images()
        return outputs.length, inputs.length

    def entered(self, state: State) -> None:
        self._outputs, self._inputs = self._images()
        if state != State.OP:
            self.motor.enabled = False

    # ---- process data

    def cycle(self, now: float, outputs: bytes | None, length: int) -> bytes:
        given = self._outputs.unpack(outputs) if outputs is not None else {}
        motor, setting = self.motor, self.objects.value
        if given.get((STEPPER, 2)):  # reset
            self._error = False
            motor.heat = 0.0
        self._set_counter(given)
        motor.enabled = bool(given.get((STEPPER, 1))) and not self._error
        motor.full_speed = (1000 << setting(0x8012, 5)) / max(1, setting(0x8010, 6))  # [turns/s]
        self._command(given)
        motor.advance(now, overload=setting(0x8010, 1) > MOTOR_LIMIT_MA)
        self._diagnose()
        self._toggle = not self._toggle
        return self._inputs.pack(self._status()).ljust(length, b"\0")[:length]

    def _set_counter(self, given: Values) -> None:
        asked = bool(given.get((ENCODER, 3)))
        if asked and not self._set_done:
            bits = self._outputs.fields[ENCODER, 0x11].bits
            self.motor.set_counter(signed(given[ENCODER, 0x11], bits), self._from_encoder)
        self._set_done = asked

    @property
    def _from_encoder(self) -> bool:
        return self.objects.value(0x8012, 8) == 0

    def _command(self, given: Values) -> None:
        """Commands the motor: a velocity, or a position on the counter."""
        if (STEPPER, 0x21) in given:
            self.motor.command_velocity(signed(given[STEPPER, 0x21], 16) / 32767)
            return
        execute, stop = bool(given.get((POSITIONING, 1))), bool(given.get((POSITIONING, 2)))
        start_type = given.get((POSITIONING, 0x22), ABSOLUTE)
        if execute and not self._executing and not stop and start_type in (ABSOLUTE, ABSOLUTE_CHANGE):
            target = signed(given[POSITIONING, 0x11], 32)
            speed, ramp = (self.objects.value(0x8020, i) for i in (2, 3))
            self.motor.command_position(target, self._from_encoder, speed / 10000, 1e-3 * max(1, ramp))
        if not execute or stop:
            self.motor.end_positioning()
        self._executing = execute

    def _diagnose(self) -> None:
        motor = self.motor
        faults = {
            OVER_TEMPERATURE: motor.heat >= HEATING_S,
            SHORT_CIRCUIT: motor.shorted,
            UNDER_VOLTAGE: motor.unpowered,
            OTHER: self._failed,
        }
        self._error |= any(faults.values())
        for subindex, value in (faults | {STALL: motor.stalled, SATURATED: motor.stalled}).items():
            self.objects.set(DIAGNOSIS, subindex, int(value))

    def _status(self) -> Values:
        motor = self.motor
        counter = motor.counter(self._from_encoder)
        encoder = {3: self._set_done, 16: self._toggle, 0x11: counter}
        stepper = {1: not self._error, 2: motor.enabled, 3: motor.stalled, 4: self._error}
        stepper |= {5: motor.speed > 0, 6: motor.speed < 0, 16: self._toggle}
        positioning = {1: motor.is_positioning, 2: motor.in_target, 4: self._error}
        positioning |= {8: motor.enabled and not motor.is_positioning, 0x11: counter}
        inputs = {0x6000: encoder, 0x6010: stepper, 0x6020: positioning}
        return {(index, i): value for index, values in inputs.items() for i, value in values.items()}


def coupler() -> Application:
    """EK1100."""
    return Application(Identity("EK1100", 0x044C2C52, 0x00120000, 0))


_SETTINGS = {  # index: name, entries: subindex, type, value after power on, name
    0x8000: ("ENC Settings", [(8, "B", 0, "Disable filter"), (14, "B", 0, "Reversion of rotation")]),
    0x8010: (
        "STM Motor settings",
        [
            (1, "H", 5000, "Maximal current"),  # [mA]
            (2, "H", 2500, "Reduced current"),
            (3, "H", 50000, "Nominal voltage"),
            (4, "H", 100, "Motor coil resistance"),
            (5, "H", 0, "Motor EMF"),
            (6, "H", 200, "Motor fullsteps"),
            (7, "H", 4096, "Encoder increments (4-fold)"),
            (9, "H", 0, "Start velocity"),
            (0x10, "H", 100, "Drive on delay time"),
            (0x11, "H", 150, "Drive off delay time"),
        ],
    ),
    0x8012: (
        "STM Features",
        [
            (1, "B", 0, "Operation mode"),
            (5, "B", 1, "Speed range"),  # 1000 << value full steps per second
            (8, "B", 1, "Feedback type"),  # 0: encoder, 1: internal counter
            (9, "B", 0, "Invert motor polarity"),
        ],
    ),
    0x8020: (
        "POS Settings",
        [
            (1, "h", 100, "Velocity min."),
            (2, "h", 10000, "Velocity max."),
            (3, "H", 1000, "Acceleration pos."),
            (4, "H", 1000, "Acceleration neg."),
            (5, "H", 1000, "Deceleration pos."),
            (6, "H", 1000, "Deceleration neg."),
            (7, "H", 100, "Emergency deceleration"),
            (8, "I", 0, "Calibration position"),
        ],
    ),
}
_DIAGNOSES = (  # names of the subindices from 1
    "Saturated, Over temperature, Torque overload, Under voltage, Over voltage, Short circuit A, Short circuit B, "
    "No control power, Misc error, Configuration, Motor stall"
).split(", ")
