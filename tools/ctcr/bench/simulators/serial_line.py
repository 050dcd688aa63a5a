"""A pseudo-terminal that behaves as a serial line: bytes at the pace of the baud rate, garbled at the wrong one."""

import os
import pty
import termios
import time
import tty
from collections import deque
from contextlib import suppress
from pathlib import Path

CHUNK_S = 0.004  # bytes leave together in chunks this long
BITS_PER_BYTE = 10  # 8N1
BAUDS = {getattr(termios, f"B{baud}"): baud for baud in (9600, 19200, 38400, 57600, 115200, 230400, 921600)}


class SerialLine:
    """The device's end; the host opens `link`, which points to the terminal while the line is plugged in."""

    def __init__(self, link: Path):
        self.link = link
        self.baud = 9600  # of the device
        self._master = self._slave = None
        self._leaving: deque[tuple[float, bytes]] = deque()  # when, what
        self._free_at = 0.0
        self.plug()

    def fileno(self) -> int:
        return self._master

    @property
    def plugged(self) -> bool:
        return self._master is not None

    def plug(self) -> None:
        self._master, self._slave = pty.openpty()  # held open, or a host that leaves would look like an error
        tty.setraw(self._slave)
        settings = termios.tcgetattr(self._slave)
        settings[4] = settings[5] = termios.B9600
        termios.tcsetattr(self._slave, termios.TCSANOW, settings)
        os.set_blocking(self._master, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """The host sees its port vanish."""
        self.link.unlink(missing_ok=True)
        self._leaving.clear()
        for end in (self._slave, self._master):
            os.close(end)
        self._master = self._slave = None

    def read(self) -> bytes:
        """Bytes of the host; none where it sends at another rate than the device's."""
        try:
            data = os.read(self._master, 4096)
        except (BlockingIOError, OSError):
            return b""
        return data if self.host_baud() == self.baud else b""

    def write(self, data: bytes, delay: float = 0.0) -> None:
        """Queues bytes; they leave `delay` seconds later, at the pace of the baud rate."""
        start = max(self._free_at, time.monotonic() + delay)
        size = max(1, int(CHUNK_S * self.baud / BITS_PER_BYTE))
        for at in range(0, len(data), size):
            chunk = data[at : at + size]
            start += len(chunk) * BITS_PER_BYTE / self.baud
            self._leaving.append((start, chunk))
        self._free_at = start

    def send_due(self) -> float | None:
        """Sends the chunks that are due; seconds until the next one, None where none waits."""
        while self._leaving and self._leaving[0][0] <= time.monotonic():
            _, chunk = self._leaving.popleft()
            if self.host_baud() != self.baud:
                chunk = bytes(byte ^ 0x55 for byte in chunk)  # garbled by the wrong rate
            with suppress(BlockingIOError):  # nobody reads: as on a wire, they are lost
                os.write(self._master, chunk)
        return max(0.0, self._leaving[0][0] - time.monotonic()) if self._leaving else None

    def host_baud(self) -> int | None:
        """The rate that the host has set."""
        return BAUDS.get(termios.tcgetattr(self._master)[4])
