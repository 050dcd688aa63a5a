"""A table that is a DataFrame: read as one in a file is, with the same faults. Its first row counts as row 2, too."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.arrays import Array, Integers
from ctcr.errors import InputError, Problem, shown
from ctcr.table.csv_table import Faults

NAME = "DataFrame"  # in messages


class FrameTable:
    """As NumberTable. `frame` is a DataFrame of pandas, or one that has its `columns` and its columns by name."""

    path, start = Path(NAME), 0

    def __init__(self, frame: Any):
        if not (hasattr(frame, "columns") and hasattr(frame, "__getitem__")):
            kind = type(frame).__name__
            raise InputError(Problem(f"a table is the path of a file or a DataFrame, not a value of type {kind}"))
        self._frame = frame
        self.columns, self.n_rows = tuple(str(name) for name in frame.columns), len(frame)
        self.end = self.n_rows
        if not self.n_rows:
            raise InputError(Problem("has no rows", NAME))

    def blocks(self, faults: Faults) -> Iterator[tuple[Integers, Array, int]]:
        """All rows as one block: (row numbers, numbers (rows, columns), rows)."""
        rows = np.arange(2, self.n_rows + 2)
        block = np.column_stack([_numbers(self._frame[name], str(name), rows, faults) for name in self._frame.columns])
        yield rows, block, self.n_rows


def _numbers(column: Any, name: str, rows: Integers, faults: Faults) -> Array:
    """The numbers (M,) of a column, NaN where one is missing. What is no number goes to `faults`."""
    values = np.asarray(column)
    if values.dtype.kind in "iuf":
        return values.astype(float)
    numbers, wrong = np.full(len(values), np.nan), np.zeros(len(values), bool)
    for i, value in enumerate(values.tolist() if values.dtype.kind in "mM" else values):
        if value is None or type(value).__name__ in ("NAType", "NaTType"):
            continue
        try:
            numbers[i] = float(value)
        except (TypeError, ValueError):
            wrong[i] = True
        wrong[i] |= values.dtype.kind in "bmM"
    faults.where(wrong, rows, name, "number", lambda i: f"{shown(values[i])} is not a number")
    return numbers
