"""Reads a log of any known format, which its content tells, not its name."""

from collections.abc import Callable
from pathlib import Path

from ctcr import inputs
from ctcr.errors import InputError, Problem
from ctcr.intake import containers, hdf5, messages, text_log
from ctcr.intake.log import Log

MAX_BYTES = 1 << 31
_READERS: dict[bytes | tuple[bytes, ...], Callable[[Path, bytes], Log]] = {
    containers.MAT5: containers.read_mat,
    (hdf5.MATLAB, hdf5.SIGNATURE): containers.read_hdf5,
    messages.MCAP: messages.read_mcap,
    (containers.NPY, b"PK"): containers.read_numpy,
    (b"{", b"[{", b"[\n", b"[\r"): containers.read_json,
}
_SHEET = "is a spreadsheet: save the sheet of the log as CSV"
_FRAME = 'read it in Python, and save it with frame.to_csv("log.csv", index=False) of pandas, or numpy.savez'
_REFUSED: dict[bytes | tuple[bytes, ...], str] = messages.BAGS | {
    b"\xd0\xcf\x11\xe0": _SHEET,
    (b"\x80\2", b"\x80\3", b"\x80\4", b"\x80\5"): f"is a pickle of Python, which may run code: {_FRAME}",
}


def read(path: str | Path) -> Log:
    """The log of a file. Raises InputError where it cannot be read, with all its faulty rows."""
    content = inputs.read(path, "split it", MAX_BYTES)
    if content.startswith(b"PK") and b".npy" not in content:
        raise InputError(Problem(_SHEET, str(path)))
    for starts, text in _REFUSED.items():
        if content.startswith(starts):
            raise InputError(Problem(text, str(path)))
    for starts, reader in _READERS.items():
        if content.startswith(starts):
            return reader(Path(path), content)
    return text_log.read(Path(path), content)
