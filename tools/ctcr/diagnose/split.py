"""Which rows are locked away until the end. By run, never by row: neighbours on a path know each other."""

import numpy as np
from numpy.typing import NDArray

from ctcr.identify import measured_rows
from ctcr.measurements import Measurements

FEWEST_RUNS = 4
BLOCKS = 12  # of a single run, in time
FOLDS = 4


def groups(measurements: Measurements) -> NDArray[np.int64]:
    """The group of each row (M,), numbered from 0 in the order of measuring: its run, or a block of time where there
    are hardly any runs. Rows and runs without a pose do not count: each group holds something measured."""
    measured = measured_rows(measurements)
    runs, first = np.unique(measurements.run[measured], return_index=True)
    if len(runs) >= FEWEST_RUNS:
        order = {run: i for i, run in enumerate(runs[np.argsort(first)])}
        return np.array([order.get(run, 0) for run in measurements.run])
    return np.maximum(np.cumsum(measured) - 1, 0) * BLOCKS // max(np.sum(measured), 1)


def locked_rows(measurements: Measurements, turn: int = 0) -> NDArray[np.bool_]:
    """Every fourth group (M,); `turn` 0 to 3 says which."""
    return groups(measurements) % FOLDS == FOLDS - 1 - turn
