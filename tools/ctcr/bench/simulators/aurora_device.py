"""The state of a simulated Aurora and its replies to the commands of the combined API."""

import re
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ctcr.bench.shared import ndi
from ctcr.bench.shared.ndi import RATE_HZ

PART_NUMBER = b"610029"
VERSION = (  # some clients send TX only where they read this freeze tag
    b"AURORA Control Firmware\nNDI S/N: SCb2-S12345\nCharacterization Date: 01/01/10\n"
    b"Freeze Tag: AURORA Rev 007\nFreeze Date: 12/21/10\n(C) Northern Digital Inc."
)
VOLUME = b"9-025000+025000-025000+025000-055000-005000+000000+000000+000000+00000011"
ERROR_INDICATOR = 0.0123
_COMMAND = re.compile(rb"([A-Z0-9]+)([: ]?)(.*)", re.DOTALL)
_BEFORE_INIT = {"INIT", "COMM", "RESET", "VER", "APIREV", "BEEP", "SFLIST"}
_OF_A_TOOL = {"PINIT", "PENA", "PDIS", "PHF", "PHINF"}
_OTHERS = {"PHSR", "PHRQ", "TSTART", "TSTOP", "TX", "BX"}
_NOT_TRACKING = _OF_A_TOOL | {"PHRQ", "TSTART", "COMM"}

Pose = tuple[np.ndarray, np.ndarray]  # position (3,) [m] in the tracker frame, quaternion (4,)


class Refusal(Exception):
    """The device answers ERROR with this code."""

    def __init__(self, code: int):
        self.code = code


@dataclass
class Port:
    """A tool: its handle, its plug, and the state into which the host has brought it."""

    handle: int
    socket: int
    channel: int
    serial_number: bytes
    present: bool
    initialised: bool = False
    enabled: bool = False

    @property
    def status(self) -> int:
        return ndi.TOOL_IN_PORT | ndi.INITIALISED * self.initialised | ndi.ENABLED * self.enabled


class Sight(NamedTuple):
    """One tool in one frame; `pose` None: missing."""

    pose: Pose | None
    out_of_volume: bool = False


