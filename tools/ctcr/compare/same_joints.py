"""Runs that visit the same joints, without any model: a rigid motion tells other frames from another robot."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ctcr import settings
from ctcr.arrays import evenly
from ctcr.compare.crossvalidation import group_means
from ctcr.frames import rigid_motion
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class PairOfRuns:
    """RMS distance of the mean tips of two runs at their common joints [mm]: as measured, and after the rigid motion
    that brings the runs closest, free of its six numbers. No model that the runs share errs less than half of it."""

    run: int
    other: int
    joints: int
    apart_mm: float
    moved_mm: float


def pairs_of_runs(table: Measurements) -> list[PairOfRuns]:
    """All pairs of runs that share enough joints for a rigid motion to be tested; of very many runs, of some."""
    located = np.isfinite(table.positions).all(axis=1)
    runs = np.unique(table.run[located])
    located &= np.isin(table.run, runs[evenly(len(runs), settings.CONVENTION_MOST_RUNS)])
    if not located.any():
        return []
    joints = np.round(table.joint_space[located], settings.SAME_VISIT_DECIMALS)
    _, joint = np.unique(joints, axis=0, return_inverse=True)
    visits, label = np.unique(np.column_stack([table.run[located], joint]), axis=0, return_inverse=True)
    tips = 1e3 * group_means(table.positions[located], label)
    again = np.bincount(visits[:, 1])[visits[:, 1]] > 1
    visits, tips = visits[again], tips[again]
    found = []
    for run, other in combinations(np.unique(visits[:, 0]).tolist(), 2):
        one, two = visits[:, 0] == run, visits[:, 0] == other
        both, mine, theirs = np.intersect1d(visits[one, 1], visits[two, 1], return_indices=True)
        if len(both) < 3:
            continue
        source, target = tips[one][mine], tips[two][theirs]
        rotation, shift = rigid_motion(source, target)
        apart, left = (np.sum(part**2) for part in (target - source, target - source @ rotation.T - shift))
        apart_mm, moved_mm = np.sqrt(apart / len(both)), np.sqrt(left / (len(both) - 2))
        found.append(PairOfRuns(run, other, len(both), apart_mm, moved_mm))
    return found
