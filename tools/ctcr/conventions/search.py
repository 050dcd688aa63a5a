"""The search: every hypothesis is predicted, the likely ones are calibrated, the clearest is applied, and again."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.conventions import tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.calibrated import Calibrated, calibrated, jump
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change, Hypothesis, hypotheses, offset_by, with_frame
from ctcr.model.sessions import FRAME
from ctcr.robot.description import Robot
from ctcr.show.wording import numbers
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Case:
    """A robot and readings as they stand after the conventions found so far, with their calibration."""

    robot: Robot
    readings: Measurements
    fit: Calibrated
    changes: tuple[Change, ...] = ()  # that made these readings of those of the table


@dataclass(frozen=True)
class Tried:
    """A hypothesis, and the case that it makes."""

    hypothesis: Hypothesis
    case: Case
    rivals: Sequence[Hypothesis] = ()  # of another kind, which explain the readings as well


def corrected(robot: Robot, readings: Measurements, of_runs: Measurements) -> tuple[Case, list[Finding]]:
    """The case after all clear findings, one at a time, and these.

    `readings` are a sample of the table, `of_runs` some of each run. Where a frame for each run explains more than a
    hypothesis on joints, loads or positions does, the runs are not one session, and it is not clear.
    """
    case, found = Case(robot, readings, calibrated(robot, readings)), []
    while len(found) < settings.MOST_CONVENTIONS and (better := _clearest(case)):
        whole = better.hypothesis.frame or better.hypothesis.registers
        if not whole and _with_run_frames(case, of_runs) < better.case.fit.typical:
            break
        found.append(_finding(case, better))
        case = better.case
    return case, found


def _clearest(case: Case) -> Tried | None:
    """The hypothesis that leaves far less error than the table as it is and than every other one; None without any."""
    before = case.fit
    if _is_noise(before):
        return None
    tried = [Tried(one, _applied(case, one)) for one in _likely(case)]
    tried = [one for one in tried if _is_clear(before, one.case.fit) and _is_jump(one)]
    if not tried:
        return None
    least = min(one.case.fit.typical for one in tried)
    alike = [one for one in tried if one.case.fit.typical < settings.CONVENTION_ALIKE * least]
    best = min(alike, key=lambda one: (one.hypothesis.doubts, one.case.fit.typical))
    if best.hypothesis.sensor is not None and not _is_far(case.robot, best.case.fit.robot):
        return None
    if best.hypothesis.offset:
        exact = offset_by(best.hypothesis, offset_of(best), case.robot.n_tubes)
        best = Tried(exact, _applied(case, exact))
    rivals = [one.hypothesis for one in alike if one.hypothesis.kind != best.hypothesis.kind]
    return replace(best, rivals=[one for one in rivals if not one.offset and not one.registers])


def _with_run_frames(case: Case, of_runs: Measurements) -> float:
    """Typical error [m] of a case in which each run has the frame that fits it best."""
    for change in case.changes:
        of_runs = change(of_runs)
    positions, error = tips.predicted(case.fit.robot, of_runs), np.full(len(of_runs), np.nan)
    for run in np.unique(of_runs.run):
        rows = of_runs.run == run
        freedom = 3 * np.sum(rows) - FRAME
        left = aligned(positions[rows], of_runs.position[rows])[2]
        error[rows] = left * np.sqrt(3 * np.sum(rows) / freedom) if freedom > 0 else np.inf
    return Calibrated(case.robot, error, case.fit.floor).typical


def _is_noise(fit: Calibrated) -> bool:
    return fit.typical < settings.CONVENTION_AT_FLOOR * max(fit.floor, settings.CONVENTION_FINEST)


def _is_clear(before: Calibrated, after: Calibrated) -> bool:
    return (
        after.solved.mean() > settings.CONVENTION_SOLVED and after.typical < settings.CONVENTION_CLEAR * before.typical
    )


def _likely(case: Case) -> Iterator[Hypothesis]:
    """The hypotheses that leave the least error before any calibration: in the file's frame, and in the best one."""
    every, few = hypotheses(case.robot, case.readings), case.readings.rows(slice(None, None, settings.CONVENTION_EVERY))
    rough = np.array([_rough(one.robot(case.robot), one.change(few)) for one in every])
    given = settings.CONVENTION_ROUGH * np.array(_rough(case.robot, few))
    chosen = np.unique(np.argsort(rough, axis=0, kind="stable")[: settings.CONVENTION_LIKELY])
    return (every[i] for i in chosen if np.isfinite(rough[i]).all() and (rough[i] <= given).any())


