"""Values packed into process data, as a list of PDO entries lays them out."""

from collections.abc import Iterable
from typing import NamedTuple


class Field(NamedTuple):
    """One value: object, and place and length in bits."""

    index: int
    subindex: int
    offset: int
    bits: int


Values = dict[tuple[int, int], int]


class ProcessImage:
    """Between bytes and values by (index, subindex); numbers are unsigned, see `signed`."""

    def __init__(self, entries: Iterable[int]):
        """`entries` are mapping entries as the object dictionary holds them: index, subindex, bits; 0 index: a gap."""
        self.fields: dict[tuple[int, int], Field] = {}
        place = 0
        for entry in entries:
            index, subindex, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
            if index:
                self.fields[index, subindex] = Field(index, subindex, place, bits)
            place += bits
        self.length = (place + 7) // 8  # bytes

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
    """The two's complement that an unsigned number stands for."""
    return value - (1 << bits) if value >> bits - 1 else value
