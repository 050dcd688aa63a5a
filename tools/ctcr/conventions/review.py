"""All conventions of a table, one after another: joints, loads and frames, orientations, runs, stale and frozen poses,
time."""

from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask, evenly
from ctcr.conventions import clock, frozen, orientation, runs, search, stale, tips
from ctcr.conventions.calibrated import Calibrated, calibrated
from ctcr.conventions.finding import Finding
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Review:
    """Wrong conventions, the clearest first, and robot and table as they should be."""

    findings: list[Finding]
    robot: Robot
    readings: Measurements
    unexplained: str = ""  # a sentence on what is wrong by no known convention

    @property
    def frozen(self) -> list[Finding]:
        """Poses that the tracker repeated: readings that are missing."""
        return [one for one in self.findings if not one.is_wrong]

    @property
    def wrong(self) -> list[Finding]:
        """The others: conventions that must be corrected."""
        return [one for one in self.findings if one.is_wrong]


def review(robot: Robot, readings: Measurements) -> Review:
    """Tests every hypothesis on conventions. Nothing is found in a table without positions."""
    located = np.isfinite(readings.positions).all(axis=1) & ~frozen.repeated(readings)
    if not located.any():
        return Review([], robot, readings)
    robot = robot.model_copy()
    robot._source = None  # copies of a robot copy the text of its file too
    few = np.flatnonzero(located)
    of_runs = _of_every_run(readings, located)
    sample = readings.rows(few[evenly(len(few), settings.CONVENTION_ROWS)])
    case, found, unexplained = search.corrected(robot, sample, readings.rows(of_runs))
    if unexplained:
        return _late(case, readings) or Review([], robot, readings, unexplained)

    # Orientations are judged where positions are right.
    axis = search.mirror_of(found)
    if axis is not None and not orientation.mirrored(case.fit, case.readings, axis):
        axis = None
    found = [_with_quaternion(one, case.readings, axis) for one in found]
    wrong, change = orientation.wrong_form(case.fit, case.readings, axis)
    found += wrong
    right = readings
    for one in (*case.changes, change):
        right = one(right)

    # Runs need some readings of each, which a large table has.
    fit, of_runs = case.fit, right.rows(of_runs)
    if len(of_runs) != len(case.readings):
        fit = calibrated(case.robot, of_runs)
    for _ in range(settings.MOST_CONVENTIONS):
        odd = runs.unlike(fit, of_runs)
        if odd is None:
            break
        finding, change = odd
        found, of_runs, right = [*found, finding], change(of_runs), change(right)
        fit = calibrated(case.robot, of_runs)

    if late := stale.late_by_a_row(fit, right):
        finding, change = late
        found, right = [*found, finding], change(right)

    if still := frozen.stood_still(fit.robot, right):
        finding, rows = still
        before = _with_rows(fit, tips.errors(fit.robot, right.rows(rows)), rows)
        found.append(replace(finding, rms_mm=(before, fit.rms_mm)))
        right = right.without_poses(rows)

    if slow := clock.wrong_unit(right, fit.rms_mm):
        finding, change = slow
        found, right = [*found, finding], change(right)
    return Review(sorted(found, key=lambda one: -one.clarity), case.robot, right)


def _late(case: search.Case, readings: Measurements) -> Review | None:
    """The review of a table that can be explained once poses of the row before stand in their own row."""
    late = stale.late_by_a_row(case.fit, readings)
    if late is None:
        return None
    finding, change = late
    again = review(case.robot, change(readings))
    return None if again.unexplained else replace(again, findings=[finding, *again.findings])


def _with_quaternion(finding: Finding, readings: Measurements, axis: int | None) -> Finding:
    """A mirror with words on the quaternions, which may be mirrored too, along this axis."""
    if finding.kind != "mirrored":
        return finding
    [column] = finding.columns
    alone = axis is None and readings.oriented.any()
    fix = finding.fix if alone else f"ctcr import --mirror {column[0]}"
    return replace(finding, fix=f"{fix}, or set the tracker to a right-handed frame")


def _of_every_run(readings: Measurements, located: Mask) -> Integers:
    """Rows of all runs, or of many runs some, at most CONVENTION_RUN_ROWS of each."""
    runs = np.unique(readings.run[located])
    runs = runs[evenly(len(runs), settings.CONVENTION_MOST_RUNS)]
    rows = [np.flatnonzero(located & (readings.run == run)) for run in runs]
    return np.concatenate([of_run[evenly(len(of_run), settings.CONVENTION_RUN_ROWS)] for of_run in rows])


def _with_rows(fit: Calibrated, error: Array, rows: Mask) -> float:
    """RMS error [mm] of a fit and of some further rows (M,), whose errors [m] are given."""
    part = np.mean(rows)
    return 1e3 * float(np.sqrt((1 - part) * np.mean(fit.error[fit.solved] ** 2) + part * np.nanmean(error**2)))
