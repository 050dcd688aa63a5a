"""The lock that a program holds while it drives a bus, and so which folders of a bench are in use."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ctcr.bench.devices.fault import DeviceFault

NAME = "bus.lock"  # in the folder of the bench
LOCK_S = 3.0  # patience with a program that is just ending


@contextmanager
def bus_lock(folder: Path) -> Iterator[None]:
    """One program at a time drives the bus: a second master would take over the terminals of the first.

    Raises DeviceFault while another program holds it. A process that ends releases it.
    """
    handle = os.open(folder / NAME, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        end = time.monotonic() + LOCK_S
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > end:
                    remedy = "wait until it has ended, or end it"
                    raise DeviceFault("bus", "another program drives it", remedy) from None
                time.sleep(0.05)
        yield
    finally:
        os.close(handle)


def is_driven(folder: Path) -> bool:
    """Whether a program drives a bus from this folder now."""
    with suppress(OSError), open(folder / NAME, "rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def driven_folders() -> list[Path]:
    """The folders from which programs of this user drive a bus now: each holds its lock open."""
    found = set()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # of others, or just ended
            for entry in os.scandir(process / "fd"):
                with suppress(OSError):
                    found.add(Path(os.readlink(entry.path)))
    return sorted(path.parent for path in found if path.name == NAME and is_driven(path.parent))
