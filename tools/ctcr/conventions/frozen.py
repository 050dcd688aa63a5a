"""Rows in which the tracker repeated its last pose while the robot moved."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Integers, Mask
from ctcr.conventions import tips
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import POSE, QUATERNION
from ctcr.robot.description import Robot
from ctcr.show.wording import listed
from ctcr.table.measurements import Measurements


def repeated(readings: Measurements) -> Mask:
    """Rows (M,) that repeat a pose exactly, though joints or load have changed since it was first read."""
    q = readings.load_space
    return (q != q[_since(readings)]).any(axis=1)


def _since(readings: Measurements) -> Integers:
    """The row (M,) in which the pose of each row was first read, without another one between; itself if it is new."""
    pose = np.column_stack([readings.positions, np.nan_to_num(readings.quaternions)])
    held, first = np.zeros(len(readings), bool), np.arange(len(readings))
    held[1:] = (pose[1:] == pose[:-1]).all(axis=1)
    first[held] = 0
    return np.maximum.accumulate(first)


def stood_still(robot: Robot, readings: Measurements) -> tuple[Finding, Mask] | None:
    """Repeated poses (M,) where the model says that the tip moved farther than the tracker's noise and resolution."""
    same = repeated(readings)
    if not same.any():
        return None
    first, rows = _since(readings), np.flatnonzero(same)
    moved = np.linalg.norm(
        tips.predicted(robot, readings.rows(rows)) - tips.predicted(robot, readings.rows(first[rows])), axis=1
    )
    steps = np.abs(np.diff(readings.positions, axis=0))
    resolution = float(np.min(steps[steps > 0])) if (steps > 0).any() else 0.0  # of one pose alone nothing is known
    noise = np.sqrt(6) * 1e-3 * (robot.tracker.jitter_mm or 0.0)
    visible = moved > settings.SPIKE_VISIBLE * max(noise, resolution)
    if not visible.any():
        return None
    frozen = same & np.isin(first, first[rows[visible]])
    where = readings.row[frozen]
    text = f"the tracker repeated its last pose while the joints moved, in {_spans(where)}"
    fix = "comparisons and fits leave these rows out; for other programs, empty their pose fields"
    columns = (*POSE, *QUATERNION) if readings.quaternion is not None else POSE
    runs = np.unique(readings.run[frozen]).tolist()
    return Finding("frozen", text, columns, fix, runs=runs, rows=where.tolist()), frozen


def _spans(rows: Integers) -> str:
    """Rows as spans: rows 100 to 120, 200."""
    ends = np.flatnonzero(np.diff(rows) > 1)
    spans = zip(rows[np.r_[0, ends + 1]], rows[np.r_[ends, len(rows) - 1]], strict=True)
    word = "row" if len(rows) == 1 else "rows"
    return f"{word} {listed([str(a) if a == b else f'{a} to {b}' for a, b in spans])}"
