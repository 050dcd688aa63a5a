"""The search: every hypothesis and pair is predicted, the likely ones are calibrated, the likeliest is applied."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.conventions import tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.calibrated import Calibrated, calibrated, jump
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change, Hypothesis, hypotheses, offset_by, with_frame
from ctcr.conventions.likelihood import Likelihood
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Wrong = tuple[Hypothesis, ...]
PRIOR = settings.DECISIVE + settings.UNASKED  # [log odds] against a wrong convention of any kind


@dataclass(frozen=True, eq=False)
class Case:
    """A robot and readings where some hypotheses hold, with their calibration."""

    robot: Robot
    readings: Measurements
    fit: Calibrated
    wrong: Wrong = ()
    changes: tuple[Change, ...] = ()  # that made these readings of those of the table

    @property
    def residual(self) -> Array:
        """(K, 3) [m] of the readings as given; where there is no prediction, from the mean of all."""
        position = self.readings.position
        residual = np.where(self.fit.solved[:, None], self.fit.residual, position - position.mean(axis=0))
        return residual / self.scale

    @property
    def scale(self) -> float:
        """Of positions in m over those of the table."""
        return float(np.prod([one.scale for one in self.wrong]))

    @property
    def ordinary(self) -> Mask:
        """Rows (K,) that are no outliers."""
        size = np.linalg.norm(self.residual, axis=1)
        return size < settings.SURPRISE * np.median(size)

    def gain(self, other: "Case", n_hypotheses: int = 1) -> float:
        """Log odds of this case against another one, where each of so many hypotheses may hold.

        Rows that are outliers in both do not count.
        """
        likelihood = Likelihood(other.readings, self.ordinary | other.ordinary)
        mine, its = (one._log_evidence(likelihood, n_hypotheses) for one in (self, other))
        return mine - its

    def _log_evidence(self, likelihood: Likelihood, n_hypotheses: int) -> float:
        jitter = max(self.fit.floor / np.sqrt(3), settings.CONVENTION_FINEST) / self.scale
        prior = len(self.wrong) * (PRIOR + np.log(n_hypotheses))
        return likelihood(self.residual, jitter) - self.fit.improbable - prior


def corrected(robot: Robot, readings: Measurements) -> tuple[Case, list[Finding]]:
    """The case after all findings, and these, of a sample of the table."""
    case, found = Case(robot, readings, calibrated(robot, readings)), []
    while len(found) < settings.MOST_CONVENTIONS and (better := _likeliest(case)):
        found += _findings(case, better)
        case = replace(better, wrong=())
    return case, found


def _likeliest(case: Case) -> Case | None:
    """The case with further hypotheses that is likelier than this one, and than one where each run has a frame of its
    own; None without any."""
    if case.fit.is_noise:
        return None
    every, tried = hypotheses(case.robot, case.readings), [case, with_run_frames(case, np.unique(case.readings.run))]
    for some in _candidates(case, every):
        found = [_applied(case, wrong) for wrong in some]
        tried += [one for one in found if one.fit.typical < case.fit.typical * one.scale and _is_jump(case, one)]
        if any(one.fit.is_noise for one in found):
            break

    gain = {one: one.gain(case, len(every)) for one in tried}
    alike = [one for one in tried if gain[one] > max(gain.values()) - settings.TIE]
    best = min(alike, key=lambda one: (sum(h.doubts for h in one.wrong), -gain[one]))
    if not best.wrong:
        return None
    rivals = [one for one in alike if len(one.wrong) == len(best.wrong)]
    wrong = tuple(replace(one, rivals=_instead(one, best, rivals)) for one in best.wrong)
    exact = tuple(offset_by(one, offset_of(one, best), case.robot.n_tubes) if one.offset else one for one in wrong)
    return _applied(case, exact)


def _instead(one: Hypothesis, best: Case, rivals: Iterable[Case]) -> list[Hypothesis]:
    """Hypotheses of another kind that explain the readings as well in place of one."""
    rest, found = {id(other) for other in best.wrong if other is not one}, []
    for rival in rivals:
        others = [other for other in rival.wrong if id(other) not in rest]
        if len(others) == 1 and others[0].kind != one.kind and not (others[0].offset or others[0].registers):
            found += others
    return found


def with_run_frames(case: Case, runs: Iterable[int]) -> Case:
    """The case in which each of some runs has the frame that fits it best: near that of all, as sessions have."""
    tip = tips.predicted(case.fit.robot, case.readings)
    tip = tip @ case.fit.robot.tracker.rotation.T + case.fit.robot.tracker.position
    residual, improbable = case.fit.residual.copy(), case.fit.improbable
    uncertainty, wider = case.robot.uncertainty, settings.SESSION_PRIOR_WIDER
    sd = wider * np.array(
        [1e-3 * uncertainty.of("tracker_frame_mm", 0), np.deg2rad(uncertainty.of("tracker_frame_deg", 0))]
    )
    for run in runs:
        rows = (case.readings.run == run) & case.fit.solved
        if rows.sum() > 2:
            rotation, shift, distance = aligned(tip[rows], case.readings.position[rows])
            centre = tip[rows].mean(axis=0)
            moved = rotation @ centre + shift - centre, Rotation.from_matrix(rotation).as_rotvec()
            lever = np.sqrt(np.mean(np.sum((tip[rows] - centre) ** 2, axis=1)))
            left = np.median(distance) / np.array([1.0, max(lever, settings.CONVENTION_FINEST)])
            improbable += sum(
                0.5 * m @ m / s**2 + 1.5 * np.log1p(s**2 / e**2) for m, s, e in zip(moved, sd, left, strict=True)
            )
            residual[rows] = case.readings.position[rows] - tip[rows] @ rotation.T - shift
    return replace(case, fit=replace(case.fit, residual=residual, improbable=improbable))


def _candidates(case: Case, every: Sequence[Hypothesis]) -> Iterator[list[Wrong]]:
    """Hypotheses that leave the least error before any calibration: first single ones and those of places beside one of
    the prediction, then pairs of those."""
    joints, rough = [(one,) for one in every if one.of_prediction], []

    def look(some: Sequence[Wrong], places: Sequence[Wrong], every_nth: int) -> Array:
        """Errors by hypotheses on the prediction, and places; all go to `rough`."""
        few = case.readings.rows(slice(None, None, every_nth))
        placed = [_Placed(case.robot, few, place) for place in places]
        errors = np.array([_rough(case.robot, few, one, placed) for one in some])
        rough.extend(
            (error, (*one, *place))
            for one, row in zip(some, errors, strict=True)
            for place, error in zip(places, row, strict=True)
        )
        return errors

    def likely(counts: Sequence[int]) -> list[Wrong]:
        """Of each number of hypotheses some; of an offset its best size alone."""
        found = []
        for count in counts:
            kept: dict[tuple, Wrong] = {}
            for error, some in sorted((pair for pair in rough if len(pair[1]) == count), key=lambda pair: pair[0]):
                alike = tuple((one.kind, one.columns, bool(one.offset) or id(one)) for one in some)
                if error < settings.CONVENTION_ROUGH * given and len(kept) < settings.CONVENTION_LIKELY:
                    kept.setdefault(alike, some)
            found += kept.values()
        return found

    def best(some: Sequence[Wrong], errors: Array) -> list[Wrong]:
        return [some[i] for i in np.argsort(errors, kind="stable")[: settings.CONVENTION_LIKELY]]

    places = [(), *_placements(every)]
    errors = look([(), *joints], places, settings.CONVENTION_EVERY)
    given = np.nan_to_num(errors[0, 0], posinf=1e300)
    fitted = _rough_of(case.fit.robot, case.readings.rows(slice(None, None, settings.CONVENTION_EVERY)), joints)
    yield list(dict.fromkeys([*likely([1, 2, 3]), *best(joints, fitted)]))
    rough.clear()
    pairs = [
        (*one, other)
        for one in best(joints, errors[1:].min(axis=1))
        for (other,) in joints
        if not {*one[0].columns} & {*other.columns}
    ]
    look(pairs, best(places, errors.min(axis=0)), settings.CONVENTION_EVERY_PAIR)
    yield likely([2, 3])


def _placements(every: Sequence[Hypothesis]) -> list[Wrong]:
    """Hypotheses on positions and the frame, and pairs of a unit and another."""
    units = [one for one in every if one.scale != 1]
    others = [one for one in every if not one.of_prediction and one.scale == 1]
    return [*((one,) for one in (*units, *others)), *((unit, other) for unit in units for other in others)]


class _Placed:
    """Readings and tracker where hypotheses on places hold."""

    def __init__(self, robot: Robot, readings: Measurements, place: Wrong):
        for one in place:
            robot, readings = one.robot(robot), one.change(readings)
        self._position, self._rotation, self._origin = readings.position, robot.tracker.rotation, robot.tracker.position
        self._scale = float(np.prod([one.scale for one in place]))
        self._registers = any(one.registers for one in place)

    def error(self, predicted: Array) -> float:
        """Median distance [m], as given, of positions (K, 3) that are predicted in the base frame."""
        if self._registers:
            size = aligned(predicted, self._position)[2]
        else:
            size = np.linalg.norm(self._position - predicted @ self._rotation.T - self._origin, axis=1)
        return float(np.median(size[np.isfinite(size)])) / self._scale


def _rough_of(robot: Robot, readings: Measurements, some: Sequence[Wrong]) -> Array:
    """Errors where each of some hypotheses on joints and loads holds."""
    placed = [_Placed(robot, readings, ())]
    return np.array([_rough(robot, readings, one, placed)[0] for one in some])


def _rough(robot: Robot, readings: Measurements, joints: Wrong, placed: Sequence[_Placed]) -> list[float]:
    """Errors where hypotheses on joints and loads hold, and several on places."""
    for one in joints:
        readings = one.change(readings)
    predicted = tips.predicted(robot, readings)
    solved = np.isfinite(predicted).all(axis=1).mean() >= settings.CONVENTION_SOLVED
    return [place.error(predicted) if solved else np.inf for place in placed]


def _applied(case: Case, wrong: Wrong) -> Case:
    robot, readings = case.robot, case.readings
    for one in wrong:
        robot, readings = one.robot(robot), one.change(readings)
    if any(one.registers for one in wrong):
        rotation, origin, _ = aligned(tips.predicted(robot, readings), readings.position)
        robot = with_frame(robot, rotation, origin)
    scale = np.prod([one.scale for one in wrong])
    free = [one.frees for one in wrong if one.frees]
    fit = calibrated(robot, readings, free=free, to_beat=case.fit.typical * scale)
    return Case(robot, readings, fit, wrong, (*case.changes, *(one.change for one in wrong)))


def _is_jump(before: Case, case: Case) -> bool:
    """Whether each offset moves a home, and another frame the tracker, farther than a calibration would."""
    uncertainty = case.robot.uncertainty
    for one in case.wrong:
        if one.offset:
            key, unit = (
                ("rotation_offset_deg", np.pi / 180) if one.offset[0] == "alpha" else ("translation_offset_mm", 1e-3)
            )
            if abs(offset_of(one, case)) <= jump(one.frees, unit * uncertainty.of(key, one.offset[1])):
                return False
        if one.registers:
            old, new = before.robot.tracker, case.fit.robot.tracker
            turn = Rotation.from_matrix(new.rotation @ old.rotation.T).as_rotvec()
            far = [jump("position", 1e-3 * uncertainty.of("tracker_frame_mm", axis)) for axis in range(3)]
            turned = [jump("rotation", np.deg2rad(uncertainty.of("tracker_frame_deg", axis))) for axis in range(3)]
            if (np.abs([*(new.position - old.position), *turn]) <= [*far, *turned]).all():
                return False
    return True


def offset_of(hypothesis: Hypothesis, case: Case) -> float:
    """The offset of a home that fits best, SI: that of the hypothesis and what calibration adds to it.

    A right angle is taken for one, where the fit is as near to it as homes are known.
    """
    kind, tube, size = hypothesis.offset
    home, factor = ("home_rotation_deg", np.pi / 180) if kind == "alpha" else ("home_translation_mm", 1e-3)
    old, new = (getattr(robot.actuation, home)[tube] for robot in (case.robot, case.fit.robot))
    size += factor * (new - old)
    right = np.pi / 2 * round(size / (np.pi / 2))
    near = 3 * np.deg2rad(case.robot.uncertainty.of("rotation_offset_deg", tube))
    return right if kind == "alpha" and right and abs(size - right) < near else size


def _findings(before: Case, after: Case) -> Iterator[Finding]:
    """A finding of each hypothesis, with the error where all others hold but this."""
    for one in after.wrong:
        others = tuple(other for other in after.wrong if other is not one)
        without = _applied(before, others) if others else before
        text, fix = one.text, one.fix
        if one.offset:
            text, fix = _offset_in_words(one, after.robot)
        if one.frame or one.registers:
            fix = _frame_in_words(after.fit.robot if one.registers else after.robot)
        errors = (without.fit.rms_mm, after.fit.rms_mm)
        rivals = [Finding(rival.kind, rival.text, rival.columns, rival.fix) for rival in one.rivals]
        yield Finding(one.kind, text, one.columns, fix, rms_mm=errors, rivals=rivals)


def _offset_in_words(hypothesis: Hypothesis, robot: Robot) -> tuple[str, str]:
    kind, tube, size = hypothesis.offset
    key, unit, factor = (
        ("home_rotation_deg", "deg", 180 / np.pi) if kind == "alpha" else ("home_translation_mm", "mm", 1e3)
    )
    size = float(round(factor * size))
    old = list(getattr(robot.actuation, key))
    recorded = getattr(robot.actuation, f"recorded_{key}") or old
    new = [home + size * (i == tube) for i, home in enumerate(old)]
    where = "plane" if kind == "alpha" else "place"
    text = f"{hypothesis.columns[0]} counts from another {where}: {size:+g} {unit} are missing"
    fix = f"set actuation.{key} to {numbers(new)} and actuation.recorded_{key} to {numbers(recorded)}"
    return text, fix


def _frame_in_words(robot: Robot) -> str:
    tracker = robot.tracker
    position, rotation = numbers(tracker.position_mm, 3), numbers(tracker.rotation_vector_rad, 5)
    return (
        f"set tracker.position_mm to {position} and tracker.rotation_vector_rad to {rotation}, "
        "or let it be found: ctcr calibrate frame ROBOT TABLE -o NEW.yaml"
    )


def numbers(values, digits: int = 6) -> str:
    """A list as a robot file holds it."""
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.10g}" for value in values) + "]"
