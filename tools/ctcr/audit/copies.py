"""Copies: rows of a table that repeat an earlier row in every column, and so hold nothing that was measured anew."""

import numpy as np

from ctcr.show.wording import counted, listed
from ctcr.table.measurements import Measurements


def left_out(measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table without copies, and a notice if there are any.

    A pose never repeats to the last digit by chance; a row without one may be a motion that was made again.
    """
    columns = [getattr(measurements, name) for name in measurements.COLUMNS if name != "row"]
    numbers = np.column_stack([values.astype(float) for values in columns if values is not None])
    rows = np.ascontiguousarray(numbers).view(f"V{numbers.itemsize * numbers.shape[1]}")[:, 0]
    copies = measurements.measured.copy()
    copies[np.unique(rows, return_index=True)[1]] = False
    if not copies.any():
        return measurements, []
    count, of = int(copies.sum()), listed(measurements.row[copies])
    verb = "repeats" if count == 1 else "repeat"
    text = f"{counted(count, 'row')} ({of}) {verb} an earlier row to the last digit of every column: copies, left out"
    return measurements.rows(~copies), [text]
