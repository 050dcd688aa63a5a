"""A table that is a DataFrame: read as one in a file is, with the same faults. Its first row counts as row 2, too."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.arrays import Array, Integers, Mask
from ctcr.errors import InputError, Problem, shown
from ctcr.table.csv_table import Faults

NAME = "DataFrame"  # in messages


class FrameTable:
    """A DataFrame with the interface of NumberTable: of pandas, or one with `columns` and its columns by name."""

    path, start = Path(NAME), 0

    def __init__(self, frame: Any):
        if not (hasattr(frame, "columns") and hasattr(frame, "__getitem__")):
            kind = type(frame).__name__
            raise InputError(Problem(f"a table is the path of a file or a DataFrame, not a value of type {kind}"))
        self._frame = frame
        self.columns, self.n_rows = tuple(str(name) for name in frame.columns), len(frame)
        self.index = tuple(str(name) for name in getattr(getattr(frame, "index", None), "names", ()))
        self.end = self.n_rows
        if not self.n_rows:
            raise InputError(Problem("has no rows", NAME))

    def blocks(self, faults: Faults) -> Iterator[tuple[Integers, Array, int]]:
        """The readable rows as one block: (row numbers, numbers (rows, columns), rows). Others go to `faults`."""
        rows = np.arange(2, self.n_rows + 2)
        columns = [_numbers(self._frame[name], str(name), rows, faults) for name in self._frame.columns]
        readable = ~np.any([wrong for _, wrong in columns], axis=0)
        yield rows[readable], np.column_stack([numbers[readable] for numbers, _ in columns]), self.n_rows


def _numbers(column: Any, name: str, rows: Integers, faults: Faults) -> tuple[Array, Mask]:
    """The numbers (M,) of a column, NaN where one is missing, and where there is none (M,), which goes to `faults`."""
    values = np.asarray(column)
    numbers, wrong = np.full(len(values), np.nan), np.zeros(len(values), bool)
    if values.dtype.kind in "iuf":
        return values.astype(float), wrong
    for i, value in enumerate(values.tolist() if values.dtype.kind in "mM" else values):
        if value is None or type(value).__name__ in ("NAType", "NaTType"):
            continue
        try:
            numbers[i] = float(value)
        except (TypeError, ValueError):
            wrong[i] = True
        wrong[i] |= values.dtype.kind in "bmM"
    faults.where(wrong, rows, name, "number", lambda i: f"{shown(values[i])} is not a number")
    return numbers, wrong
