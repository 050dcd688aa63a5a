"""A stepper motor terminal EL70x1: its object dictionary, its motor and what it exchanges with the bus."""

from ctcr.bench.shared.ethercat import DIAGNOSIS, ProcessImage, signed
from ctcr.bench.simulators.object_dictionary import OUT_OF_RANGE, Abort, Entry, ObjectDictionary, ServiceDataServer
from ctcr.bench.simulators.sii import Identity, SyncManager, eeprom
from ctcr.bench.simulators.slave_controller import OP
from ctcr.bench.simulators.stepper_motor import StepperMotor

MAILBOX = 128  # bytes
SYNC_MANAGERS = (
    SyncManager(0x1000, MAILBOX, 0x26, 1),
    SyncManager(0x1080, MAILBOX, 0x22, 2),
    SyncManager(0x1100, 8, 0x24, 3),
    SyncManager(0x1180, 8, 0x20, 4),
)
ENCODER, STEPPER, POSITIONING = 0x7000, 0x7010, 0x7020  # outputs; inputs are 0x1000 lower
SATURATED, OVER_TEMPERATURE, UNDER_VOLTAGE, SHORT_CIRCUIT, STALL = (0x01, 0x02, 0x04, 0x06, 0x0B)  # of DIAGNOSIS
MOTOR_LIMIT_MA = 1500  # more burns the motor that is connected
ABSOLUTE, ABSOLUTE_CHANGE = 1, 0x1001  # start types of the positioning interface


def _entry(index: int, subindex: int, bits: int) -> int:
    return index << 16 | subindex << 8 | bits


def _bits(index: int, count: int, pad: int = 0) -> list[int]:
    return [_entry(index, i, 1) for i in range(1, count + 1)] + ([_entry(0, 0, pad)] if pad else [])


_OUTPUTS = {
    0x1600: ("ENC Control compact", [*_bits(0x7000, 4, 12), _entry(0x7000, 0x11, 16)]),
    0x1601: ("ENC Control", [*_bits(0x7000, 4, 12), _entry(0x7000, 0x11, 32)]),
    0x1602: ("STM Control", _bits(0x7010, 3, 13)),
    0x1603: ("STM Position", [_entry(0x7010, 0x11, 32)]),
    0x1604: ("STM Velocity", [_entry(0x7010, 0x21, 16)]),
    0x1605: ("POS Control compact", [*_bits(0x7020, 2, 14), _entry(0x7020, 0x11, 32)]),
    0x1606: (
        "POS Control",
        [*_bits(0x7020, 2, 14), _entry(0x7020, 0x11, 32), *(_entry(0x7020, i, 16) for i in range(0x21, 0x25))],
    ),
}
_ENCODER_BITS, _STEPPER_BITS, _POSITIONING_BITS = _bits(0x6000, 16), _bits(0x6010, 16), _bits(0x6020, 8, 8)


def _inputs(positioning: int) -> dict[int, tuple[str, list[int]]]:
    """The numbers of the last two differ between variants of the terminal."""
    values = [_entry(0x6020, 0x11, 32), _entry(0x6020, 0x21, 16), _entry(0x6020, 0x22, 32)]
    return {
        0x1A00: ("ENC Status compact", [*_ENCODER_BITS, _entry(0x6000, 0x11, 16), _entry(0x6000, 0x12, 16)]),
        0x1A01: ("ENC Status", [*_ENCODER_BITS, _entry(0x6000, 0x11, 32), _entry(0x6000, 0x12, 32)]),
        0x1A03: ("STM Status", _STEPPER_BITS),
        positioning: ("POS Status compact", _POSITIONING_BITS),
        positioning + 1: ("POS Status", [*_POSITIONING_BITS, *values]),
    }


VARIANTS = {"EL7041": (0x1B813052, 0x1A06), "EL7031": (0x1B773052, 0x1A05)}  # product, first POS status


