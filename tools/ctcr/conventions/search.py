"""The search for wrong conventions.

It predicts the readings under every hypothesis, alone and together with one on the tracker, calibrates the likely ones,
applies the clearest, and begins again.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from math import prod

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.conventions import orientation, tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.calibrated import Calibrated, calibrated, dearer, jump
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change, Hypothesis, hypotheses, offset_by, with_frame
from ctcr.model import parameters
from ctcr.model.sessions import FRAME
from ctcr.robot.description import Robot
from ctcr.show.wording import join, numbers, percent, short
from ctcr.table.measurements import Measurements

Wrong = tuple[Hypothesis, ...]


@dataclass(frozen=True)
class Case:
    """A robot and readings as they stand after the conventions found so far, with their calibration."""

    robot: Robot
    readings: Measurements
    fit: Calibrated
    changes: tuple[Change, ...] = ()  # that made these readings of those of the table

    def share_of(self, error: float) -> float:
        """An error [m] over the usual deployed length; infinite where nothing is deployed."""
        beta, _ = self.robot.joints_of_table(self.readings.beta, self.readings.alpha)
        deployed = np.median(np.max(beta + self.robot.lengths, axis=1))
        return error / deployed if deployed > 0 else np.inf


@dataclass(frozen=True)
class Tried:
    """One hypothesis or two, and the case that they make."""

    wrong: Wrong
    case: Case
    rivals: tuple[Wrong, ...] = ()  # of each hypothesis, those of another kind that explain the readings as well

    @property
    def doubts(self) -> int:
        return sum(one.doubts for one in self.wrong)

    @cached_property
    def turned_deg(self) -> float:
        """RMS error of the orientations in the form that suits them best."""
        return orientation.least_error_deg(self.case.fit, self.case.readings, mirror_of(self.wrong))

    @property
    def offset(self) -> Hypothesis | None:
        """The one that says that a home is another."""
        return next((one for one in self.wrong if one.offset), None)


def corrected(robot: Robot, readings: Measurements, of_runs: Measurements) -> tuple[Case, list[Finding], str]:
    """The case after all clear findings, these, and a sentence where something is wrong that no hypothesis explains:
    what comes nearest then is no finding.

    `readings` are a sample of the table, `of_runs` some of each run.
    """
    given = Case(robot, readings, calibrated(robot, readings))
    case, found = given, []
    while len(found) < settings.MOST_CONVENTIONS and (better := _clearest(case)):
        if not _of_one_session(case, better, of_runs):
            break
        found += _findings(case, better)
        case = replace(better.case, fit=replace(better.case.fit, scale=1.0))
    left = case.fit.beyond_jitter
    # Runs need not share a frame: what each has of its own is told apart later.
    if case.share_of(left) >= settings.PHYSICS_LEAVES:
        left = min(left, _with_run_frames(case, of_runs).beyond_jitter)
    if case.share_of(left) < settings.PHYSICS_LEAVES:
        return case, found, ""
    return given, [], _unexplained(case, left, found)


def _unexplained(case: Case, error: float, found: list[Finding]) -> str:
    """A sentence on an error [m] that no physics explains, and the hypothesis that comes nearest to an explanation."""
    left = f"{short(1e3 * error)} mm remain" if np.isfinite(error) else "the model has no solution"
    part = case.share_of(error)
    share = f", {percent(part)} of the deployed length" if np.isfinite(part) else ""
    nearest = f" The nearest explanation is: {join([one.text for one in found])}." if found else ""
    return (
        f"After calibration, and under every known convention, {left}{share}: more than effects and data sheets make. "
        "So the table or the robot file is wrong in another way, and effects cannot be judged. Check which point the "
        "poses are of and in which frame; the order, units and zeros of the columns; and the values of the "
        f"tubes.{nearest}"
    )


def _clearest(case: Case) -> Tried | None:
    """The one or two hypotheses that leave far less error than the table as it is and than all others; None without."""
    if not case.fit.may_be_beaten:
        return None
    singles, pairs = _likely(case)
    tried = _clear(case, singles)
    if not any(_is_noise(one.case.fit) for one in tried):
        tried += _clear(case, pairs)
        if tried and len((best := _alike(tried)[0]).wrong) > 1:
            tried += _clear(case, _exchanged(case, best))
    if not tried:
        return None
    best, *_ = alike = _alike(tried)
    if any(one.sensor is not None for one in best.wrong) and not _is_far(case.robot, best.case.fit.robot):
        return None
    if best.offset:
        exact = offset_by(best.offset, offset_of(best), case.robot.n_tubes)
        wrong = tuple(exact if one.offset else one for one in best.wrong)
        best = Tried(wrong, _applied(case, wrong))
    return replace(best, rivals=tuple(_rivals(k, best.wrong, alike) for k in range(len(best.wrong))))


def _alike(tried: list[Tried]) -> list[Tried]:
    """The sets that leave the least error, or hardly more, and agree with the orientations; fewest doubts first."""
    least = min(one.case.fit.typical for one in tried)
    alike = [one for one in tried if one.case.fit.typical < settings.CONVENTION_ALIKE * least]
    turned = min(one.turned_deg for one in alike)
    agree = [one for one in alike if settings.CONVENTION_CLEAR * one.turned_deg <= turned]
    return sorted(agree, key=lambda one: (one.doubts, one.case.fit.typical))


def mirror_of(wrong: Iterable[Hypothesis | Finding]) -> int | None:
    """The axis of the tracker that one of these mirrors."""
    return next(("xyz".index(one.columns[0][0]) for one in wrong if one.kind == "mirrored"), None)


def _rivals(k: int, wrong: Wrong, alike: Iterable[Tried]) -> Wrong:
    """Hypotheses of another kind that explain the readings as well as one of those that are wrong, beside the rest."""
    rest = {one.text for one in wrong[:k] + wrong[k + 1 :]}
    others = ([one for one in tried.wrong if one.text not in rest] for tried in alike)
    found = {new[0].text: new[0] for new in others if len(new) == 1 and new[0].kind != wrong[k].kind}
    return tuple(one for one in found.values() if not one.offset and not one.registers)


def _exchanged(case: Case, pair: Tried) -> Iterator[Wrong]:
    """Each of two hypotheses paired with others that are likely once it holds.

    A hypothesis on the tracker may absorb the error of another one.
    """
    for one in pair.wrong:
        singles, _ = _likely(_applied(case, (one,)))
        yield from ((one, *single) for single in singles)


def _clear(case: Case, some: Iterable[Wrong]) -> list[Tried]:
    """The sets of hypotheses that leave far less error than the table as it is, and than without any one of them."""
    tried = (Tried(wrong, _applied(case, wrong)) for wrong in some)
    return [one for one in tried if one.case.fit.typical < case.fit.typical and all(_needed(case, one))]


def _needed(case: Case, tried: Tried) -> Iterator[bool]:
    """Of each hypothesis, whether the readings that it changes have far less error with it than without."""
    for one, half in zip(tried.wrong, _halves(case, tried), strict=True):
        rows = _rows_of(one, case.readings)
        jumps = not (one.offset or one.registers) or _is_jump(case, one, tried, half)
        fit = tried.case.fit
        # Readings that have a solution only with it make no finding of one that shows a larger error.
        yield jumps and fit.at(rows).beats(half.at(rows)) and fit.rms_mm < half.rms_mm


def _rows_of(hypothesis: Hypothesis, readings: Measurements) -> Mask:
    """The readings (K,) that it changes; all where it changes the robot file."""
    new = hypothesis.change(readings)
    rows = (new.load_space != readings.load_space).any(axis=1) | (new.position != readings.position).any(axis=1)
    return rows if rows.any() else ~rows


def _halves(case: Case, tried: Tried) -> list[Calibrated]:
    """For each of several hypotheses the fit where it does not hold, but the others do."""
    if len(tried.wrong) == 1:
        return [case.fit]
    return [_applied(case, tuple(other for other in tried.wrong if other is not one)).fit for one in tried.wrong]


def _of_one_session(case: Case, better: Tried, of_runs: Measurements) -> bool:
    """Whether a better case explains more than that each run has a tracker frame of its own.

    It must leave less error than a frame for each run does without it, or far less once each run has its frame in both
    cases. Otherwise the runs are not one session, and the better case is not clear. Frames for each run include one new
    frame for all, so a better case that is only a new frame must leave hardly any error, or not much more than they do.
    """
    before, after = (_with_run_frames(one, of_runs) for one in (case, better.case))
    if all(one.frame or one.registers for one in better.wrong):
        return better.case.fit.left_of(case.fit)[0] < settings.CONVENTION_CONSTANT or not before.beats(better.case.fit)
    return better.case.fit.typical < before.typical or after.beats(before)


def _with_run_frames(case: Case, of_runs: Measurements) -> Calibrated:
    """A case in which each run has the frame that fits it best, with the cost of these numbers."""
    for change in case.changes:
        of_runs = change(of_runs)
    positions, error = tips.predicted(case.fit.robot, of_runs), np.full(len(of_runs), np.nan)
    runs = np.unique(of_runs.run)
    for run in runs:
        rows = of_runs.run == run
        if 3 * np.sum(rows) > FRAME:
            error[rows] = aligned(positions[rows], of_runs.position[rows])[2]
    return replace(case.fit, error=dearer(len(runs) * FRAME, len(of_runs)) * error)


def _is_noise(fit: Calibrated) -> bool:
    return fit.typical < settings.CONVENTION_AT_FLOOR * fit.jitter


def _likely(case: Case) -> tuple[list[Wrong], list[Wrong]]:
    """Single hypotheses, and pairs of which each is needed, that leave the least error before any calibration. Of the
    offsets of a joint the best one counts.
    """
    looks = dict(_looks(case))
    given = settings.CONVENTION_ROUGH * looks.pop(())

    def first(some: Iterable[Wrong], look: int) -> list[Wrong]:
        best = {}
        for wrong in sorted(some, key=lambda wrong: looks[wrong][look]):
            if np.isfinite(looks[wrong]).all() and (looks[wrong] <= given).any():
                best.setdefault(tuple((one.kind, one.columns, one.text) for one in wrong), wrong)
        return [*best.values()][: settings.CONVENTION_LIKELY]

    singles = [wrong for wrong in looks if len(wrong) == 1]
    unsolved = np.full(2, np.inf)
    halves = {two: min(looks.get((one,), unsolved)[0] for one in two) for two in looks if len(two) > 1}
    pairs = [wrong for wrong, half in halves.items() if looks[wrong][0] < settings.CONVENTION_CLEAR * half]
    return [*dict.fromkeys(first(singles, 0) + first(singles, 1))], first(pairs, 0)


def _looks(case: Case) -> Iterator[tuple[Wrong, Array]]:
    """Median errors (2,) [m of the table] before any calibration, in the file's frame and in the one that fits best:
    with no hypothesis, with each, and with pairs, one at least of which is of the tracker; of these in the file's frame
    alone.

    What the model does not solve is left out.
    """
    every, few = hypotheses(case.robot, case.readings), case.readings.rows(slice(None, None, settings.CONVENTION_EVERY))
    alone = [(one,) for one in every if one.of_tracker]
    pairs = [a + b for a, b in combinations(alone, 2) if a[0].kind != b[0].kind]
    of_tracker = {wrong: _changed(case, wrong, few) for wrong in [(), *alone, *pairs]}
    for own in [(), *((one,) for one in every if not one.of_tracker)]:
        predicted, free = tips.predicted(*_changed(case, own, few)), {}
        if np.isfinite(predicted).all(axis=1).mean() <= settings.CONVENTION_SOLVED:
            yield own, np.full(2, np.inf)
            continue
        room = 0 if own and own[0].sensor is not None else 2 - len(own)  # the place of the sensor takes in what it can
        for wrong, (robot, readings) in of_tracker.items():
            if len(wrong) > room:
                continue
            moved, registers = tuple(one for one in wrong if one.of_positions), any(one.registers for one in wrong)
            if moved not in free and (registers or len(own) + len(wrong) < 2):
                free[moved] = np.nanmedian(aligned(predicted, readings.position)[2])
            here = free[moved] if registers else np.nanmedian(tips.errors(robot, readings, predicted))
            yield own + wrong, np.array([here, free.get(moved, here)]) / _scale(wrong)


def _scale(wrong: Wrong) -> float:
    """Of the positions under these hypotheses, over those of the table."""
    return prod(one.scale for one in wrong)


def _changed(case: Case, wrong: Wrong, readings: Measurements) -> tuple[Robot, Measurements]:
    """Robot and readings where the hypotheses hold."""
    robot = case.robot
    for one in wrong:
        robot, readings = one.robot(robot), one.change(readings)
    return robot, readings


def _applied(case: Case, wrong: Wrong) -> Case:
    robot, readings = _changed(case, wrong, case.readings)
    if any(one.registers for one in wrong):
        rotation, origin, _ = aligned(tips.predicted(robot, readings), readings.position)
        robot = with_frame(robot, rotation, origin)
    free = tuple(name for one in wrong for name in one.frees)
    scale = _scale(wrong)
    fit = replace(calibrated(robot, readings, free=free, to_beat=scale * case.fit.typical), scale=scale)
    return Case(robot, readings, fit, (*case.changes, *(one.change for one in wrong)))


def _is_far(before: Robot, after: Robot) -> bool:
    """Whether the sensor is farther from its place than any mounting error, which is an effect."""
    move = after.tracker.sensor_position - before.tracker.sensor_position
    return float(np.linalg.norm(move)) > settings.SENSOR_JUMP[0]


def _is_jump(case: Case, one: Hypothesis, tried: Tried, half: Calibrated) -> bool:
    """Whether an offset moves a home, or a new frame moves the frame, farther than calibration would.

    A physical effect may look like an offset, but an offset explains only a part of it. So an offset counts if it is a
    right angle, or if hardly any of the error without it is left.
    """
    robot = tried.case.robot
    if one.registers:
        old, new = case.robot.tracker, tried.case.fit.robot.tracker
        turn = Rotation.from_matrix(new.rotation @ old.rotation.T).magnitude()
        shift = np.max(np.abs(new.position - old.position))
        names = parameters.expand("tracker.frame", robot)
        position, rotation = np.max(np.reshape([parameters.stated_sd(robot, name) for name in names], (2, 3)), axis=1)
        return shift > jump("position", position) or turn > jump("rotation", rotation)
    kind, size = one.offset[0], offset_of(tried)
    right = kind == "alpha" and size % (np.pi / 2) == 0
    constant = tried.case.fit.left_of(half)[0] < settings.CONVENTION_CONSTANT
    return abs(size) > jump(one.home, parameters.stated_sd(robot, one.home)) and (right or constant)


def offset_of(tried: Tried) -> float:
    """The offset of a home that fits best, SI: that of the hypothesis and what calibration adds to it.

    A fitted angle that differs from a right angle by less than three standard deviations of homes counts as one.
    """
    (kind, _, size), home, robot = tried.offset.offset, tried.offset.home, tried.case.robot
    size += float(parameters.values(tried.case.fit.robot, [home])[0] - parameters.values(robot, [home])[0])
    right = np.pi / 2 * round(size / (np.pi / 2))
    near = 3 * parameters.stated_sd(robot, home)
    return right if kind == "alpha" and right and abs(size - right) < near else size


def _findings(case: Case, tried: Tried) -> Iterator[Finding]:
    """A finding of each hypothesis, with the error where all others hold but this."""
    for one, without, rivals in zip(tried.wrong, _halves(case, tried), tried.rivals, strict=True):
        text, fix = _offset_in_words(one, tried.case.robot) if one.offset else (one.text, one.fix)
        if one.sensor is not None:
            place = numbers(tried.case.fit.robot.tracker.sensor_position_mm, 1)
            fix = f"set tracker.sensor_position_mm to {place}, or to null: ctcr calibrate fit finds it"
        if one.frame or one.registers:
            fix = _frame_in_words(tried.case.fit.robot if one.registers else tried.case.robot)
        others = [Finding(rival.kind, rival.text, rival.columns, rival.fix) for rival in rivals]
        yield Finding(one.kind, text, one.columns, fix, rms_mm=(without.rms_mm, tried.case.fit.rms_mm), rivals=others)


def _offset_in_words(hypothesis: Hypothesis, robot: Robot) -> tuple[str, str]:
    (kind, tube, size), name = hypothesis.offset, hypothesis.columns[0]
    field = parameters.field_of(hypothesis.home)
    key, size = field.path[1], float(round(field.factor * size))
    old = list(getattr(robot.actuation, key))
    recorded = getattr(robot.actuation, f"recorded_{key}") or old
    new = [home + size * (i == tube) for i, home in enumerate(old)]
    text = f"{name} counts from another {'plane' if kind == 'alpha' else 'place'}: {size:+g} {field.unit} are missing"
    fix = f"set actuation.{key} to {numbers(new)} and actuation.recorded_{key} to {numbers(recorded)}"
    return text, fix


def _frame_in_words(robot: Robot) -> str:
    tracker = robot.tracker
    position, rotation = numbers(tracker.position_mm, 3), numbers(tracker.rotation_vector_rad, 5)
    return (
        f"set tracker.position_mm to {position} and tracker.rotation_vector_rad to {rotation}, "
        "or let it be found: ctcr calibrate frame ROBOT TABLE -o NEW.yaml"
    )
