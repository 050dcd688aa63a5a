"""Repetitions in a table that are no measurements: copies of earlier rows, and an orientation that is the same in every
row."""

from dataclasses import replace

import numpy as np

from ctcr.show.wording import counted, listed
from ctcr.table.measurements import Measurements, never_turns


def left_out(measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table without copies, and without an orientation that never changes; a notice of each."""
    table, said = _without_copies(measurements)
    if never_turns(table.quaternions):
        said += ["the orientation never changes, so the tracker measures none: it is left out"]
        table = replace(table, quaternion=None)
    return table, said


def _without_copies(measurements: Measurements) -> tuple[Measurements, list[str]]:
    """A pose never repeats to the last digit by chance; a row without one may be a motion that was made again."""
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
