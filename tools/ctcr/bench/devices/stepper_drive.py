"""One stepper terminal (EL70x1) as the bus owner uses it: settings, and process data by name."""

import struct
from dataclasses import dataclass

from ctcr.bench.devices.ethercat_codes import DIAGNOSES, DIAGNOSIS, diagnosis_text, state_name, status_text
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.process_image import ProcessImage, signed

# Objects of outputs (0x7000) and inputs (0x6000): encoder, motor.
_SET_COUNTER, _COUNTER_VALUE = (0x7000, 3), (0x7000, 0x11)
_ENABLE, _RESET, _VELOCITY = (0x7010, 1), (0x7010, 2), (0x7010, 0x21)
_COUNTER, _COUNTER_SET = (0x6000, 0x11), (0x6000, 3)
_READY, _ERROR = (0x6010, 2), (0x6010, 4)
_WANTED = {0x1C12: (_COUNTER_VALUE, _ENABLE, _VELOCITY), 0x1C13: (_COUNTER, _READY)}
_PDO_RANGES = {0x1C12: range(0x1600, 0x1610), 0x1C13: range(0x1A00, 0x1A10)}
_FULL = 32767  # velocity at the full speed
_SPEED_RANGE = (0x8012, 5)


@dataclass(frozen=True)
class DriveSettings:
    """What a terminal must know of its motor before it may switch it on."""

    current_mA: int = 1000
    full_steps: int = 200  # of a turn
    encoder_counts: int = 4096  # of a turn, four edges a line


@dataclass
class DriveInputs:
    """What a terminal says in one cycle."""

    counter: int
    ready: bool
    error: bool
    counter_set: bool


class StepperDrive:
    """A terminal on the bus in PREOP; `slave` is that of pysoem. Its process data are laid out as it says itself."""

    def __init__(self, slave, position: int, settings: DriveSettings):
        self.slave, self.position, self.settings = slave, position, settings
        self.name = f"terminal {position} ({slave.name})"
        self.full_speed = 0.0  # [turns/s]
        self._images: dict[int, ProcessImage] = {}
        self._outputs: dict[tuple[int, int], int] = {}

    def configure(self) -> None:
        """Writes settings and PDO assignment, and reads them back. Raises DeviceFault where the terminal refuses."""
        settings = self.settings
        self._write(0x8010, 1, "H", settings.current_mA)
        self._write(0x8010, 2, "H", settings.current_mA // 2)  # at rest
        self._write(0x8010, 6, "H", settings.full_steps)
        self._write(0x8010, 7, "H", settings.encoder_counts)
        self._write(0x8012, 8, "B", 0)  # feedback from the encoder, not from the commanded steps
        self.full_speed = (1000 << self._read(*_SPEED_RANGE, "B")) / settings.full_steps
        for assignment, wanted in _WANTED.items():
            self._assign(assignment, wanted)

    def _assign(self, assignment: int, wanted: tuple) -> None:
        """Assigns the PDOs that hold the wanted values in the fewest bytes, but with the counter in 32 bits."""
        found: dict[int, list[int]] = {}
        for index in _PDO_RANGES[assignment]:
            entries = self._mapping(index)
            if entries:
                found[index] = entries
        chosen = []
        for key in wanted:
            holders = [
                (ProcessImage(entries).length, index)
                for index, entries in found.items()
                if (field := ProcessImage(entries).fields.get(key))
                and (key not in (_COUNTER_VALUE, _COUNTER) or field.bits == 32)
            ]
            if not holders:
                raise self._not_a_drive()
            chosen.append(min(holders)[1])
        chosen = sorted(set(chosen))
        self._write(assignment, 0, "B", 0)
        for slot, index in enumerate(chosen, start=1):
            self._write(assignment, slot, "H", index)
        self._write(assignment, 0, "B", len(chosen))
        self._images[assignment] = ProcessImage(entry for index in chosen for entry in found[index])

    def _mapping(self, index: int) -> list[int]:
        import pysoem

        try:
            count = self._read(index, 0, "B")
            return [self._read(index, i, "I") for i in range(1, count + 1)]
        except (pysoem.SdoError, *_silences()):
            return []

    # ---- process data

    def command(self, enable: bool, speed: float, reset: bool = False, counter: int | None = None) -> None:
        """For the next cycle: `speed` [turns/s], cut at the full speed; `counter`: what it shall show from now on."""
        share = max(-1.0, min(1.0, speed / self.full_speed))
        outputs = {_ENABLE: enable, _RESET: reset, _VELOCITY: round(share * _FULL)}
        if counter is not None:
            outputs |= {_SET_COUNTER: 1, _COUNTER_VALUE: counter}
        self.slave.output = self._images[0x1C12].pack(outputs)

    def inputs(self) -> DriveInputs:
        """As of the last cycle."""
        values = self._images[0x1C13].unpack(self.slave.input)
        return DriveInputs(
            counter=signed(values[_COUNTER], 32),
            ready=bool(values[_READY]),
            error=bool(values[_ERROR]),
            counter_set=bool(values.get(_COUNTER_SET)),
        )

    # ---- what is wrong

    def diagnosis(self) -> DeviceFault:
        """Why the terminal reports an error: asked over the mailbox, milliseconds."""
        import pysoem

        try:
            found = [i for i in DIAGNOSES if self._read(DIAGNOSIS, i, "B")]
        except (pysoem.SdoError, *_silences()):
            found = []
        if not found:
            return self.fault("reports an error", "switch the terminals off and on")
        texts = [diagnosis_text(i) for i in found]
        what = ", ".join(text for text, _ in texts)
        return self.fault(f"{what} (A010:{found[0]:02X})", texts[0][1], found[0])

    def state_fault(self) -> DeviceFault:
        """Why the terminal is not in OP; its state must have been read."""
        code = self.slave.al_status
        what, remedy = status_text(code)
        return self.fault(f"is in {state_name(self.slave.state)}, {what} ({code:#06x})", remedy, code)

    def _not_a_drive(self) -> DeviceFault:
        remedy = "compare the terminals in the bench file with `ctcr devices`"
        return self.fault("is no stepper terminal with an encoder, or does not answer", remedy)

    def fault(self, what: str, remedy: str, code: int | None = None) -> DeviceFault:
        return DeviceFault(self.name, what, remedy, code)

    # ---- object dictionary

    def _read(self, index: int, subindex: int, kind: str) -> int:
        data = self.slave.sdo_read(index, subindex)
        return struct.unpack("<" + kind, data[: struct.calcsize("<" + kind)])[0]

    def _write(self, index: int, subindex: int, kind: str, value: int) -> None:
        import pysoem

        try:
            self.slave.sdo_write(index, subindex, struct.pack("<" + kind, value))
        except pysoem.SdoError as error:
            what = f"refuses {value} for {index:04X}:{subindex:02X} ({error.desc})"
            raise self.fault(what, "check the `motors` section of the bench file", error.abort_code) from None
        except _silences() as error:
            raise self._not_a_drive() from error


def _silences() -> tuple[type[Exception], ...]:
    """How pysoem says that no answer came, or a damaged one."""
    import pysoem

    return pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError
