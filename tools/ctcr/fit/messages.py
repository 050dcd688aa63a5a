"""What to say of the readings of a joint fit, in words."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ctcr.table.measurements import Measurements

FEW_RUNS = 2


def doubts(measurements: Measurements, rows: NDArray[np.bool_]) -> Iterable[str]:
    """Of the rows (M,) that are fitted."""
    if not rows.any():
        return
    joints = np.hstack([measurements.beta, measurements.alpha])[rows]
    fixed = np.ptp(joints, axis=0) == 0
    if fixed.all():
        yield "all joints are the same in every row: one pose determines few of the parameters"
    elif fixed.any():
        n = measurements.beta.shape[1]
        which = [f"beta{i + 1}" if i < n else f"alpha{i + 1 - n}" for i in np.flatnonzero(fixed)]
        yield f"these joints never move: {', '.join(which)}"
    if len(np.unique(measurements.run[rows])) < FEW_RUNS:
        yield "there is only one run: readings that follow one another cannot check what was learned from them"
    if measurements.quaternion is None or not np.isfinite(measurements.quaternion[rows]).any():
        yield "no orientation was measured: positions alone tell the parameters apart less well"


def left_out(rows: Sequence[int]) -> list[str]:
    """Of rows without a solution, counted from 0."""
    if not rows:
        return []
    shown = ", ".join(str(row + 1) for row in rows[:8]) + (" .." if len(rows) > 8 else "")
    return [f"{len(rows)} readings were left out, for which the model has no solution: number {shown}"]