class StepperTerminal:
    """EL7041 by default, or another of VARIANTS."""

    sync_managers = SYNC_MANAGERS

    def __init__(self, number: int, variant: str = "EL7041"):
        product, positioning = VARIANTS[variant]
        self._identity = Identity(variant, product, 0x00190000, 1000 + number)
        self._mappings = _OUTPUTS | _inputs(positioning)
        self.eeprom = eeprom(self._identity, SYNC_MANAGERS)
        self.motor = StepperMotor()
        self.power_on()

    def power_on(self) -> None:
        """Settings and the counter are lost; the motor's shaft stays where it is."""
        self.objects = self._dictionary()
        self._server = ServiceDataServer(self.objects, MAILBOX)
        self.mail = self._server.answer
        self._outputs, self._inputs = self._images()
        self._toggle = self._executing = self._error = False
        self._set_done = False
        self.motor.power_on()

    # ---- settings

    def _dictionary(self) -> ObjectDictionary:
        objects, identity = ObjectDictionary(self._check), self._identity
        objects.variable(0x1000, "I", 0x00001389, "Device type")
        objects.variable(0x1008, "s", identity.name, "Device name")
        objects.variable(0x1009, "s", "05", "Hardware version")
        objects.variable(0x100A, "s", "12", "Software version")
        numbers = (identity.vendor, identity.product, identity.revision, identity.serial)
        names = ("Vendor ID", "Product code", "Revision", "Serial number")
        named = enumerate(zip(numbers, names, strict=True), start=1)
        objects.record(0x1018, "Identity", {i: Entry("I", value, name=text) for i, (value, text) in named})
        for index, (name, entries) in self._mappings.items():
            objects.record(index, name, {i: Entry("I", value) for i, value in enumerate(entries, start=1)})
        objects.record(0x1C00, "Sync manager type", {i: Entry("B", i) for i in range(1, 5)})
        for index, assigned in ((0x1C12, (0x1600, 0x1602, 0x1604)), (0x1C13, (0x1A00, 0x1A03))):
            slots = {i: Entry("H", (*assigned, 0, 0, 0)[i - 1], True) for i in range(1, 5)}
            objects.record(index, "Sync manager PDO assignment", slots, resizable=True)
            objects[index, 0] = len(assigned)
        for index, (name, entries) in _SETTINGS.items():
            made = {i: Entry(kind, value, True, text) for i, (kind, value, text) in entries.items()}
            objects.record(index, name, made)
        diagnosis = {i: Entry("?", 0, name=text) for i, text in _DIAGNOSES.items()}
        objects.record(DIAGNOSIS, "STM Diag data", diagnosis | {0x11: Entry("B", 0, name="Actual operation mode")})
        return objects

    def _check(self, index: int, subindex: int, value: int) -> None:
        """Aborts what the terminal does not accept."""
        if index in (0x1C12, 0x1C13) and subindex and value:
            side = 0x1600 if index == 0x1C12 else 0x1A00
            if value not in self._mappings or value & 0xFF00 != side:
                raise Abort(OUT_OF_RANGE)
        if (index, subindex) == (0x8010, 1) and not 0 < value <= 5000:
            raise Abort(OUT_OF_RANGE)

    def _images(self) -> tuple[ProcessImage, ProcessImage]:
        made = []
        for assignment in (0x1C12, 0x1C13):
            indices = [self.objects[assignment, i + 1] for i in range(self.objects[assignment, 0])]
            made.append(ProcessImage(e for index in indices if index for e in self._mappings[index][1]))
        return made[0], made[1]

    def lengths(self) -> tuple[int, int]:
        outputs, inputs = self._images()
        return outputs.length, inputs.length

    def entered(self, state: int) -> None:
        self._outputs, self._inputs = self._images()
        if state != OP:
            self.motor.enabled = False

    # ---- process data

    def cycle(self, now: float, outputs: bytes | None, length: int) -> bytes:
        given = self._outputs.unpack(outputs) if outputs is not None else {}
        if given.get((STEPPER, 2)):  # reset
            self._error = False
            self.motor.heat = 0.0
        self._set_counter(given)
        motor, objects = self.motor, self.objects
        motor.enabled = bool(given.get((STEPPER, 1))) and not self._error
        motor.full_speed = (1000 << objects[0x8012, 5]) / max(1, objects[0x8010, 6])  # [turns/s]
        self._command(given)
        motor.advance(now, overload=objects[0x8010, 1] > MOTOR_LIMIT_MA)
        self._diagnose()
        self._toggle = not self._toggle
        return self._inputs.pack(self._status()).ljust(length, b"\0")[:length]

    def _set_counter(self, given) -> None:
        asked = bool(given.get((ENCODER, 3)))
        if asked and not self._set_done:
            bits = self._outputs.fields[ENCODER, 0x11].bits
            self.motor.set_counter(signed(given[ENCODER, 0x11], bits), self._from_encoder)
        self._set_done = asked

    @property
    def _from_encoder(self) -> bool:
        return self.objects[0x8012, 8] == 0

    def _command(self, given) -> None:
        """What the motor is told: a velocity, or a place on the counter."""
        if (STEPPER, 0x21) in given:
            self.motor.command_velocity(signed(given[STEPPER, 0x21], 16) / 32767)
            return
        execute = bool(given.get((POSITIONING, 1)))
        stop = bool(given.get((POSITIONING, 2)))
        if execute and not self._executing and not stop:
            start_type = given.get((POSITIONING, 0x22), ABSOLUTE)
            if start_type in (ABSOLUTE, ABSOLUTE_CHANGE):
                self.motor.command_place(
                    signed(given[POSITIONING, 0x11], 32),
                    self._from_encoder,
                    self.objects[0x8020, 2] / 10000,
                    1e-3 * max(1, self.objects[0x8020, 3]),
                )
        if not execute or stop:
            self.motor.end_place()
        self._executing = execute

    def _diagnose(self) -> None:
        motor, objects = self.motor, self.objects
        flags = {
            OVER_TEMPERATURE: motor.is_too_hot,
            SHORT_CIRCUIT: motor.shorted,
            UNDER_VOLTAGE: motor.unpowered,
            STALL: motor.stalled,
            SATURATED: motor.stalled,
        }
        for subindex, value in flags.items():
            objects[DIAGNOSIS, subindex] = int(value)
        self._error |= any(flags[name] for name in (OVER_TEMPERATURE, SHORT_CIRCUIT, UNDER_VOLTAGE))

    def _status(self):
        motor = self.motor
        counter = motor.counter(self._from_encoder)
        return {
            (0x6000, 3): self._set_done,
            (0x6000, 16): self._toggle,
            (0x6000, 0x11): counter,
            (0x6010, 1): not self._error,
            (0x6010, 2): motor.enabled,
            (0x6010, 3): motor.stalled,
            (0x6010, 4): self._error,
            (0x6010, 5): motor.speed > 0,
            (0x6010, 6): motor.speed < 0,
            (0x6010, 16): self._toggle,
            (0x6020, 1): motor.is_positioning,
            (0x6020, 2): motor.at_place,
            (0x6020, 4): self._error,
            (0x6020, 8): motor.enabled and not motor.is_positioning,
            (0x6020, 0x11): counter,
        }


