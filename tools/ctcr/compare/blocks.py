"""Parts of a table that may be treated as independent: blocks of cross-validation, and standard errors by blocks."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.compare.sample import Sample


def split(sample: Sample) -> tuple[Integers, Integers, str]:
    """Rows used, their blocks in ascending order, and the kind of the blocks: "runs", or "places" in joint space.

    A place is a region of joint space. It holds every pass through it, in both directions, so that nothing leaks from
    a pass to its return.
    """
    count = len(sample.row)
    rows = np.unique(np.linspace(0, count - 1, min(count, settings.DEPENDENCE_ROWS)).astype(np.int64))
    runs, label = np.unique(sample.run[rows], return_inverse=True)
    kind = "runs" if len(runs) >= settings.FEWEST_BLOCKS else "places"
    if kind == "runs":
        label = (label * min(len(runs), settings.DEPENDENCE_BLOCKS)) // len(runs)
    else:
        label = _regions(sample.motion.scaled[rows])
    order = np.argsort(label, kind="stable")
    return rows[order], label[order], kind


def _regions(scaled: Array) -> Integers:
    """Region (K,) of each reading: halves along the widest joint, until there are REGIONS regions of equal size."""
    label = np.zeros(len(scaled), np.int64)
    for _ in range(int(np.log2(settings.REGIONS))):
        label *= 2
        for cell in np.unique(label):
            members = np.flatnonzero(label == cell)
            axis = np.argmax(np.ptp(scaled[members], axis=0))
            order = np.argsort(scaled[members, axis], kind="stable")
            label[members[order[len(order) // 2 :]]] += 1
    return np.unique(label, return_inverse=True)[1]


def segments(run: Integers) -> Integers:
    """Blocks (P,) of pairs of visits in measured order: runs if there are enough, else time segments of the path."""
    names, label = np.unique(run, return_inverse=True)
    in_time = np.arange(len(run)) * settings.PATH_SEGMENTS // max(len(run), 1)
    return label if len(names) >= settings.FEWEST_BLOCKS else in_time


def block_error(values: Array, blocks: Integers) -> float:
    """Standard error of the mean of (P,) values whose blocks are independent of one another; NaN with one block."""
    count = np.bincount(blocks)
    total = np.bincount(blocks, values)[count > 0]
    count = count[count > 0]
    if len(count) < 2:
        return float("nan")
    deviation = total - values.mean() * count
    return float(np.sqrt(len(count) / (len(count) - 1) * np.sum(deviation**2)) / len(values))


def group_means(values: Array, label: Integers) -> Array:
    """Mean vector (G, C) of each group of the rows (K, C); label (K,) 0..G-1."""
    return np.stack([np.bincount(label, column) / np.bincount(label) for column in values.T], axis=1)
