"""A record that one process writes and others read, in a file of the bench's folder that is mapped into memory.

The reader takes a copy and verifies its checksum, so that it never sees a write half done; nobody waits.
"""

import mmap
import os
import zlib
from pathlib import Path

import numpy as np

TRIES = 100
MOST_AXES = 8  # two a tube
MOTORS = np.dtype([("t", "f8"), ("turns", "f8", MOST_AXES)])  # monotonic time [s], turns of each shaft since home
_CHECK = 4  # bytes of the checksum


class SharedRecord:
    """`fields` is a numpy record type. One writer: `write(**values)`; any number of readers: `read()`."""

    def __init__(self, path: Path, fields: np.dtype, writer: bool = False):
        self._fields = np.dtype(fields)
        size = self._fields.itemsize + _CHECK
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            if os.fstat(handle).st_size < size:
                os.truncate(handle, size)
            self._memory = mmap.mmap(handle, size)
        finally:
            os.close(handle)
        self._values = np.zeros((), self._fields)
        if writer:
            self.write()

    def write(self, **values) -> None:
        """Changes some fields; the others stay. An array may be shorter than its field: the rest stays 0."""
        for name, value in values.items():
            if np.ndim(value):
                self._values[name][: len(value)] = value
            else:
                self._values[name] = value
        data = self._values.tobytes()
        self._memory[:] = zlib.crc32(data).to_bytes(_CHECK, "little") + data

    def read(self) -> np.void | None:
        """A copy of all fields; None before the first write."""
        for _ in range(TRIES):
            data = self._memory[:]
            if zlib.crc32(data[_CHECK:]) == int.from_bytes(data[:_CHECK], "little"):
                return np.frombuffer(data, self._fields, offset=_CHECK)[0] if any(data[:_CHECK]) else None
        return None


def shared_motors(folder: Path, writer: bool = False) -> SharedRecord:
    """The record of MOTORS, translations first: the simulated bus writes it, the simulated robot reads it."""
    return SharedRecord(folder / "motors", MOTORS, writer)
