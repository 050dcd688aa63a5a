"""Reads a log of any known format, which its content tells, not its name."""

from collections.abc import Callable
from pathlib import Path

from ctcr.errors import InputError, Problem, file_faults
from ctcr.intake import containers, hdf5, messages, text_log
from ctcr.intake.log import Log

MAX_BYTES = 1 << 31
_READERS: dict[bytes | tuple[bytes, ...], Callable[[Path, bytes], Log]] = {
    containers.MAT5: containers.read_mat,
    (hdf5.MATLAB, hdf5.SIGNATURE): containers.read_hdf5,
    messages.MCAP: messages.read_mcap,
}


def read(path: str | Path) -> Log:
    """The log of a file. Raises InputError where it cannot be read, with all its faulty rows."""
    with file_faults(path, "read"):
        if Path(path).stat().st_size > MAX_BYTES:
            raise InputError(Problem("is over 2 GB: split it", str(path)))
        content = Path(path).read_bytes()
    if content.startswith(b"PK"):
        raise InputError(Problem("is a spreadsheet: save it as CSV", str(path)))
    messages.refuse_bag(Path(path), content)
    for starts, reader in _READERS.items():
        if content.startswith(starts):
            return reader(Path(path), content)
    return text_log.read(Path(path), content)
