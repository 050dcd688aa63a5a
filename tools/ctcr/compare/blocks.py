"""Parts of a table that are left out in turn when something is judged."""

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.sample import Sample

Array = NDArray[np.float64]
MOST_ROWS = 6_000
MOST_BLOCKS = 24
FEWEST_RUNS = 6
PLACES = 16


def split(sample: Sample) -> tuple[NDArray[np.int64], NDArray[np.int64], str]:
    """Rows used, their blocks in ascending order, and what the blocks are: runs, or else places in joint space.

    Blocks are left out in turn. A place holds every pass through it, in both directions, so that nothing leaks from
    a pass to its return.
    """
    rows = thin(len(sample.row))
    runs, label = np.unique(sample.run[rows], return_inverse=True)
    kind = "runs" if len(runs) >= FEWEST_RUNS else "places"
    if kind == "runs":
        label = (label * min(len(runs), MOST_BLOCKS)) // len(runs)
    else:
        label = _places(sample.motion.scaled[rows])
    order = np.argsort(label, kind="stable")
    return rows[order], label[order], kind


def thin(count: int) -> NDArray[np.int64]:
    """Evenly spaced row indices, at most MOST_ROWS."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(np.int64))


def _places(scaled: Array) -> NDArray[np.int64]:
    """Halve the readings along their widest direction until there are PLACES cells of equal size."""
    label = np.zeros(len(scaled), np.int64)
    for _ in range(int(np.log2(PLACES))):
        label *= 2
        for cell in np.unique(label):
            members = np.flatnonzero(label == cell)
            axis = np.argmax(np.ptp(scaled[members], axis=0))
            order = np.argsort(scaled[members, axis], kind="stable")
            label[members[order[len(order) // 2 :]]] += 1
    return np.unique(label, return_inverse=True)[1]
