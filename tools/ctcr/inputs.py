"""Input files: read as bytes, each with its fingerprint, so that a result can say what it was made from."""

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ctcr.errors import InputError, Problem, file_faults

MAX_BYTES = 64 << 20  # of an input that is parsed as a whole: that takes many times its size in memory

shared: dict[str, None] = {}  # files that every later result depends on, in the order read: users' effects
_fingerprints: dict[str, str] = {}


@contextmanager
def open_input(path: object) -> Iterator[BinaryIO]:
    """An input file to read as bytes. Raises InputError where it cannot be read; a pipe would be waited for in vain."""
    with (
        file_faults(path, "read"),
        open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file,
    ):
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise InputError(Problem("is a pipe or a device: give a file", file=str(path)))
        yield file
        file.seek(0)  # last: what is refused by its size or its beginning is not read to its end
        _fingerprints[str(path)] = hashlib.file_digest(file, "sha256").hexdigest()


def read(path: str | Path, hint: str, most: int = MAX_BYTES) -> bytes:
    """The content of an input file. Raises InputError, with the hint where it has over `most` bytes."""
    with open_input(path) as file:
        if os.fstat(file.fileno()).st_size > most:
            raise InputError(Problem(f"is over {most >> 20} MB: {hint}", str(path)))
        return file.read()


def sha256(path: str | Path) -> str:
    """The fingerprint of a file as it is, in hexadecimal. Raises InputError where it cannot be read."""
    with open_input(path):
        pass
    return _fingerprints[str(path)]


def fingerprint(path: str | Path) -> str:
    """The fingerprint of a file as it was when it was last read; raises as `sha256`."""
    return _fingerprints.get(str(path)) or sha256(path)
