"""The folder where the processes of one bench meet, which only its owner can enter, and the names by which they meet.

It holds the control sockets of the simulators and the serial port of the simulated tracker, the lock of the bus, the
latch of the emergency stop, and records in shared memory.
"""

import os
import stat
from pathlib import Path

from ctcr.errors import InputError, Problem

VARIABLE = "CTCR_BENCH"  # of the environment: the folder
AURORA, ETHERCAT = "aurora", "ethercat"  # the simulators; the first is also the name of the tracker's serial port
MASTER, BUS = "ctcr0", "ctcr1"  # the pair of virtual network interfaces: of the master, of the simulated terminals


def private_folder(path: str | Path | None = None) -> Path:
    """The folder of the bench, made with mode 0700 where it does not exist.

    Without `path` it is that of the environment variable CTCR_BENCH, or one of this user's. Raises InputError where
    others own it or may enter it.
    """
    folder = Path(path or os.environ.get(VARIABLE) or _of_this_user())
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError as error:
        raise InputError(Problem(f"cannot make the folder: {error.strerror}", str(folder))) from None
    if status.st_uid != os.getuid():
        raise InputError(Problem("belongs to somebody else: name another folder", str(folder)))
    if stat.S_IMODE(status.st_mode) & 0o077:
        text = f"others may enter it, and so command the devices: chmod 700 {folder}"
        raise InputError(Problem(text, str(folder)))
    return folder


def _of_this_user() -> Path:
    """The folder of this user in all programs: `tempfile` would name another one while the disk is full."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "ctcr" if runtime else Path(os.environ.get("TMPDIR", "/tmp")) / f"ctcr-{os.getuid()}"
