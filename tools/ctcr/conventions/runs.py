"""Runs that were homed elsewhere than the others: one joint of one run is off by a constant."""

from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.conventions import orientation, tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.calibrated import Calibrated, calibrated, dearer
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change, changed, joints
from ctcr.model.sessions import FRAME
from ctcr.robot.description import Robot
from ctcr.show.wording import short
from ctcr.table.measurements import Measurements


def homed_elsewhere(fit: Calibrated, readings: Measurements) -> tuple[Finding, Change] | None:
    """The run that is farthest off, where an offset of one joint makes it like the others; its correction.

    The others alone are calibrated, and predict this one.
    """
    runs = np.unique(readings.run)
    if len(runs) < settings.FEWEST_RUNS:
        return None
    clear, of_run = settings.CONVENTION_CLEAR, np.array([_log_error(fit, readings.run == run) for run in runs])
    worst = int(np.nanargmax(of_run))
    usual = np.exp(np.quantile(np.delete(of_run, worst), settings.CONVENTION_RUNS))
    if clear * np.exp(of_run[worst]) < usual:
        return None
    others = readings.run != runs[worst]
    like, mine = calibrated(fit.robot, readings.rows(others)), readings.rows(~others)
    scanned = sorted(_scan(like, mine, kind, tube) for kind in ("beta", "alpha") for tube in range(fit.robot.n_tubes))
    (after, kind, tube, offset), second = scanned[0], scanned[1][0] if len(scanned) > 1 else np.inf
    if clear * after > usual:
        return None
    moved = dearer(FRAME - 1, len(mine)) * _typical(_moved(like.robot, mine), like)  # the whole frame, not a joint
    if second < settings.CONVENTION_ALIKE * after or moved < after:
        return None
    of_others = [_scan(like, readings.rows(readings.run == run), kind, tube)[3] for run in np.delete(runs, worst)]
    if abs(offset) < settings.OUTLYING_RUN * 1.48 * np.median(np.abs(of_others)):
        return None  # the others would take offsets too: something else acts
    move = offset * (np.arange(fit.robot.n_tubes) == tube)
    mended = changed(kind, lambda q: q + move)(mine)
    before, behind = (replace(like, error=tips.errors(like.robot, rows)) for rows in (mine, mended))
    if np.max(behind.left_of(before)) > settings.CONVENTION_CONSTANT:
        return None
    turned = orientation.error_deg(like.robot, mine)
    if orientation.error_deg(like.robot, mended) > settings.CONVENTION_ALIKE * turned:
        return None  # the orientations deny it
    run = int(runs[worst])
    unit, size, digits = ("deg", np.degrees(offset), 1) if kind == "alpha" else ("mm", 1e3 * offset, 2)
    [name] = joints(kind, (tube,))
    text = f"run {run} was homed elsewhere: {name} stands {short(abs(size))} {unit} off"
    fix = f"ctcr import --offset {name}@{run}={size:.{digits}f}{unit}, or leave this run out"

    def change(m: Measurements) -> Measurements:
        return changed(kind, lambda q: q + np.where((m.run == run)[:, None], move, 0.0))(m)

    return Finding("run_offset", text, (name,), fix, runs=(run,)), change


def _log_error(fit: Calibrated, rows: Array) -> float:
    return float(fit.log_error[rows].mean())


def _typical(error: Array, like: Calibrated) -> float:
    return Calibrated(like.robot, error, like.floor).typical


def _moved(robot: Robot, readings: Measurements) -> Array:
    """Errors (K,) [m] where the whole frame moved in that run."""
    return aligned(tips.predicted(robot, readings), readings.position)[2]


def _scan(like: Calibrated, mine: Measurements, kind: str, tube: int) -> tuple[float, str, int, float]:
    """The offset of one joint that fits a run best: (typical error [m], joint, tube, offset), by ever finer grids."""
    half, offset, best = settings.CONVENTION_SCAN[kind], 0.0, np.inf
    count, n = len(mine), settings.CONVENTION_SCAN_POINTS
    for _ in range(settings.CONVENTION_SCANS):
        grid = offset + np.linspace(-half, half, n)
        tried = mine.rows(np.tile(np.arange(count), n))
        getattr(tried, kind)[:, tube] += np.repeat(grid, count)
        typical = [_typical(part, like) for part in tips.errors(like.robot, tried).reshape(n, count)]
        k = int(np.argmin(typical))
        offset, best, half = float(grid[k]), float(typical[k]), 2 * half / (n - 1)
    return best, kind, tube, offset
