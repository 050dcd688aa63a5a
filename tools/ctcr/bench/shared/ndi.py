"""NDI's combined API: how commands and replies are framed, its codes, and tool readings from replies to TX and BX.

A command is `NAME:arguments<CRC>` or, without CRC, `NAME arguments`, then a carriage return; a text reply ends with its
CRC and a carriage return.
"""

import math
import re
import struct
from dataclasses import dataclass
from functools import reduce

from ctcr.frames import BEYOND, QUATERNION_SLACK

RESET_MESSAGE = b"RESETBE6F\r"
RESET_BAUD = 9600
BAUD_CODES = {9600: "0", 14400: "1", 19200: "2", 38400: "3", 57600: "4", 115200: "5", 921600: "6", 230400: "A"}
RATE_HZ = 40.0  # of the Aurora's frames
BX_START = 0xA5C4
BX_VALID, BX_MISSING, BX_DISABLED = 1, 2, 4
REPORT_OUT_OF_VOLUME = 0x0800  # reply option; without it a tool out of volume counts as missing
TRANSFORMS = 0x0001  # reply option

TOOL_IN_PORT, INITIALISED, ENABLED, OUT_OF_VOLUME = 0x001, 0x010, 0x020, 0x040  # bits of the port status

ERRORS = {
    0x01: ("unknown command", "the device is no Aurora, or its firmware is older than the combined API"),
    0x03: ("incomplete command", "check the cable"),
    0x04: ("wrong CRC in a command", "check the cable and keep it away from the motors' cables"),
    0x06: ("baud rate not supported", "choose another `baud` in the bench file"),
    0x07: ("wrong parameters of the serial line", "choose another `baud` in the bench file"),
    0x08: ("unknown port handle", "a tool was unplugged: plug it in and connect again"),
    0x09: ("wrong tracking priority", "the tool cannot be tracked this way"),
    0x0C: ("command not possible in this mode", "connect again"),
    0x0E: ("tool not initialised", "unplug the tool, plug it in and connect again"),
    0x10: ("device not initialised", "connect again"),
    0x1A: ("internal failure", "switch the device off and on"),
    0x23: ("value out of range", "the device is no Aurora, or its firmware differs"),
    0x2D: ("cannot read the tool's memory", "unplug the tool and plug it in"),
}
SYSTEM_STATUS = {  # bit: fault, remedy
    0x0001: ("serial line out of step", "check the cable"),
    0x0004: ("failure of the hardware", "switch the device off and on"),
    0x0008: ("failure of a tool's hardware", "replace the tool"),
    0x0010: ("a tool was plugged in or unplugged", "connect again, so that its handle is known"),
    0x0100: ("diagnostic pending", "look at the device's lamps"),
}
NOT_TRACKED = "not tracked: disabled, or unplugged meanwhile"  # a tool that a reply leaves out
_CRC = [reduce(lambda crc, _: crc >> 1 ^ 0xA001 * (crc & 1), range(8), byte) for byte in range(256)]
_TX_POSE = struct.Struct("6s 6s 6s 6s 7s 7s 7s 6s")  # quaternion, position, error indicator: signed decimal numbers
_TX_TOOL = re.compile(rb"([0-9A-F]{2})(?:MISSING|DISABLED|([-+0-9]{51}))([0-9A-F]{8})([0-9A-F]{8})\n")
Numbers = tuple[float, ...]


class Garbled(Exception):
    """A reply that breaks the protocol: damaged on its way."""


@dataclass(frozen=True)
class ToolReading:
    """One tool in one frame; position and quaternion are None where the tracker did not see it, or sent no pose."""

    handle: int
    position: tuple[float, float, float] | None  # [m], tracker frame
    quaternion: tuple[float, float, float, float] | None  # w first
    error: float | None  # the tracker's error indicator, 0 to 9.9999; no unit
    status: int  # bits of the port status
    frame: int  # counts at RATE_HZ; two replies within one frame hold the same reading

    @property
    def out_of_volume(self) -> bool:
        return bool(self.status & OUT_OF_VOLUME)

    @property
    def is_seen(self) -> bool:
        return self.position is not None and not self.out_of_volume


def system_faults(status: int) -> list[tuple[str, str]]:
    """Fault and remedy of each bit of a system status."""
    return [text for bit, text in SYSTEM_STATUS.items() if status & bit]


def crc16(data: bytes) -> int:
    """CRC-16/ARC: reflected polynomial 0xA001, start 0."""
    crc = 0
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def framed(text: bytes) -> bytes:
    """A command or a text reply with its CRC and the carriage return."""
    return text + b"%04X\r" % crc16(text)


def parse_tx(text: bytes) -> tuple[list[ToolReading], int]:
    """Readings and system status of a TX reply without its CRC, asked with TRANSFORMS. Raises Garbled."""
    try:
        readings, at = [], 2
        for _ in range(int(text[:2], 16)):
            handle, pose, status, frame = (tool := _TX_TOOL.match(text, at)).groups()
            position = quaternion = error = None
            if pose:
                w, i, j, k, x, y, z, indicator = map(int, _TX_POSE.unpack(pose))
                quaternion, position = (1e-4 * w, 1e-4 * i, 1e-4 * j, 1e-4 * k), (1e-2 * x, 1e-2 * y, 1e-2 * z)
                position, quaternion, error = _possible(position, quaternion, 1e-4 * indicator)
            readings.append(ToolReading(int(handle, 16), position, quaternion, error, int(status, 16), int(frame, 16)))
            at = tool.end()
        return readings, int(text[at : at + 4], 16)
    except (ValueError, AttributeError):  # AttributeError: the pattern does not match
        raise Garbled("not a TX reply") from None


def parse_bx(body: bytes) -> tuple[list[ToolReading], int]:
    """Readings and system status of the body of a BX reply without its CRC, asked with TRANSFORMS. Raises Garbled."""
    try:
        readings, at = [], 1
        for _ in range(body[0]):
            handle, state = body[at : at + 2]
            at += 2
            if state == BX_DISABLED:
                continue
            position = quaternion = error = None
            if state == BX_VALID:
                *quaternion, x, y, z, error = struct.unpack_from("<8f", body, at)
                position, quaternion, error = _possible((x, y, z), tuple(quaternion), error)
                at += 32
            status, frame = struct.unpack_from("<II", body, at)
            readings.append(ToolReading(handle, position, quaternion, error, status, frame))
            at += 8
        return readings, struct.unpack_from("<H", body, at)[0]
    except (struct.error, ValueError, IndexError):
        raise Garbled("not a BX reply") from None


def _possible(position: Numbers, quaternion: Numbers, error: float) -> tuple:
    """Position [m] of one in mm, quaternion and error; None for each where they are no pose."""
    numbers = all(abs(number) < BEYOND for number in (*position, *quaternion))  # neither NaN nor infinite
    if not numbers or abs(math.hypot(*quaternion) - 1) > QUATERNION_SLACK:
        return None, None, None
    return tuple(1e-3 * number for number in position), quaternion, error
