"""Reads a log of any known format, which its content tells, not its name."""

from pathlib import Path

from ctcr.errors import InputError, Problem, file_faults
from ctcr.intake import containers, text_log
from ctcr.intake.log import Log

MAX_BYTES = 1 << 31


def read(path: str | Path) -> Log:
    """The log of a file. Raises InputError where it cannot be read, with all its faulty rows."""
    with file_faults(path, "read"):
        if Path(path).stat().st_size > MAX_BYTES:
            raise InputError(Problem("is over 2 GB: split it", str(path)))
        content = Path(path).read_bytes()
    if content.startswith(b"PK"):
        raise InputError(Problem("is a spreadsheet: save it as CSV", str(path)))
    if content.startswith((containers.MAT5, containers.HDF5)):
        return containers.read_mat(Path(path), content)
    if content.startswith(containers.MCAP):
        return containers.read_mcap(Path(path), content)
    return text_log.read(Path(path), content)