class AuroraDevice:
    """The sensor has handle 0A; two more coils lie still, of which 0B shares the plug of 0A.

    `see(handle)` is called once a frame and tool at most.
    """

    def __init__(self, see: Callable[[int], Sight]):
        self._see = see
        self.reset()

    def reset(self) -> None:
        """Returns to the state after power on, as a serial break does."""
        self.initialised = self.tracking = False
        self.next_baud = ndi.RESET_BAUD
        ports = (
            Port(0x0A, 1, 0, b"1B0E8C01", present=True),
            Port(0x0B, 1, 1, b"1B0E8C01", present=False),  # shows once 0A is initialised
            Port(0x0C, 2, 0, b"2C0F9D02", present=True),
        )
        self._ports = {port.handle: port for port in ports}
        self._start = time.monotonic()
        self._seen: dict[int, tuple[int, Sight]] = {}  # by handle: frame, sight

    @property
    def frame(self) -> int:
        return int((time.monotonic() - self._start) * RATE_HZ) & 0xFFFFFFFF

    @property
    def frame_ends_in(self) -> float:
        """The time until the next frame begins [s]."""
        return (1 - (time.monotonic() - self._start) * RATE_HZ % 1) / RATE_HZ

    def acquire(self) -> None:
        """Looks at the tools as a frame begins, whether or not the host asks for it."""
        if self.tracking:
            list(self._sights(""))

    def answer(self, line: bytes) -> bytes:
        """The whole reply to a line without its carriage return. `next_baud` is the rate after it."""
        try:
            reply = self._dispatch(line)
        except Refusal as refusal:
            reply = b"ERROR%02X" % refusal.code
        except (ValueError, IndexError):
            reply = b"ERROR03"
        return reply if reply[:2] == struct.pack("<H", ndi.BX_START) else ndi.framed(reply)

    def _dispatch(self, line: bytes) -> bytes:
        match = _COMMAND.fullmatch(line)
        if not match:
            raise Refusal(0x01)
        name, separator, arguments = match.groups()
        if separator == b":":
            if len(arguments) < 4:
                raise Refusal(0x03)
            if arguments[-4:] != b"%04X" % ndi.crc16(line[:-4]):
                raise Refusal(0x04)
            arguments = arguments[:-4]
        command, options = name.decode(), arguments.decode("latin-1")
        if command not in _BEFORE_INIT | _OF_A_TOOL | _OTHERS:
            raise Refusal(0x01)
        if not self.initialised and command not in _BEFORE_INIT:
            raise Refusal(0x10)
        if self.tracking and command in _NOT_TRACKING:
            raise Refusal(0x0C)
        return self._tool_command(command, options) if command in _OF_A_TOOL else self._command(command, options)

    def _command(self, command: str, options: str) -> bytes:
        match command:
            case "INIT":
                self.tracking, self.initialised = False, True
                for port in self._ports.values():
                    port.initialised = port.enabled = False
            case "RESET":
                self.reset()
                return b"RESET"
            case "COMM":
                rates = {code: baud for baud, code in ndi.BAUD_CODES.items()}
                if len(options) == 5 and options[0] not in rates:
                    raise Refusal(0x06)
                if options[1:] != "0000":  # this line knows 8N1 without handshake only
                    raise Refusal(0x07)
                self.next_baud = rates[options[0]]
            case "VER":
                return b"024" if options[:1] == "5" else VERSION
            case "APIREV":
                return b"D.001.007"
            case "BEEP":
                return _chosen({str(count): b"1" for count in range(1, 10)}, options)
            case "SFLIST":
                replies = {"00": b"00000001", "01": b"4", "02": b"0", "03": b"1" + VOLUME}
                return _chosen(replies, options or "00")
            case "PHSR":
                return self._handles(options)
            case "PHRQ":
                raise Refusal(0x2D)
            case "TSTART":
                if options == "80":
                    self._start = time.monotonic()
                    self._seen.clear()
                self.tracking = True
            case "TSTOP":
                self.tracking = False
            case "TX":
                rows = [_tx_tool(*tool) for tool in self._sights(options)]
                return b"%02X%s0000" % (len(rows), b"".join(rows))
            case "BX":
                rows = [_bx_tool(*tool) for tool in self._sights(options)]
                body = struct.pack("<B", len(rows)) + b"".join(rows) + struct.pack("<H", 0)
                head = struct.pack("<HH", ndi.BX_START, len(body))
                return head + struct.pack("<H", ndi.crc16(head)) + body + struct.pack("<H", ndi.crc16(body))
        return b"OKAY"

    def _tool_command(self, command: str, arguments: str) -> bytes:
        """Commands whose arguments begin with a handle."""
        port = self._ports.get(int(arguments[:2], 16))
        if not port or not port.present:
            raise Refusal(0x08)
        match command:
            case "PINIT":
                port.initialised = True
                for other in self._ports.values():
                    other.present |= other.socket == port.socket
            case "PENA":
                if not port.initialised:
                    raise Refusal(0x0E)
                if arguments[2:] not in ("S", "D", "B"):
                    raise Refusal(0x09)
                port.enabled = True
            case "PDIS":
                port.enabled = False
            case "PHINF":
                parts = {
                    0x01: b"0B000010" + b"NDI".ljust(12) + b"001" + port.serial_number + b"%02X" % port.status,
                    0x02: b"00000000",
                    0x04: PART_NUMBER.ljust(20),
                    0x08: b"00",
                    0x10: b"00",
                    0x20: b"SCb2-S12" + b"10" + b"%02d%02d" % (port.socket, port.channel),
                    0x40: b"00",
                }
                options = int(arguments[2:6] or "0001", 16)
                return b"".join(text for bit, text in parts.items() if options & bit)
        return b"OKAY"

    def _handles(self, kind: str) -> bytes:
        present = [port for port in self._ports.values() if port.present]
        groups = {
            0: present,
            1: [],  # none waits to be freed
            2: [port for port in present if not port.initialised],
            3: [port for port in present if port.initialised and not port.enabled],
            4: [port for port in present if port.enabled],
        }
        ports = _chosen(groups, int(kind or "0", 16))
        return b"%02X" % len(ports) + b"".join(b"%02X%03X" % (port.handle, port.status) for port in ports)

    def _sights(self, options: str) -> Iterator[tuple[int, Sight | None, int, int]]:
        """Handle, sight (None: disabled), status and frame of every initialised tool."""
        if not self.tracking:
            raise Refusal(0x0C)
        report_all, frame = int(options or "0001", 16) & ndi.REPORT_OUT_OF_VOLUME, self.frame
        for port in self._ports.values():
            if port.present and port.initialised:
                sight, status = None, port.status
                if port.enabled:
                    if self._seen.get(port.handle, (None,))[0] != frame:
                        self._seen[port.handle] = frame, self._see(port.handle)
                    sight = self._seen[port.handle][1]
                    if sight.out_of_volume:
                        status |= ndi.OUT_OF_VOLUME
                        sight = sight if report_all else Sight(None)
                yield port.handle, sight, status, frame


def _chosen(replies: dict, option):
    if option not in replies:
        raise Refusal(0x23)
    return replies[option]


def _tx_tool(handle: int, sight: Sight | None, status: int, frame: int) -> bytes:
    state = b"DISABLED" if not sight else b"MISSING"
    if sight and sight.pose:
        position, quaternion = sight.pose
        numbers = [b"%+06d" % round(1e4 * q) for q in quaternion] + [b"%+07d" % round(1e5 * x) for x in position]
        state = b"".join(numbers) + b"%+06d" % round(1e4 * ERROR_INDICATOR)
    return b"%02X%s%08X%08X\n" % (handle, state, status, frame)


def _bx_tool(handle: int, sight: Sight | None, status: int, frame: int) -> bytes:
    if not sight:
        return struct.pack("<BB", handle, ndi.BX_DISABLED)
    if not sight.pose:
        return struct.pack("<BBII", handle, ndi.BX_MISSING, status, frame)
    position, quaternion = sight.pose
    return struct.pack("<BB8fII", handle, ndi.BX_VALID, *quaternion, *(1e3 * position), ERROR_INDICATOR, status, frame)
