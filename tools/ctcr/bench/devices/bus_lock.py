"""One program at a time drives the bus: a second master would take the terminals away from the first."""

import fcntl
import os
import time
from pathlib import Path

from ctcr.bench.devices.fault import DeviceFault

PATIENCE_S = 3.0  # with a program that is just ending


class BusLock:
    """Held inside of a `with` block, and until the process ends at the latest."""

    def __init__(self, folder: Path):
        self._path = folder / "bus.lock"

    def __enter__(self) -> "BusLock":
        """Raises DeviceFault where another program keeps it."""
        self._file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return self
            except BlockingIOError:
                if time.monotonic() > end:
                    os.close(self._file)
                    remedy = "wait until it has ended, or end it"
                    raise DeviceFault("bus", "another program drives it", remedy) from None
                time.sleep(0.05)

    def __exit__(self, *_) -> None:
        os.close(self._file)
