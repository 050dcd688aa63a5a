"""Which rows are locked away until the end. By run, never by row: neighbours on a path know each other."""

import numpy as np
from numpy.typing import NDArray

from ctcr.measurements import Measurements

FEWEST_RUNS = 4
BLOCKS = 12  # of a single run, in time
FOLDS = 4


def groups(measurements: Measurements) -> NDArray[np.int64]:
    """The group of each row (M,), numbered from 0 in the order of measuring: its run, or a block of time where there
    are hardly any runs."""
    runs, group = np.unique(measurements.run, return_inverse=True)
    if len(runs) >= FEWEST_RUNS:
        first = np.array([np.flatnonzero(group == i)[0] for i in range(len(runs))])
        return np.argsort(np.argsort(first))[group]
    return np.arange(len(measurements)) * BLOCKS // max(len(measurements), 1)


def locked_rows(measurements: Measurements, turn: int = 0) -> NDArray[np.bool_]:
    """Every fourth group (M,); `turn` 0 to 3 says which."""
    return groups(measurements) % FOLDS == FOLDS - 1 - turn
