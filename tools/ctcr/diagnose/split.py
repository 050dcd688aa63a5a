"""Which rows are locked away until the end. By run, never by row: neighbours on a path know each other."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose.coverage import Coverage
from ctcr.fit.joint import measured_rows
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

FEWEST_RUNS = 4
BLOCKS = 12  # of a single run, in time
FOLDS = 4
# What is locked of each four groups: not always the same, as runs often alternate in direction, speed or load.
PLACE = (2, 3, 1, 0)
OPEN = 0.1  # mean square error that the fitted groups may leave open in a locked one, over that of the jitter
EXCHANGES = 12  # of locked groups, at most


def groups(measurements: Measurements) -> NDArray[np.int64]:
    """The group of each row (M,), numbered from 0 in the order of measuring: its run, or a block of time where there
    are hardly any runs. Rows and runs without a pose do not count: each group holds something measured."""
    measured = measured_rows(measurements)
    runs, first = np.unique(measurements.run[measured], return_index=True)
    if len(runs) >= FEWEST_RUNS:
        order = {run: i for i, run in enumerate(runs[np.argsort(first)])}
        return np.array([order.get(run, 0) for run in measurements.run])
    return np.maximum(np.cumsum(measured) - 1, 0) * BLOCKS // max(np.sum(measured), 1)


def locked_rows(
    robot: Robot, measurements: Measurements, turn: int = 0, fitted: Collection[int] = ()
) -> NDArray[np.bool_]:
    """One of every four groups (M,); `turn` 0 to 3 says which. None of the groups `fitted`.

    A group that goes where no other one went cannot judge a model: what it shows, the others do not determine. It is
    exchanged for one that they cover. Joints, loads and the model decide that; poses are not looked at.
    """
    group = groups(measurements)
    known = np.unique(group)
    locked = [k for k in known if k % FOLDS == (PLACE[k // FOLDS % len(PLACE)] + turn) % FOLDS]
    coverage = Coverage(robot, measurements, group)
    for _ in range(EXCHANGES if locked else 0):
        left = coverage.left_open(locked)
        left[np.isin(sorted(locked), list(fitted))] = np.inf
        if left.max() <= OPEN:
            break
        rest = sorted(locked)
        rest.pop(int(np.argmax(left)))
        others = [k for k in known if k not in locked and k not in fitted]
        worst = {k: coverage.left_open([*rest, k]).max() for k in others}
        best = min(worst, key=worst.get, default=None)
        if best is None or worst[best] >= left.max():
            break
        locked = [*rest, best]
    return np.isin(group, locked)
