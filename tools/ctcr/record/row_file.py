"""The table of measurements while it is being made: what has been written stays, whatever happens next."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ctcr.errors import InputError, Problem, file_fault
from ctcr.measurements import group_columns

Array = NDArray[np.float64]


class RowFile:
    """Rows are appended in groups, those of one row of the plan. A group is on the disk when `append` returns."""

    def __init__(self, path: Path, n_tubes: int, group: int):
        """Goes on behind the last whole group of a file that is there; `group` rows make one. Raises InputError."""
        self.path = path
        columns = [name for names in group_columns(n_tubes).values() for name in names]
        header = (",".join(columns) + "\n").encode()
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            content = path.read_bytes()
            if not content.startswith(header[: len(content)]):
                text = "holds other columns than this robot's recording: choose another folder"
                raise InputError(Problem(text, str(path), 1, line_name="row"))
            lines = content[len(header) :].splitlines(keepends=True)
            whole = [line for line in lines if line.endswith(b"\n")]
            self.groups = len(whole) // group
            kept = header + b"".join(whole[: self.groups * group])
            if content != kept:  # the power was cut while a group was being written
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, kept, 0)
            self.dropped = len(lines) - self.groups * group
            self._end = len(kept)
            self.last_t = float(whole[self.groups * group - 1].split(b",")[0]) if self.groups else 0.0
            os.fsync(self._file)
        except OSError as error:
            raise file_fault(error, path, "write") from None

    def append(self, rows: list[Array]) -> None:
        """One group, in the order of the columns; NaN is an empty field. Raises InputError where the disk is full."""
        text = "".join(",".join("" if v != v else f"{v:.12g}" for v in row) + "\n" for row in rows)
        data = text.encode()
        try:
            written = os.pwrite(self._file, data, self._end)
            if written < len(data):
                os.pwrite(self._file, data[written:], self._end + written)
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._end)  # no half of a group
            raise file_fault(error, self.path, "write") from None
        self._end += len(data)
        self.groups += 1

    def close(self) -> None:
        os.close(self._file)
