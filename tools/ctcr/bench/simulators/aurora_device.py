"""The state of a simulated Aurora and its replies to the commands of the combined API."""

import re
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ctcr.bench.shared import ndi
from ctcr.bench.shared.ndi import RATE_HZ

FREEZE_TAG = "AURORA Rev 007"  # some clients send TX only where they read this
PART_NUMBER = b"610029"
_COMMAND = re.compile(rb"([A-Z0-9]+)([: ]?)(.*)", re.DOTALL)
_ANY_TIME = {"INIT", "COMM", "RESET", "VER", "APIREV", "BEEP", "SFLIST"}  # before INIT
_NOT_TRACKING = {"PINIT", "PENA", "PDIS", "PHINF", "PHF", "PHRQ", "TSTART", "COMM"}

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
        bits = ndi.TOOL_IN_PORT
        return bits | ndi.INITIALISED * self.initialised | ndi.ENABLED * self.enabled


@dataclass(frozen=True)
class Sight:
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
        """As after power on, and after a break."""
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
        """[s]"""
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
        command = name.decode()
        if not (handler := getattr(self, f"_on_{command.lower()}", None)):
            raise Refusal(0x01)
        if not self.initialised and command not in _ANY_TIME:
            raise Refusal(0x10)
        if self.tracking and command in _NOT_TRACKING:
            raise Refusal(0x0C)
        return handler(arguments.decode("latin-1"))

    # ---- device

    def _on_init(self, _: str) -> bytes:
        self.tracking, self.initialised = False, True
        for port in self._ports.values():
            port.initialised = port.enabled = False
        return b"OKAY"

    def _on_reset(self, _: str) -> bytes:
        self.reset()
        return b"RESET"

    def _on_comm(self, arguments: str) -> bytes:
        if len(arguments) != 5:
            raise Refusal(0x07)
        rates = {code: baud for baud, code in ndi.BAUD_CODES.items()}
        if arguments[0] not in rates:
            raise Refusal(0x06)
        if arguments[1:] != "0000":
            raise Refusal(0x07)  # this line knows 8N1 without handshake only
        self.next_baud = rates[arguments[0]]
        return b"OKAY"

    def _on_ver(self, option: str) -> bytes:
        if option[:1] == "5":
            return b"024"
        return (
            "AURORA Control Firmware\nNDI S/N: SCb2-S12345\nCharacterization Date: 01/01/10\n"
            f"Freeze Tag: {FREEZE_TAG}\nFreeze Date: 12/21/10\n(C) Northern Digital Inc."
        ).encode()

    def _on_apirev(self, _: str) -> bytes:
        return b"D.001.007"

    def _on_beep(self, count: str) -> bytes:
        if not re.fullmatch("[1-9]", count):
            raise Refusal(0x23)
        return b"1"

    def _on_sflist(self, option: str) -> bytes:
        volume = b"9-025000+025000-025000+025000-055000-005000+000000+000000+000000+00000011"
        answers = {"": b"00000001", "00": b"00000001", "01": b"4", "02": b"0", "03": b"1" + volume}
        if option not in answers:
            raise Refusal(0x23)
        return answers[option]

    # ---- tools

    def _on_phsr(self, kind: str) -> bytes:
        present = [port for port in self._ports.values() if port.present]
        groups = [
            present,
            [],  # none waits to be freed
            [port for port in present if not port.initialised],
            [port for port in present if port.initialised and not port.enabled],
            [port for port in present if port.enabled],
        ]
        if (number := int(kind or "0", 16)) >= len(groups):
            raise Refusal(0x23)
        ports = groups[number]
        return b"%02X" % len(ports) + b"".join(b"%02X%03X" % (port.handle, port.status) for port in ports)

    def _port(self, arguments: str) -> Port:
        port = self._ports.get(int(arguments[:2], 16))
        if not port or not port.present:
            raise Refusal(0x08)
        return port

    def _on_pinit(self, arguments: str) -> bytes:
        port = self._port(arguments)
        port.initialised = True
        for other in self._ports.values():
            other.present |= other.socket == port.socket
        return b"OKAY"

    def _on_pena(self, arguments: str) -> bytes:
        port = self._port(arguments)
        if not port.initialised:
            raise Refusal(0x0E)
        if arguments[2:] not in ("S", "D", "B"):
            raise Refusal(0x09)
        port.enabled = True
        return b"OKAY"

    def _on_pdis(self, arguments: str) -> bytes:
        self._port(arguments).enabled = False
        return b"OKAY"

    def _on_phf(self, arguments: str) -> bytes:
        self._port(arguments)
        return b"OKAY"

    def _on_phrq(self, _: str) -> bytes:
        raise Refusal(0x2D)

    def _on_phinf(self, arguments: str) -> bytes:
        port, options = self._port(arguments), int(arguments[2:6] or "0001", 16)
        parts = {
            0x01: b"0B000010" + b"NDI".ljust(12) + b"001" + port.serial_number + b"%02X" % port.status,
            0x02: b"00000000",
            0x04: PART_NUMBER.ljust(20),
            0x08: b"00",
            0x10: b"00",
            0x20: b"SCb2-S12" + b"10" + b"%02d%02d" % (port.socket, port.channel),
            0x40: b"00",
        }
        return b"".join(text for bit, text in parts.items() if options & bit)

    # ---- tracking

    def _on_tstart(self, option: str) -> bytes:
        if option == "80":
            self._start = time.monotonic()
            self._seen.clear()
        self.tracking = True
        return b"OKAY"

    def _on_tstop(self, _: str) -> bytes:
        self.tracking = False
        return b"OKAY"

    def _sights(self, options: str):
        """Port, its sight (None: disabled), its status and the frame, of every initialised port."""
        if not self.tracking:
            raise Refusal(0x0C)
        report_all, frame = int(options or "0001", 16) & ndi.REPORT_OUT_OF_VOLUME, self.frame
        for port in self._ports.values():
            if port.present and port.initialised:
                sight = self._sight(port.handle, frame) if port.enabled else None
                status = port.status | (ndi.OUT_OF_VOLUME if sight and sight.out_of_volume else 0)
                if sight and sight.out_of_volume and not report_all:
                    sight = Sight(None, True)
                yield port, sight, status, frame

    def _sight(self, handle: int, frame: int) -> Sight:
        if self._seen.get(handle, (None,))[0] != frame:
            self._seen[handle] = frame, self._see(handle)
        return self._seen[handle][1]

    def _on_tx(self, options: str) -> bytes:
        rows = []
        for port, sight, status, frame in self._sights(options):
            state = b"DISABLED" if not sight else _tx_pose(sight.pose) if sight.pose else b"MISSING"
            rows.append(b"%02X%s%08X%08X\n" % (port.handle, state, status, frame))
        return b"%02X%s0000" % (len(rows), b"".join(rows))

    def _on_bx(self, options: str) -> bytes:
        rows = []
        for port, sight, status, frame in self._sights(options):
            if not sight:
                rows.append(struct.pack("<BB", port.handle, ndi.BX_DISABLED))
                continue
            state = struct.pack("<BB", port.handle, ndi.BX_VALID if sight.pose else ndi.BX_MISSING)
            rows.append(state + _bx_pose(sight.pose) + struct.pack("<II", status, frame))
        body = struct.pack("<B", len(rows)) + b"".join(rows) + struct.pack("<H", 0)
        head = struct.pack("<HH", ndi.BX_START, len(body))
        return head + struct.pack("<H", ndi.crc16(head)) + body + struct.pack("<H", ndi.crc16(body))


ERROR_INDICATOR = 0.0123


def _tx_pose(pose: Pose) -> bytes:
    position, quaternion = pose
    numbers = [b"%+06d" % round(1e4 * q) for q in quaternion] + [b"%+07d" % round(1e5 * x) for x in position]
    return b"".join(numbers) + b"%+06d" % round(1e4 * ERROR_INDICATOR)


def _bx_pose(pose: Pose | None) -> bytes:
    if not pose:
        return b""
    return struct.pack("<8f", *pose[1], *(1e3 * pose[0]), ERROR_INDICATOR)
