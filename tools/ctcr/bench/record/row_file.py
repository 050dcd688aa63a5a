"""A table that grows row by row: written rows survive whatever happens next."""

import csv
import io
import os
from collections.abc import Iterable, Sequence
from math import isfinite, nan
from pathlib import Path

from ctcr.errors import InputError, Problem, file_faults, shown

MEND = "correct or remove it, or choose another name"
Row = Iterable[float | str]


class RowFile:
    """Rows are appended in groups, those of one row of a plan. A group is on the disk when `append` returns."""

    def __init__(self, path: Path, columns: Sequence[str], group: int = 1, synced: bool = True):
        """Resumes behind the last whole group of an existing file; a group has `group` rows. Raises InputError.

        Not `synced`, a group survives the end of this process when `append` returns, and a power cut when `sync` does:
        for loops that cannot wait for a disk.
        """
        self.path, self._columns, self._synced = path, columns, synced
        header = (",".join(columns) + "\n").encode()
        with file_faults(path, "write"):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            content = path.read_bytes()
            if not content.startswith(header[: len(content)]):
                text = f"holds other columns than {','.join(columns)}: choose another name"
                raise InputError(Problem(text, str(path), 1, line_name="row"))
            whole = [line for line in content[len(header) :].splitlines(keepends=True) if line.endswith(b"\n")]
            self.groups = len(whole) // group
            whole = whole[: self.groups * group]
            self._row = len(whole) + 1  # of the file, that of `last`
            self.last: list[str] | None = self._fields(whole[-1]) if whole else None
            kept = header + b"".join(whole)
            if content != kept:  # the power was cut while a group was being written
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, kept, 0)
            self._end = len(kept)
            os.fsync(self._file)

    def _fields(self, line: bytes) -> list[str]:
        try:
            fields = next(csv.reader([line.decode()]))
        except UnicodeDecodeError:
            raise self.fault(f"is not text in UTF-8: {MEND}") from None
        if len(fields) != len(self._columns):
            raise self.fault(f"has {len(fields)} fields: the header has {len(self._columns)}: {MEND}")
        return fields

    def last_number(self, column: str) -> float:
        """The number in a column of `last`. Raises InputError where it is none."""
        text = self.last[self._columns.index(column)]
        try:
            number = float(text)
        except ValueError:
            number = nan
        if not isfinite(number):
            raise self.fault(f"{shown(text)} is not a number: {MEND}", column)
        return number

    def fault(self, text: str, column: str | None = None) -> InputError:
        """The error that the last row makes, or its field in a column."""
        return InputError(Problem(text, str(self.path), self._row, column, line_name="row"))

    def append(self, rows: list[Row]) -> None:
        """One group, in the order of the columns; NaN is an empty field. Raises InputError where the disk is full."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([map(_field, row) for row in rows])
        data = text.getvalue().encode()
        with file_faults(self.path, "write"):
            try:
                written = os.pwrite(self._file, data, self._end)
                if written < len(data):
                    os.pwrite(self._file, data[written:], self._end + written)
                if self._synced:
                    os.fsync(self._file)
            except OSError:
                os.ftruncate(self._file, self._end)  # no half of a group
                raise
        self._end += len(data)
        self.groups += 1

    def sync(self) -> None:
        """Writes all appended rows to the disk before it returns. Raises InputError."""
        with file_faults(self.path, "write"):
            os.fsync(self._file)

    def close(self) -> None:
        os.close(self._file)


def _field(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return "" if value != value else f"{value:.12g}"
