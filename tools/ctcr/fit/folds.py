"""Parts of a table that are left out in turn: whole runs, or places in joint space where there are few runs.

A place holds every pass through it, so that nothing leaks from one pass to its return. Rows are never split singly.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ctcr.compare import blocks
from ctcr.compare.motion import follow
from ctcr.errors import InputError, Problem
from ctcr.table.measurements import Measurements

FEWEST_RUNS = 4


@dataclass(frozen=True)
class Split:
    """`part` (M,) of each row, 0 .. parts - 1; `kind`: what was kept together, runs or places."""

    kind: str
    part: NDArray[np.int64]
    parts: int


def parts_of(readings: Measurements, lever: float, parts: int) -> Split | None:
    """The table in `parts` equal parts, each spread over the whole; None where it is too small for that.

    `lever` [m]: the tip's usual distance from the insertion axis, which makes rotations comparable with translations.
    """
    runs, index = np.unique(readings.run, return_inverse=True)
    if len(runs) >= max(FEWEST_RUNS, parts):
        return Split("runs", index % parts, parts)
    cell = _places(readings, lever)
    return Split("places", cell % parts, parts) if cell.max() + 1 >= 2 * parts else None


def runs_left_out(readings: Measurements, count: int) -> Split:
    """`count` runs, evenly spread, as part 1, all others as part 0. Raises InputError where too few are left."""
    runs, index = np.unique(readings.run, return_inverse=True)
    if count >= len(runs):
        text = f"--hold-out {count} needs more than {count} runs: the table has {len(runs)}"
        hint = "; leave it out, and places in joint space are held out" if len(runs) < FEWEST_RUNS else ""
        raise InputError(Problem(text + hint))
    chosen = ((np.arange(count) + 0.5) * len(runs) / count).astype(int)
    return Split("runs", np.isin(index, chosen).astype(np.int64), 2)


def _places(readings: Measurements, lever: float) -> NDArray[np.int64]:
    motion = follow(readings.t, readings.run, readings.beta, readings.alpha, lever)
    one_run = np.zeros_like(readings.run)
    rows, label, _ = blocks.split(SimpleNamespace(row=readings.row, run=one_run, motion=motion))
    return label[cKDTree(motion.scaled[rows]).query(motion.scaled)[1]]