def _rough(robot: Robot, readings: Measurements) -> tuple[float, float]:
    """Median error [m] in the frame of the robot, and in the one that fits best."""
    predicted = tips.predicted(robot, readings)
    solved = np.isfinite(predicted).all(axis=1)
    if solved.mean() < settings.CONVENTION_SOLVED:
        return np.inf, np.inf
    here = tips.errors(robot, readings, predicted)
    return float(np.nanmedian(here)), float(np.nanmedian(aligned(predicted, readings.position)[2]))


def _applied(case: Case, hypothesis: Hypothesis) -> Case:
    robot, readings = hypothesis.robot(case.robot), hypothesis.change(case.readings)
    if hypothesis.registers:
        rotation, origin, _ = aligned(tips.predicted(robot, readings), readings.position)
        robot = with_frame(robot, rotation, origin)
    fit = calibrated(robot, readings, free=hypothesis.frees, to_beat=case.fit.typical)
    return Case(robot, readings, fit, (*case.changes, hypothesis.change))


def _is_far(before: Robot, after: Robot) -> bool:
    """Whether the sensor is farther from its place than an error of mounting, which is an effect, leaves it."""
    move = after.tracker.sensor_position - before.tracker.sensor_position
    return float(np.linalg.norm(move)) > settings.SENSOR_JUMP[0]


def _is_jump(tried: Tried) -> bool:
    """Whether an offset, where it is one, moves a home farther than calibration would: by right angles, or so that only
    noise is left. A physical effect may ask for another offset, but it leaves more.
    """
    if not tried.hypothesis.offset:
        return True
    kind, tube, _ = tried.hypothesis.offset
    uncertainty, size = tried.case.robot.uncertainty, offset_of(tried)
    sd = np.deg2rad(uncertainty.of("rotation_offset_deg", tube))
    if kind == "beta":
        sd = 1e-3 * uncertainty.of("translation_offset_mm", tube)
    right = kind == "alpha" and size % (np.pi / 2) == 0
    return abs(size) > jump(tried.hypothesis.frees, sd) and (right or _is_noise(tried.case.fit))


def offset_of(tried: Tried) -> float:
    """The offset of a home that fits best, SI: that of the hypothesis and what calibration adds to it.

    A right angle is taken for one, where the fit is as near to it as homes are known.
    """
    kind, tube, size = tried.hypothesis.offset
    home, factor = ("home_rotation_deg", np.pi / 180) if kind == "alpha" else ("home_translation_mm", 1e-3)
    old, new = (getattr(robot.actuation, home)[tube] for robot in (tried.case.robot, tried.case.fit.robot))
    size += factor * (new - old)
    right = np.pi / 2 * round(size / (np.pi / 2))
    near = 3 * np.deg2rad(tried.case.robot.uncertainty.of("rotation_offset_deg", tube))
    return right if kind == "alpha" and right and abs(size - right) < near else size


def _finding(case: Case, tried: Tried) -> Finding:
    one, text, fix = tried.hypothesis, tried.hypothesis.text, tried.hypothesis.fix
    if one.offset:
        text, fix = _offset_in_words(tried)
    if one.sensor is not None:
        place = numbers(tried.case.fit.robot.tracker.sensor_position_mm, 1)
        fix = f"set tracker.sensor_position_mm to {place}, or to null: ctcr calibrate fit finds it"
    if one.frame or one.registers:
        fix = _frame_in_words(tried.case.fit.robot if one.registers else tried.case.robot)
    errors = (case.fit.rms_mm, tried.case.fit.rms_mm)
    rivals = [Finding(rival.kind, rival.text, rival.columns, rival.fix) for rival in tried.rivals]
    return Finding(one.kind, text, one.columns, fix, rms_mm=errors, rivals=rivals)


def _offset_in_words(tried: Tried) -> tuple[str, str]:
    kind, tube, size = tried.hypothesis.offset
    robot, name = tried.case.robot, tried.hypothesis.columns[0]
    key, unit, factor = (
        ("home_rotation_deg", "deg", 180 / np.pi) if kind == "alpha" else ("home_translation_mm", "mm", 1e3)
    )
    size = float(round(factor * size))
    old = list(getattr(robot.actuation, key))
    recorded = getattr(robot.actuation, f"recorded_{key}") or old
    new = [home + size * (i == tube) for i, home in enumerate(old)]
    text = f"{name} counts from another {'plane' if kind == 'alpha' else 'place'}: {size:+g} {unit} are missing"
    fix = f"set actuation.{key} to {numbers(new)} and actuation.recorded_{key} to {numbers(recorded)}"
    return text, fix


def _frame_in_words(robot: Robot) -> str:
    tracker = robot.tracker
    position, rotation = numbers(tracker.position_mm, 3), numbers(tracker.rotation_vector_rad, 5)
    return (
        f"set tracker.position_mm to {position} and tracker.rotation_vector_rad to {rotation}, "
        "or let it be found: ctcr calibrate frame ROBOT TABLE -o NEW.yaml"
    )
