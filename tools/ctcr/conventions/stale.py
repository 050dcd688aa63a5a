"""Runs whose poses are those of the row before: the program logged the reading that it took last."""

from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Integers, evenly
from ctcr.conventions import tips
from ctcr.conventions.calibrated import Calibrated, calibrated
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import POSE, QUATERNION, Change
from ctcr.effects import catalogue
from ctcr.frames import points_to_tracker
from ctcr.show.wording import counted, listed
from ctcr.table.measurements import Measurements


def late_by_a_row(fit: Calibrated, readings: Measurements) -> tuple[Finding, Change] | None:
    """Runs whose poses fit the joints of the row before, and do not fit their own.

    Friction makes the tip follow late too, but leaves a larger error. Rows that are closer in time than the longest lag
    of a tracker are not tested: their delay is an effect.
    """
    lags = catalogue.names_with("lag", readings.n_tubes)
    longest = max(catalogue.parameter_of(readings.n_tubes)[name].hard[1] for name in lags)
    same = np.diff(readings.run) == 0
    steps = np.diff(readings.t)[same]
    steps = steps[np.isfinite(steps)]
    if not (len(steps) and np.median(steps) > longest):
        return None
    after = 1 + np.flatnonzero(same & np.isfinite(readings.positions[1:]).all(axis=1))
    runs = readings.run[after]
    own, before = _errors(fit, readings, after)
    late = [int(run) for run in np.unique(runs) if before.at(runs == run).beats(own.at(runs == run))]
    for _ in range(settings.MOST_CONVENTIONS):  # a calibration to right poses shows further ones
        if not late:
            return None
        moved = _moved_up(late)(readings)
        located = np.flatnonzero(np.isfinite(moved.positions).all(axis=1))
        there = calibrated(fit.robot, moved.rows(located[evenly(len(located), settings.CONVENTION_ROWS)]))
        own, before = _errors(there, readings, after)
        tested = late
        late = [int(run) for run in np.unique(runs) if _is_late(own.at(runs == run), before.at(runs == run))]
        if late == tested:
            break
    rows = np.isin(runs, late)
    text = f"poses of {counted(len(late), 'run')} ({listed(late)}) are those of the row before"
    fix = "move the pose fields of these runs up by a row, or log the reading that follows each motion"
    columns = (*POSE, *QUATERNION) if readings.quaternion is not None else POSE
    rms = own.at(rows).rms_mm, before.at(rows).rms_mm
    return Finding("stale", text, columns, fix, runs=late, rms_mm=rms), _moved_up(late)


def _is_late(own: Calibrated, before: Calibrated) -> bool:
    """Whether readings fit the joints of the rows before them, with hardly any error, and do not fit their own."""
    return before.beats(own) and np.max(before.left_of(own)) < settings.CONVENTION_CONSTANT


def _errors(fit: Calibrated, readings: Measurements, after: Integers) -> tuple[Calibrated, Calibrated]:
    """A calibration with the errors of some readings against the joints of their own rows, and of the rows before."""
    positions = points_to_tracker(fit.robot.tracker, tips.predicted(fit.robot, readings))
    own, before = (np.linalg.norm(readings.positions[after] - positions[rows], axis=1) for rows in (after, after - 1))
    return replace(fit, error=own), replace(fit, error=before)


def _moved_up(late: list[int]) -> Change:
    """Poses of some runs moved up by a row, the last one of each run missing."""

    def change(m: Measurements) -> Measurements:
        rows = np.isin(m.run, late)
        follows = np.append(np.diff(m.run) == 0, False)
        there = np.where(rows & follows, np.arange(len(m)) + 1, np.arange(len(m)))
        poses = {"position": m.position, "quaternion": m.quaternion}
        moved = {name: old[there] for name, old in poses.items() if old is not None}
        return replace(m, **moved).without_poses(rows & ~follows)

    return change
