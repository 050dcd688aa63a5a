"""Runs that are unlike the others by one thing: a convention of their own, a joint homed elsewhere, another tube."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Integers, robust_rms
from ctcr.conventions import orientation, tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.calibrated import Calibrated, calibrated, dearer, own_values
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import POSE, Change, Hypothesis, changed, hypotheses, joints, offset_by
from ctcr.model.sessions import FRAME
from ctcr.robot.description import Robot
from ctcr.show.wording import runs_named, short
from ctcr.table.measurements import Measurements

CHANGED = "beta", "alpha", "force", "position"  # of a table, by what may be different


def unlike(fit: Calibrated, readings: Measurements) -> tuple[Finding, Change] | None:
    """The runs that differ from the others by one thing, and the change of the table that corrects them.

    A calibration of the other runs predicts these. Runs of another robot cannot be corrected: the change leaves them
    out.
    """
    if len(np.unique(readings.run)) < settings.FEWEST_RUNS or not fit.may_be_beaten:
        return None
    return next(filter(None, (_explained(fit, readings, runs) for runs in _minorities(fit, readings))), None)


def _minorities(fit: Calibrated, readings: Measurements) -> Iterator[Integers]:
    """Minorities of runs that may be unlike the others: the run of the largest error, the runs of large errors, and the
    runs that ask for another home or curvature."""
    runs, index = np.unique(readings.run, return_inverse=True)
    error = np.array([fit.log_error[index == k].mean() for k in range(len(runs))])
    yield runs[[np.argmax(error)]]
    sizes = [error]
    if fit.solved.any():
        sizes.append(own_values(fit, readings, ("tubes.*.curvature", "homes")))
    for size in sizes:
        order = np.argsort(size)
        above = order[1 + np.argmax(np.diff(size[order])) :]
        few = above if 2 * len(above) <= len(runs) else np.setdiff1d(order, above)
        if len(few) > 1 or few[0] != np.argmax(error):
            yield np.sort(runs[few])


def _explained(fit: Calibrated, readings: Measurements, some: Integers) -> tuple[Finding, Change] | None:
    """The clear difference between some runs and the others, as a finding with its correction; None without any."""
    clear, theirs = settings.CONVENTION_CLEAR, np.isin(readings.run, some)
    rest, mine = readings.rows(~theirs), readings.rows(theirs)
    like = calibrated(fit.robot, rest)
    others = [rest.rows(rest.run == run) for run in np.unique(rest.run)]
    of_others = [_judged(like, like.robot, rows).typical for rows in others]
    usual = np.quantile(of_others, settings.CONVENTION_RUNS, method="higher")  # infinite where nothing is solved
    before = _judged(like, like.robot, mine)
    if not np.isfinite(usual) or clear * before.typical < usual:
        return None
    (best, then), *rivals = sorted(_differences(like, mine), key=lambda pair: pair[1].typical)
    # Where their whole frame moved, and no joint.
    framed = replace(like, error=aligned(tips.predicted(like.robot, mine), mine.position)[2])
    if clear * then.typical > usual or dearer(FRAME - 1, len(mine)) * framed.typical < then.typical:
        return None
    if np.max(then.left_of(before)) > settings.CONVENTION_CONSTANT:
        return None
    if not then.beats(before):
        return None  # a few readings agree by chance
    alike = (one for one, left in rivals if left.typical < settings.CONVENTION_ALIKE * then.typical)
    if any((one.kind, one.columns) != (best.kind, best.columns) for one in alike):
        return None
    if best.offset:
        name, tube, value = best.offset
        scanned = [_scan(like, rows, name, tube) for rows in others]
        if abs(value) < settings.OUTLYING_RUN * robust_rms(np.abs(scanned), 1):
            return None  # the others would take offsets too: something else acts
        stated = 0.01 * like.robot.uncertainty.of("curvature_percent", tube)
        if name == "curvature" and abs(value) < settings.MOVED_FAR * stated:
            return None  # a tube like the one in the file
    turned = orientation.error_deg(like.robot, mine)
    if orientation.error_deg(best.robot(like.robot), best.change(mine)) > settings.CONVENTION_ALIKE * turned:
        return None  # the orientations deny it
    if clear * before.typical < np.quantile([*_left_out(fit.robot, rest)], settings.CONVENTION_RUNS, method="higher"):
        return None  # the others are predicted no better by each other: a smooth field, or an effect

    def change(m: Measurements) -> Measurements:
        rows, right = np.isin(m.run, some), best.change(m)
        if best.file is not None:
            return m.rows(~rows)
        parts = {name: (getattr(right, name), getattr(m, name)) for name in CHANGED}
        return replace(m, **{name: np.where(rows[:, None], new, old) for name, (new, old) in parts.items()})

    runs = tuple(map(int, some))
    errors = before.rms_mm, then.rms_mm
    fix = f"{best.fix}; or leave {runs_named(some)} out"
    return Finding(best.kind, best.text, best.columns, fix, runs=runs, rms_mm=errors), change


def _differences(like: Calibrated, mine: Measurements) -> Iterator[tuple[Hypothesis, Calibrated]]:
    """All that may be different in these readings alone, with the error that it leaves in them."""
    runs = runs_named(np.unique(mine.run))
    for one in (*hypotheses(like.robot, mine), *_exchanged()):
        if one.of_robot or one.offset:
            continue
        fix = f"in the log of {runs} alone: {one.fix or f'negate {one.columns[0]}'}"
        alone = replace(one, text=f"{one.text}, in {runs} alone", fix=fix)
        yield alone, _judged(like, like.robot, one.change(mine))
    for name in settings.CONVENTION_SCAN:
        for tube in range(like.robot.n_tubes):
            yield _scanned(like, mine, name, tube)


def _exchanged() -> Iterator[Hypothesis]:
    """Hypotheses that two axes of the tracker are exchanged; if so in all runs, a mirror would explain it."""
    for a, b in ((0, 1), (1, 2), (0, 2)):
        order = np.arange(3)
        order[[a, b]] = b, a
        text, columns = f"{POSE[a]} and {POSE[b]} are exchanged", (POSE[a], POSE[b])
        change = changed("position", lambda p, order=order: p[:, order])
        yield Hypothesis("mirrored", text, columns, f"exchange {POSE[a]} and {POSE[b]}", change)


def _scanned(like: Calibrated, mine: Measurements, name: str, tube: int) -> tuple[Hypothesis, Calibrated]:
    """Another size of a home or of a curvature."""
    value, runs = _scan(like, mine, name, tube), np.unique(mine.run)
    robot, readings = _off(like.robot, mine, name, tube, value)
    left = _judged(like, robot, readings)
    if name == "curvature":
        size = f"{robot.tubes[tube].curvature:.4g}"
        text = f"tube {tube + 1} is another one in {runs_named(runs)}: its curvature is {100 * np.expm1(value):+.0f} %"
        fix = f"give {runs_named(runs)} a robot file with curvature_per_m: {size} of tube {tube + 1}"
        return Hypothesis("tube_changed", text, (), fix, file=robot, offset=(name, tube, value)), left
    unit, size, digits = ("deg", np.degrees(value), 1) if name == "alpha" else ("mm", 1e3 * value, 2)
    [column] = joints(name, (tube,))
    were = "were" if len(runs) > 1 else "was"
    text = f"{runs_named(runs)} {were} homed elsewhere than the others: {column} stands {short(abs(size))} {unit} off"
    fix = " ".join(["ctcr import", *(f"--offset {column}@{run}={size:.{digits}f}{unit}" for run in runs)])
    off = Hypothesis("run_offset", text, (column,), fix, offset=(name, tube, 0.0))
    return offset_by(off, value, robot.n_tubes), left


def _off(robot: Robot, readings: Measurements, name: str, tube: int, value: float) -> tuple[Robot, Measurements]:
    """Robot and readings where the home of a joint [rad], [m] or the logarithm of a curvature is off by a value."""
    if name != "curvature":
        move = value * (np.arange(robot.n_tubes) == tube)
        return robot, changed(name, lambda q: q + move)(readings)
    tubes = [*robot.tubes]
    tubes[tube] = tubes[tube].model_copy(update={"curvature_per_m": np.exp(value) * tubes[tube].curvature_per_m})
    return robot.model_copy(update={"tubes": tubes}), readings


def _left_out(robot: Robot, readings: Measurements) -> Iterator[float]:
    """Typical error [m] of each run, predicted by a calibration of the others."""
    for run in np.unique(readings.run):
        fit = calibrated(robot, readings.rows(readings.run != run))
        yield _judged(fit, fit.robot, readings.rows(readings.run == run)).typical


def _judged(like: Calibrated, robot: Robot, readings: Measurements) -> Calibrated:
    """A calibration with the error that a robot leaves in other readings."""
    return replace(like, error=tips.errors(robot, readings))


def _scan(like: Calibrated, mine: Measurements, name: str, tube: int) -> float:
    """The value that fits readings best, by ever finer grids."""
    half, best, n = settings.CONVENTION_SCAN[name], 0.0, settings.CONVENTION_SCAN_POINTS
    for _ in range(settings.CONVENTION_SCANS):
        grid = best + np.linspace(-half, half, n)
        errors = [_judged(like, *_off(like.robot, mine, name, tube, value)).typical for value in grid]
        best, half = float(grid[np.argmin(errors)]), 2 * half / (n - 1)
    return best
