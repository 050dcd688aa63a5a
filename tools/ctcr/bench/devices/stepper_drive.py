"""One stepper terminal (EL70x1) as the bus process uses it: its settings, and its process data by name."""

import struct
from dataclasses import dataclass
from functools import partial
from math import isfinite

from ctcr.bench.devices.bench_file import Motors
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.shared.ethercat import (
    DIAGNOSES,
    DIAGNOSIS,
    STATUS_CODES,
    UNKNOWN_CODE,
    ProcessImage,
    signed,
    state_name,
)

# Objects of outputs (0x7000) and inputs (0x6000): encoder, motor.
_SET_COUNTER, _COUNTER_VALUE = (0x7000, 3), (0x7000, 0x11)
_ENABLE, _RESET, _VELOCITY = (0x7010, 1), (0x7010, 2), (0x7010, 0x21)
_COUNTER, _COUNTER_SET = (0x6000, 0x11), (0x6000, 3)
_READY, _ERROR = (0x6010, 2), (0x6010, 4)
_RX, _TX = 0x1C12, 0x1C13  # PDO assignment of outputs and inputs
_WANTED = {_RX: (_COUNTER_VALUE, _ENABLE, _VELOCITY), _TX: (_COUNTER, _READY)}
_PDO_RANGES = {_RX: range(0x1600, 0x1610), _TX: range(0x1A00, 0x1A10)}
_FULL = 32767  # velocity at the full speed


@dataclass
class DriveInputs:
    """Inputs of one cycle."""

    counter: int
    ready: bool
    error: bool
    counter_set: bool


class StepperDrive:
    """A terminal on the bus in PREOP, with the process data layout that it reports itself."""

    def __init__(self, slave, position: int, settings: Motors, errors: tuple[type[Exception], ...]):
        """`slave` is that of pysoem; `errors`: its exceptions for a mailbox without a usable answer."""
        self.slave, self.position, self.settings, self._errors = slave, position, settings, errors
        self.fault = partial(DeviceFault, f"terminal {position} ({slave.name})")  # what, remedy, its own code
        self.full_speed = 0.0  # [turns/s]
        self._images: dict[int, ProcessImage] = {}

    def configure(self) -> None:
        """Writes settings and PDO assignment. Raises DeviceFault where the terminal refuses."""
        settings = self.settings
        self._write(0x8010, 1, "H", settings.current_mA)
        self._write(0x8010, 2, "H", settings.current_mA // 2)  # at rest
        self._write(0x8010, 6, "H", settings.full_steps)
        self._write(0x8010, 7, "H", settings.encoder_counts)
        self._write(0x8012, 8, "B", 0)  # feedback from the encoder, not from the commanded steps
        self.full_speed = (1000 << self._read(0x8012, 5, "B")) / settings.full_steps
        for assignment, wanted in _WANTED.items():
            self._assign(assignment, wanted)

    def _assign(self, assignment: int, wanted: tuple) -> None:
        """Assigns the PDOs that hold the wanted values in the fewest bytes, but with the counter in 32 bits."""
        mappings = {index: self._mapping(index) for index in _PDO_RANGES[assignment]}
        images = {index: ProcessImage(entries) for index, entries in mappings.items() if entries}
        chosen = set()
        for key in wanted:
            least = 32 if key in (_COUNTER_VALUE, _COUNTER) else 1
            holders = [i for i, image in images.items() if key in image.fields and image.fields[key].bits >= least]
            if not holders:
                raise self._not_a_drive()
            chosen.add(min(holders, key=lambda i: images[i].length))
        self._write(assignment, 0, "B", 0)
        for slot, index in enumerate(sorted(chosen), start=1):
            self._write(assignment, slot, "H", index)
        self._write(assignment, 0, "B", len(chosen))
        self._images[assignment] = ProcessImage(entry for index in sorted(chosen) for entry in mappings[index])

    def _mapping(self, index: int) -> list[int]:
        try:
            return [self._read(index, i, "I") for i in range(1, self._read(index, 0, "B") + 1)]
        except self._errors:
            return []

    # ---- process data

    def command(self, enable: bool, speed: float, counter: int | None = None, reset: bool = False) -> None:
        """For the next cycle: `speed` [turns/s], cut at the full speed; `counter`: its value from now on.

        A speed that is not a number is rest. A terminal takes the rising edge of `reset` as the acknowledgement of its
        error.
        """
        fraction = max(-1.0, min(1.0, speed / self.full_speed)) if isfinite(speed) else 0.0  # NaN compares to 1
        outputs = {_ENABLE: enable, _RESET: reset, _VELOCITY: round(fraction * _FULL)}
        if counter is not None:
            outputs |= {_SET_COUNTER: 1, _COUNTER_VALUE: counter}
        self.slave.output = self._images[_RX].pack(outputs)

    def inputs(self) -> DriveInputs:
        """The inputs of the last cycle."""
        values = self._images[_TX].unpack(self.slave.input)
        return DriveInputs(
            counter=signed(values[_COUNTER], 32),
            ready=bool(values[_READY]),
            error=bool(values[_ERROR]),
            counter_set=bool(values.get(_COUNTER_SET)),
        )

    # ---- faults

    def diagnosis(self) -> DeviceFault:
        """Why the terminal reports an error: asked over the mailbox, milliseconds."""
        try:
            found = [i for i in DIAGNOSES if self._read(DIAGNOSIS, i, "B")]
        except self._errors:
            found = []
        if not found:
            return self.fault("reports an error", "switch the terminals off and on")
        what = ", ".join(DIAGNOSES[i][0] for i in found)
        return self.fault(f"{what} (A010:{found[0]:02X})", DIAGNOSES[found[0]][1], found[0])

    def state_fault(self) -> DeviceFault:
        """Why the terminal is not in OP; its state must have been read."""
        code = self.slave.al_status
        what, remedy = STATUS_CODES.get(code, UNKNOWN_CODE)
        return self.fault(f"is in {state_name(self.slave.state)}, {what} ({code:#06x})", remedy, code)

    def _not_a_drive(self) -> DeviceFault:
        remedy = "compare the terminals in the bench file with `ctcr devices`"
        return self.fault("is no stepper terminal with an encoder, or does not answer", remedy)

    # ---- object dictionary

    def _read(self, index: int, subindex: int, kind: str) -> int:
        return struct.unpack_from("<" + kind, self.slave.sdo_read(index, subindex))[0]

    def _write(self, index: int, subindex: int, kind: str, value: int) -> None:
        try:
            self.slave.sdo_write(index, subindex, struct.pack("<" + kind, value))
        except self._errors as error:
            code = getattr(error, "abort_code", None)
            if code is None:  # of an SdoError alone: the terminal has answered, and refused
                raise self._not_a_drive() from error
            what = f"refuses {value} for {index:04X}:{subindex:02X} ({error.desc})"
            raise self.fault(what, "check the `motors` section of the bench file", code) from None
