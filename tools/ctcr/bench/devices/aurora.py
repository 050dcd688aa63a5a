"""The NDI Aurora tracker on a serial port: connects, finds the tools, reads frames."""

import os
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from ctcr.bench.devices.fault import DeviceFault, needed
from ctcr.bench.shared import ndi
from ctcr.bench.shared.ndi import Garbled, ToolReading

RESET_S = 5.0  # from the break to the device's message
PROBES_S = (0.2, 0.6)  # timeouts of the two rounds in which the baud rate is searched
CHECK_CABLE = "check the cable and its plugs, keep it away from the motors' cables"
OTHER_PORT = "is this the tracker's port"

T = TypeVar("T")


@dataclass(frozen=True)
class Tool:
    """A sensor coil as the device sees it; a 6D tool is one, two 5D tools in one plug are two."""

    handle: int
    serial_number: str
    part_number: str


@dataclass(frozen=True)
class Frame:
    """The reply to one TX or BX, and when it came in (`time.monotonic`)."""

    t: float  # [s]
    readings: list[ToolReading]
    system_status: int


class Aurora(AbstractContextManager):
    """One tracker. `connect` before `read`; every method raises DeviceFault. Not real-time safe: it waits.

    After a fault, `connect` starts anew, also where the cable was pulled in between.
    """

    def __init__(self, port: str, baud: int = 115200, replies: str = "BX", answer_s: float = 1.0, tries: int = 3):
        """`replies`: BX (binary, exact to 32 bits) or TX (text, rounded to 0.01 mm); `answer_s`: timeout of
        a reply [s]; `tries`: of a command whose reply came damaged."""
        self.port, self.baud, self.replies = port, baud, replies
        self._answer_s, self._tries = answer_s, tries
        self._fault = partial(DeviceFault, f"tracker {port}")
        self.version, self.tools = "", []
        self.damaged_answers = 0
        self._line = None

    # ---- connection

    def connect(self) -> None:
        """Resets the device, raises the baud rate, initialises and enables every tool, starts tracking."""
        for left in reversed(range(self._tries)):
            damaged = self.damaged_answers
            try:
                self.close()
                self._open()
                with self._port_errors():
                    self._reset()
                    self._set_baud()
                    self.version = self._ask("VER", "4")
                    self._find_tools()
                    self._ask("TSTART", "80")  # frame numbers start at 0
                return
            except DeviceFault:  # a command sent again is refused where only the first reply was damaged
                if not left or self.damaged_answers == damaged:
                    raise

    def close(self) -> None:
        """Closes the port; the device goes on tracking until the next reset."""
        if self._line:
            self._line.close()
        self._line = None

    def __exit__(self, *_) -> None:
        self.close()

    def read(self) -> Frame:
        """The newest frame. Frames come at the tracker's rate: asked faster, the same frame number comes again."""
        options = f"{ndi.REPORT_OUT_OF_VOLUME | ndi.TRANSFORMS:04X}"
        body, parse = (self._binary_reply, ndi.parse_bx) if self.replies == "BX" else (self._text_reply, ndi.parse_tx)

        def once() -> Frame:
            self._send(self.replies, options)
            content = body()
            return Frame(time.monotonic(), *parse(content))

        if not self._line:
            raise self._fault("not connected", "connect first")
        with self._port_errors():
            return self._retried(once)

    # ---- steps of the connection

    def _open(self) -> None:
        serial = needed("pyserial", "serial", f"tracker {self.port}")
        try:
            self._line = serial.Serial(self.port, ndi.RESET_BAUD, timeout=self._answer_s, exclusive=True)
        except (OSError, ValueError) as error:  # SerialException is an OSError; ValueError: a name that no file has
            reason = os.strerror(error.errno) if getattr(error, "errno", None) else str(error)
            remedy = "is it plugged in and switched on, and is the user in the port's group (usually dialout)?"
            raise self._fault(f"cannot open the port ({reason.lower()})", remedy) from None

    def _reset(self) -> None:
        """A break returns a device at any baud rate to 9600.

        A pseudo-terminal carries no break, so there the device is asked at each baud rate.
        """
        if not os.path.realpath(self.port).startswith("/dev/pts/"):
            self._line.send_break(0.3)
            self._line.timeout = RESET_S
            message = b""
            with suppress(Garbled):
                message = self._until_return()
            self._line.timeout = self._answer_s
            if message == ndi.RESET_MESSAGE[:-1]:
                self._ask("INIT", "")
                return
        fault = self._fault("no answer at any baud rate", f"switch it off and on; {OTHER_PORT}, and the cable whole?")
        for timeout in PROBES_S:
            for baud in dict.fromkeys((ndi.RESET_BAUD, self.baud, *ndi.BAUD_CODES)):
                try:
                    if self._answers_at(baud, timeout):
                        return
                except Garbled as reason:
                    what = f"its answers came damaged ({reason}), and no baud rate makes them readable"
                    fault = self._fault(what, f"{CHECK_CABLE}; {OTHER_PORT}?")
        raise fault

    def _answers_at(self, baud: int, timeout: float) -> bool:
        self._line.baudrate, self._line.timeout = baud, timeout
        self._line.reset_input_buffer()
        try:
            for name in ("TSTOP", "INIT"):  # a device left tracking would refuse the commands that follow
                self._send(name, "")
                line = self._until_return()
            if line and not _is_whole(line):
                raise Garbled("wrong CRC")
            return line[:-4] == b"OKAY"
        finally:
            self._line.timeout = self._answer_s

    def _set_baud(self) -> None:
        if self._line.baudrate == self.baud:
            return
        if self.baud not in ndi.BAUD_CODES:
            raise self._fault(f"{self.baud} baud is none of its rates", f"use one of {sorted(ndi.BAUD_CODES)}")
        self._ask("COMM", f"{ndi.BAUD_CODES[self.baud]}0000")
        time.sleep(0.1)  # the device replies at the old rate, then changes
        self._line.baudrate = self.baud

    def _find_tools(self) -> None:
        for handle in self._handles("01"):
            self._ask("PHF", f"{handle:02X}")
        begun: set[int] = set()
        while waiting := self._handles("02"):  # the second coil of a plug shows once the first is initialised
            for handle in waiting:
                if handle in begun:
                    text = f"the tool {handle:02X} waits again after it was initialised"
                    raise self._fault(text, "unplug the tool, switch the device off and on, and plug the tool in")
                self._ask("PINIT", f"{handle:02X}")
                begun.add(handle)
        self.tools = []
        for handle in self._handles("03"):
            about = self._ask("PHINF", f"{handle:02X}0005")
            self.tools.append(Tool(handle, about[23:31].strip(), about[33:53].strip()))
            self._ask("PENA", f"{handle:02X}D")
        if not self.tools:
            raise self._fault("no tool is plugged in", "plug the sensor into the device and connect again")

    def _handles(self, kind: str) -> list[int]:
        for _ in range(self._tries):
            text = self._ask("PHSR", kind)
            try:
                return [int(text[2 + 5 * i : 4 + 5 * i], 16) for i in range(int(text[:2], 16))]
            except ValueError:  # the late reply to an earlier command
                self.damaged_answers += 1
        raise self._fault("its answers belong to other commands", "connect again")

    # ---- commands and replies

    def _ask(self, name: str, arguments: str) -> str:
        """The text that a command is answered with."""

        def once() -> str:
            self._send(name, arguments)
            return self._text_reply().decode("latin-1")

        return self._retried(once)

    def _retried(self, once: Callable[[], T]) -> T:
        for _ in range(self._tries):
            try:
                return once()
            except Garbled:
                self.damaged_answers += 1
                self._drain()
        raise self._fault(f"{self._tries} answers in a row came damaged", f"{CHECK_CABLE}, or lower the baud rate")

    def _send(self, name: str, arguments: str) -> None:
        self._line.write(ndi.framed(f"{name}:{arguments}".encode()))

    def _text_reply(self) -> bytes:
        line = self._until_return()
        if not line:
            raise self._silence()
        return self._checked(line)

    def _binary_reply(self) -> bytes:
        start = self._line.read(2)
        if not start:
            raise self._silence()
        if start == b"ER":  # refusals are text
            self._checked(start + self._until_return())
            raise Garbled("text")
        head = start + self._exactly(6 - len(start))
        first, length, crc = struct.unpack("<3H", head)
        if first != ndi.BX_START or crc != ndi.crc16(head[:4]):
            raise Garbled("wrong header")
        data = self._exactly(length + 2)
        body, crc = data[:-2], data[-2:]
        if struct.unpack("<H", crc)[0] != ndi.crc16(body):
            raise Garbled("wrong CRC")
        return body

    def _checked(self, line: bytes) -> bytes:
        """The text of a line without its CRC. Raises Garbled where that is wrong, DeviceFault for a refusal."""
        text = line[:-4]
        if not _is_whole(line):
            raise Garbled("wrong CRC")
        if text.startswith(b"ERROR"):
            try:
                code = int(text[5:7], 16)
            except ValueError:
                remedy = "switch the device off and on; is it an Aurora?"
                raise self._fault("answers ERROR without a code", remedy) from None
            what, remedy = ndi.ERRORS.get(code, ("refused", "see the device's manual for this code"))
            raise self._fault(f"error {code:02X}, {what}", remedy, code)
        return text

    def _exactly(self, count: int) -> bytes:
        data = self._line.read(count)
        if len(data) < count:
            raise Garbled("cut short")
        return data

    def _until_return(self) -> bytes:
        """A line without its end; empty after a timeout."""
        data = self._line.read_until(b"\r")
        if data == b"\r":
            raise Garbled("an empty line")
        if data and not data.endswith(b"\r"):
            raise Garbled("cut short")
        return data[:-1]

    def _drain(self) -> None:
        """Waits until the line is silent, so that the next reply begins at its first byte."""
        end = time.monotonic() + self._answer_s
        while time.monotonic() < end and self._line.in_waiting:
            self._line.reset_input_buffer()
            time.sleep(0.02)

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        """Raises DeviceFault where the port is gone."""
        try:
            yield
        except (OSError, TypeError) as error:  # SerialException is an OSError; TypeError: the port was closed meanwhile
            self.close()
            reason = str(error).split(":")[0]
            raise self._fault(f"the port is gone ({reason})", "plug the cable in and connect again") from None

    def _silence(self) -> DeviceFault:
        remedy = "wait, or switch it off and on; after a change of its baud rate connect again"
        return self._fault(f"no answer within {self._answer_s:g} s", remedy)


def _is_whole(line: bytes) -> bool:
    """Whether the CRC at the end of a line is that of its text."""
    return line[-4:] == b"%04X" % ndi.crc16(line[:-4])
