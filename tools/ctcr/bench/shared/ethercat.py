"""EtherCAT as master and terminals agree on it: states, status codes, process data as PDO entries lay them out."""

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple


class State(IntEnum):
    """AL states."""

    INIT, PREOP, BOOT, SAFEOP, OP = 1, 2, 3, 4, 8


ERROR_FLAG = 0x10  # of the AL status

STATUS_CODES = {  # AL status code: fault, remedy
    0x0001: ("unspecified error", "switch the terminals off and on"),
    0x0011: ("invalid requested state change", "connect again"),
    0x0012: ("unknown requested state", "connect again"),
    0x0016: ("invalid mailbox configuration", "connect again; is the terminal of the expected type?"),
    0x001A: ("synchronisation error", "use a longer bus period"),
    0x001B: (
        "watchdog: no process data for 100 ms, so the motors were switched off",
        "check the cable and the load of the computer, then release the stop and connect again",
    ),
    0x001D: ("invalid output configuration", "connect again; is the terminal of the expected type?"),
    0x001E: ("invalid input configuration", "connect again; is the terminal of the expected type?"),
    0x0050: ("EEPROM does not answer", "switch the terminals off and on"),
}
UNKNOWN_CODE = ("unknown status code", "see the terminal's manual for this code")

DIAGNOSIS = 0xA010  # object of a stepper terminal; its set subindices are the faults of the motor
DIAGNOSES = {  # subindex: fault, remedy
    1: ("current saturated", "the load is too high: move slower, look for friction"),
    2: ("terminal too hot", "check the motor current that is set and the air around the terminal, let it cool"),
    3: ("torque overload", "move slower, look for something that blocks the axis"),
    4: ("motor supply too low", "check the motor's power supply and its fuse"),
    5: ("motor supply too high", "check the motor's power supply; braking can raise it"),
    6: ("short circuit or over-current in coil A", "switch off, check the motor's cable and coil A"),
    7: ("short circuit or over-current in coil B", "switch off, check the motor's cable and coil B"),
    8: ("no control power", "check the power contacts of the terminals"),
    9: ("other error", "switch the terminals off and on"),
    10: ("wrong settings", "check the `motors` section of the bench file"),
    11: ("motor stalled", "something blocks the axis, or it moves too fast"),
}


def state_name(status: int) -> str:
    """The state that an AL status names, and whether its error flag is set, in words."""
    state = status & 0x0F
    name = State(state).name if state in set(State) else f"state {state:#x}"
    return name + (" with an error" if status & ERROR_FLAG else "")


class Field(NamedTuple):
    """Where a value lies in the process data: first bit, number of bits."""

    offset: int
    bits: int


Values = dict[tuple[int, int], int]


class ProcessImage:
    """Process data as bytes and as unsigned values by (index, subindex); see `signed`."""

    def __init__(self, entries: Iterable[int]):
        """`entries`: PDO mapping entries as objects hold them: index, subindex, number of bits; index 0 is padding."""
        self.fields: dict[tuple[int, int], Field] = {}
        offset = 0
        for entry in entries:
            index, subindex, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
            if index:
                self.fields[index, subindex] = Field(offset, bits)
            offset += bits
        self.length = (offset + 7) // 8  # bytes

    def unpack(self, data: bytes) -> Values:
        number = int.from_bytes(data, "little")
        return {key: number >> f.offset & (1 << f.bits) - 1 for key, f in self.fields.items()}

    def pack(self, values: Values) -> bytes:
        """Fields that `values` lacks are 0; values beyond a field are cut."""
        number = 0
        for key, value in values.items():
            if field := self.fields.get(key):
                number |= (int(value) & (1 << field.bits) - 1) << field.offset
        return number.to_bytes(self.length, "little")


def signed(value: int, bits: int) -> int:
    """The number that a two's complement of so many bits stands for."""
    return value - (1 << bits) if value >> bits - 1 else value
