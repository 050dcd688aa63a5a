"""Tool readings out of the tracker's answers TX (text) and BX (binary)."""

import struct
from dataclasses import dataclass

from ctcr.bench.devices import ndi_protocol as ndi


class Garbled(Exception):
    """An answer that is not what the protocol says: damaged on its way."""


@dataclass(frozen=True)
class ToolReading:
    """One tool in one frame; position and quaternion are None where the tracker did not see it."""

    handle: int
    position: tuple[float, float, float] | None  # [m], tracker frame
    quaternion: tuple[float, float, float, float] | None  # w first
    error: float | None  # the tracker's own indicator, 0 to 9.9999; no unit
    status: int  # bits of the port status
    frame: int  # counts at the tracker's rate; two answers of one frame hold the same reading

    @property
    def out_of_volume(self) -> bool:
        return bool(self.status & ndi.OUT_OF_VOLUME)


def parse_tx(text: bytes) -> tuple[list[ToolReading], int]:
    """Readings and system status of a TX answer without its CRC, asked with TRANSFORMS. Raises Garbled."""
    try:
        readings, place = [], 2
        for _ in range(int(text[:2], 16)):
            handle, place = int(text[place : place + 2], 16), place + 2
            missing = next((word for word in (b"MISSING", b"DISABLED") if text.startswith(word, place)), None)
            place += len(missing) if missing else 51
            pose = None if missing else _pose(text[place - 51 : place])
            status, frame = int(text[place : place + 8], 16), int(text[place + 8 : place + 16], 16)
            readings.append(ToolReading(handle, *(pose or (None, None, None)), status, frame))
            place += 17
        return readings, int(text[place : place + 4], 16)
    except ValueError:
        raise Garbled("not a TX answer") from None


def parse_bx(body: bytes) -> tuple[list[ToolReading], int]:
    """Readings and system status of the body of a BX answer without its CRC, asked with TRANSFORMS. Raises Garbled."""
    try:
        readings, place = [], 1
        for _ in range(body[0]):
            handle, state = body[place : place + 2]
            place += 2
            if state == ndi.BX_DISABLED:
                continue
            position = quaternion = error = None
            if state == ndi.BX_VALID:
                *quaternion, x, y, z, error = struct.unpack_from("<8f", body, place)
                position, quaternion = (1e-3 * x, 1e-3 * y, 1e-3 * z), tuple(quaternion)
                place += 32
            status, frame = struct.unpack_from("<II", body, place)
            readings.append(ToolReading(handle, position, quaternion, error, status, frame))
            place += 8
        return readings, struct.unpack_from("<H", body, place)[0]
    except (struct.error, ValueError, IndexError):
        raise Garbled("not a BX answer") from None


def _pose(text: bytes) -> tuple[tuple, tuple, float]:
    """Position [m], quaternion and error of 51 characters: 4 of width 6, 3 of width 7, 1 of width 6."""
    quaternion = tuple(1e-4 * int(text[6 * i : 6 * i + 6]) for i in range(4))
    position = tuple(1e-5 * int(text[24 + 7 * i : 31 + 7 * i]) for i in range(3))
    return position, quaternion, 1e-4 * int(text[45:51])