class Coupler:
    """EK1100: no process data, no mailbox."""

    sync_managers = ()
    eeprom = eeprom(Identity("EK1100", 0x044C2C52, 0x00120000, 0))

    def power_on(self) -> None:
        pass

    def mail(self, message: bytes) -> list[bytes]:
        return []

    def lengths(self) -> tuple[int, int]:
        return 0, 0

    def entered(self, state: int) -> None:
        pass

    def cycle(self, now: float, outputs: bytes | None, length: int) -> bytes:
        return b""


_SETTINGS = {
    0x8000: ("ENC Settings", {0x08: ("B", 0, "Disable filter"), 0x0E: ("B", 0, "Reversion of rotation")}),
    0x8010: (
        "STM Motor settings",
        {
            1: ("H", 5000, "Maximal current"),  # [mA]
            2: ("H", 2500, "Reduced current"),
            3: ("H", 50000, "Nominal voltage"),
            4: ("H", 100, "Motor coil resistance"),
            5: ("H", 0, "Motor EMF"),
            6: ("H", 200, "Motor fullsteps"),
            7: ("H", 4096, "Encoder increments (4-fold)"),
            9: ("H", 0, "Start velocity"),
            0x10: ("H", 100, "Drive on delay time"),
            0x11: ("H", 150, "Drive off delay time"),
        },
    ),
    0x8012: (
        "STM Features",
        {
            1: ("B", 0, "Operation mode"),
            5: ("B", 1, "Speed range"),  # 1000 << it fullsteps per second
            8: ("B", 1, "Feedback type"),  # 0: encoder, 1: internal counter
            9: ("B", 0, "Invert motor polarity"),
        },
    ),
    0x8020: (
        "POS Settings",
        {
            1: ("h", 100, "Velocity min."),
            2: ("h", 10000, "Velocity max."),
            3: ("H", 1000, "Acceleration pos."),
            4: ("H", 1000, "Acceleration neg."),
            5: ("H", 1000, "Deceleration pos."),
            6: ("H", 1000, "Deceleration neg."),
            7: ("H", 100, "Emergency deceleration"),
            8: ("I", 0, "Calibration position"),
        },
    ),
}
_DIAGNOSES = {
    1: "Saturated",
    2: "Over temperature",
    3: "Torque overload",
    4: "Under voltage",
    5: "Over voltage",
    6: "Short circuit A",
    7: "Short circuit B",
    8: "No control power",
    9: "Misc error",
    0x0A: "Configuration",
    0x0B: "Motor stall",
}
