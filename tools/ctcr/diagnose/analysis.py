"""All steps of a diagnosis, in their order."""

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr.audit.preparation import prepared
from ctcr.diagnose import decision, distorted, jump, other_runs, unsteady, varying
from ctcr.diagnose import race as racing
from ctcr.diagnose.accepted import WRONG, Accepted, with_shapes
from ctcr.diagnose.candidates import Candidate, candidates
from ctcr.diagnose.engine import FITS, Engine, values_of
from ctcr.diagnose.far_off import alone, far_off, in_words
from ctcr.diagnose.leftover import Leftover, leftover_of
from ctcr.diagnose.prediction import predictive
from ctcr.diagnose.race import Progress, Round
from ctcr.diagnose.verdict import Verdict, judge
from ctcr.effects import catalogue
from ctcr.fit import folds, joint, one_sided
from ctcr.fit.result import rms
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]

TURNS = 2  # quarters that are locked away in turn, where that is needed
MANY = 0.1  # share of outliers that calibration takes beyond which it is hardly right
HARDLY = 0.4  # share of the excess that the first effect removes, below which it hardly explains anything
LOST = 10.0  # log evidence below the race's by which a fit with its own weights lost the effect to outliers
SAFE = 100.0  # log evidence of an effect that others have surely not made superfluous
MOST_OPEN = 1.5  # expected mean square error of a locked run over that of the others


@dataclass
class Diagnosis:
    robot: Robot
    measurements: Measurements
    locked: NDArray[np.bool_]  # rows that no fit saw
    glitches: NDArray[np.bool_]  # those of them that are off alone, and do not count
    unseen: dict[str, str]  # effects that these data cannot show, and why
    calibrated: joint.Fit  # without effects, for prediction
    with_effects: joint.Fit  # for prediction
    final: joint.Fit  # with effects, under the noise of the most evidence: its values are those to quote
    noise_floor_mm: float  # RMS that the tracker's noise leaves of a right model
    rounds: list[Round]
    accepted: list[Accepted]
    leftover: Leftover
    varying: varying.Varying | None  # what would have to vary to explain what is left
    verdict: Verdict
    notices: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def explained(self) -> float:
        """Share of the excess that the first effect removed."""
        return self.accepted[0].share if self.accepted else 0.0

    @property
    def outliers(self) -> float:
        """Share of the readings that calibration alone takes for outliers."""
        return racing.outliers(self.rounds[0].before)

    @property
    def hides_in_outliers(self) -> bool:
        """Whether more readings are taken for outliers than there may be, and effects do not tell why."""
        most = racing.MOST_OUTLIERS
        left = self.outliers > most and racing.outliers(self.final) > max(most, 0.5 * self.outliers)
        others_fit = np.max(self.rounds[0].before.inflation) < FITS
        is_wrong = self.outliers > MANY and np.max(self.final.inflation) > WRONG
        return left and bool(self.explained < HARDLY or others_fit or is_wrong)

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Locked rows that hold a reading, but for those that are off alone."""
        return self.locked & ~self.glitches & folds.measured_rows(self.measurements)

    @property
    def rms_mm(self) -> dict[str, float]:
        """Of the rows judged."""
        return {
            "nominal": self.calibrated.nominal_rms_mm(self.judged),
            "calibrated": self.calibrated.rms_mm(self.judged),
            "with_effects": self.with_effects.rms_mm(self.judged),
            "noise_floor": self.noise_floor_mm,
        }

    @property
    def expected_mm(self) -> float:
        """RMS to be expected on the rows judged, of a right model: noise, and what the parameters leave open.

        Far above the noise floor where these rows are unlike those that were fitted.
        """
        return max(self.with_effects.floor_mm(self.judged), self.noise_floor_mm)

    def reached_mm(self, accepted: Accepted) -> float:
        """RMS of the rows judged, once an accepted effect was in, with those accepted before."""
        return 1e3 * rms(accepted.residual, self.judged)

    def rest(self) -> None:
        """Gives back the memory of what its fits can compute again."""
        self.calibrated, self.with_effects, self.final = (
            fit.at_rest() for fit in (self.calibrated, self.with_effects, self.final)
        )

    def parameters(self, accepted: Accepted) -> dict[str, float]:
        """Fitted values, and those of its choices, by name without the id."""
        stem = f"effects.{accepted.entry.id}."
        values = dict(accepted.entry.candidate.shape) | values_of(self.final)
        return {name.removeprefix(stem): value for name, value in values.items() if name.startswith(stem)}

    @property
    def depends_on(self) -> list[str]:
        """Ids of the quantities on which what is left depends."""
        more = self.varying.depends_on if self.varying else []
        return list(dict.fromkeys([*self.leftover.depends_on, *more]))

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict.word,
            "effects": [
                {"class": a.ids, "parameters": self.parameters(a), "delta_log_evidence": round(a.log_evidence, 3)}
                for a in self.accepted
            ],
            "leftover": {"structured": self.leftover.structured, "depends_on": self.depends_on},
            "rms_mm": {name: round(value, 5) for name, value in self.rms_mm.items()},
            "seconds": round(self.seconds, 2),
        }


def diagnose(
    robot: Robot, measurements: Measurements, *, progress: Progress = lambda _: None, threads: int = 0
) -> Diagnosis:
    """Which effects are missing. Raises InputError where no fit is possible.

    What is found in three quarters of the runs is judged on the last quarter. Where nothing was found and that quarter
    has errors which the others do not, it changes places with another one, and all begins anew; so do runs that the
    others turn out to leave open.
    """
    began = perf_counter()
    measurements, notices = prepared(robot, measurements)
    for turn in range(TURNS):
        locked = folds.held_out_rows(robot, measurements, turn)
        result = _of_these(robot, measurements, locked, progress, threads)
        beyond = _beyond_judging(result)
        if beyond:
            result.rest()
            locked = folds.held_out_rows(robot, measurements, turn, beyond)
            again = _of_these(robot, measurements, locked, progress, threads)
            if again.accepted or not result.accepted:  # else the runs that showed it are those locked now
                result = again
        if result.accepted or not _surprises(result):
            break
    if not result.measurements.from_home:
        notices = [
            *notices,
            "taken to have been at rest at the first reading, not to have come from home: it fits better",
        ]
    result.notices = [*result.notices, *notices]
    result.seconds = perf_counter() - began
    return result


def _of_these(
    robot: Robot, measurements: Measurements, locked: NDArray[np.bool_], progress: Progress, threads: int
) -> Diagnosis:
    """With these rows locked."""
    result = _diagnose(robot, measurements, locked, progress, threads, robust=True)
    together = result.leftover.places
    if not result.hides_in_outliers and not together:
        return result
    result.rest()
    # What an effect does to a few readings looks like outliers, until they count.
    other = _diagnose(robot, measurements, locked, progress, threads, robust=False)
    if together:
        there = np.isin(measurements.row, together)
        return min(result, other, key=lambda r: (np.sum(far_off(r.with_effects)), r.with_effects.rms_mm(there)))
    return max(result, other, key=lambda r: r.final.log_evidence)


def _beyond_judging(result: Diagnosis) -> set[int]:
    """Locked groups that the fitted ones turned out to leave open: what they would show is not known by any model."""
    fit, group = result.with_effects, folds.groups(result.measurements)
    expected = fit.expected_square[:, 0]
    usual = np.nanmean(expected[~result.locked])
    beyond = {k for k in np.unique(group[result.locked]) if np.nanmean(expected[group == k]) > MOST_OPEN * usual}
    for a in result.accepted:
        if "order" in catalogue.get(a.entry.id, result.robot.n_tubes).needs and result.locked[group == 0].any():
            beyond.add(0)  # how the robot came to its first row is not recorded
        if a.entry.id == "frame_jump":  # before or after it?
            when = dict(a.entry.candidate.shape)[jump.WHEN]
            beyond |= set(group[jump.uncertain_rows(result.measurements, ~result.locked, when)])
    return beyond


def _surprises(result: Diagnosis) -> bool:
    """Whether the locked runs have errors that those which were fitted do not."""
    seen = np.isfinite(result.calibrated.residual[:, 0])
    return bool(np.mean(far_off(result.calibrated)[seen & result.locked]) > racing.MOST_OUTLIERS)


def _diagnose(
    robot: Robot, measurements: Measurements, locked: NDArray[np.bool_], progress: Progress, threads: int, robust: bool
) -> Diagnosis:
    noise = noise_of_readings(robot, measurements)
    engine = Engine(robot, measurements, noise, ~locked, robust, threads=threads)
    pool, unseen = candidates(robot, measurements)
    pool = [c for c in pool if c.id not in robot.effects]

    rounds: list[Round] = []
    accepted: list[Accepted] = []
    before, start, settled = {}, {}, False
    few = folds.few_of(engine.fitted)
    if few is not None:
        progress("a part of the readings first")
        part = replace(engine, rows=few, tolerance=joint.COARSE)
        more = np.sum(engine.fitted) / np.sum(few)
        first = racing.baseline(part, [], {}, progress)
        before = values_of(first)
        first, settled = _grow(part, first, pool, accepted, rounds, progress, more)
        start = values_of(first)
        engine.measurements = part.measurements
    calibrated = fit = racing.baseline(engine, [], before, progress)
    if accepted:
        engine.robust = True
        fit = racing.baseline(engine, [a.entry for a in accepted], start, progress)
    if not settled:
        fit, _ = _grow(engine, fit, pool, accepted, rounds, progress)
    if len(accepted) > 1:
        fit = _backward(engine, accepted, fit, progress)
    progress("what is left")
    names, fixed = racing.parameters([a.entry for a in accepted])
    seen, told = unsteady.followed(engine, fit)
    lags = [*told, unsteady.FOLLOWED] if told else []
    leftover = leftover_of(engine, calibrated, seen, lags)
    progress("prediction of other runs")
    plain = after = predictive(engine, calibrated, {})
    if accepted:
        after = predictive(engine, fit, fixed)
        after = unsteady.followed(engine, after)[0] if lags else after
    explained = other_runs.explained(engine, plain, after) if accepted else {}
    varies = None
    if leftover.rejected and accepted and varying.may_outdo(engine, calibrated, after):
        progress("parameters that are not constant")
        varies = varying.found(engine, calibrated, leftover.sample)
    outdone = varies is not None and varies.outdoes(engine, calibrated, after)
    glitches = alone(engine.measurements, after, locked)
    verdict = judge(plain, after, accepted, leftover, locked & ~glitches, explained, outdone)
    floor_noise = fit.noise
    # A smooth error explains many causes that are none of the field's: only for one that is found by itself.
    smooth = distorted.noise_of(engine, fit) if verdict.word == "identified" else None
    if smooth is not None:
        fit = engine.fit(names, start=values_of(fit), fixed=fixed, noise=smooth, near=True)
        seen = unsteady.followed(engine, fit)[0] if lags else fit
        after = distorted.taken_off(engine, seen, smooth)
        told = [*lags, distorted.in_words(smooth), distorted.FOLLOWED]
        leftover = leftover_of(engine, calibrated, seen, told)
        varies = None  # without it more was left
    if leftover.rejected and not (varies and verdict.names_no_cause):
        progress("parameters that are not constant")
        varies = varying.found(engine, calibrated if verdict.names_no_cause else fit, leftover.sample)
    return Diagnosis(
        robot,
        engine.measurements,
        locked,
        glitches,
        unseen,
        plain,
        one_sided.widened(after),
        unsteady.widened(engine, one_sided.widened(fit)),
        joint.noise_floor(after, floor_noise, engine.places)[0],
        rounds,
        accepted,
        leftover,
        varies,
        verdict,
        in_words(engine.measurements, after, glitches),
    )


def _grow(
    engine: Engine,
    fit: joint.Fit,
    pool: list[Candidate],
    accepted: list[Accepted],
    rounds: list[Round],
    progress: Progress,
    more: float = 1.0,
) -> tuple[joint.Fit, bool]:
    """Accepts one effect after the other; the fit with them, and whether nothing is left to look for.

    more: how many times as many readings there are in all. Where these could change the outcome of a round, it is left
    to them.
    """
    while len(accepted) < racing.MAX_EFFECTS:
        taken = {identity for a in accepted for identity in a.ids}
        open_to = [c for c in pool if c.id not in taken]
        round_ = racing.race(engine, fit, open_to, [a.entry for a in accepted], progress)
        sure = round_.is_hopeless(more) or (len(round_.ids) == 1 and round_.margin >= racing.SURE)
        if more > 1 and not sure:
            return fit, False
        rounds.append(round_)
        if round_.accepted is None:
            break
        entry, engine.robust = round_.accepted, True
        rest = {"share": entry.share, "aside": racing.aside(round_)}
        accepted.append(Accepted(entry, round_.ids, entry.refit, round_.margin, **rest))
        start = racing.arrived(engine, fit, [a.entry for a in accepted])
        before, entries = fit, [a.entry for a in accepted]
        fit = racing.baseline(engine, entries, values_of(start), progress)
        if fit.log_evidence < start.log_evidence - LOST:
            names, fixed = racing.parameters(entries)
            fit = engine.fit_like(before, names, start=values_of(start), fixed=fixed, near=True)
        rejected = engine.rejects(fit)
        fit = _begun(engine, accepted, fit, progress)
        fit = with_shapes(engine, accepted, accepted[-1], fit, progress)
        accepted[-1].residual = fit.residual[:, :3]
        if rejected and accepted[0].share < HARDLY:
            break  # no effect is stacked on one that hardly explains anything
    for a in accepted[:-1]:  # what the others hid of their forms shows now
        fit = with_shapes(engine, accepted, a, fit, progress)
    return fit, True


def _begun(engine: Engine, accepted: list[Accepted], fit: joint.Fit, progress: Progress) -> joint.Fit:
    """Where the effect accepted last remembers: the fit with the way to the first row that the readings ask for."""
    if "order" not in catalogue.get(accepted[-1].entry.id, engine.robot.n_tubes).needs:
        return fit
    entries = [a.entry for a in accepted]
    if not engine.begins_otherwise(fit, *racing.parameters(entries)):
        return fit
    return racing.baseline(engine, entries, values_of(fit), progress)


def _backward(engine: Engine, accepted: list[Accepted], fit: joint.Fit, progress: Progress) -> joint.Fit:
    """Drops accepted effects that the others have made superfluous."""
    for a in list(accepted[:-1]):
        rest = [b for b in accepted if b is not a]
        progress(f"without {a.entry.id}")
        names, fixed = racing.parameters([b.entry for b in rest])
        start = values_of(fit)
        for iterations in (racing.ITERATIONS, racing.END):  # what is far behind need not be followed there
            without = engine.fit_like(
                fit, names, start=start, fixed=fixed, max_iterations=iterations, tolerance=joint.COARSE
            )
            a.log_evidence = unsteady.evidence(engine, fit) - unsteady.evidence(engine, without)
            if a.log_evidence > SAFE:
                break
            start = values_of(without)
        if a.log_evidence < decision.EVIDENCE:
            accepted.remove(a)
            return racing.baseline(engine, [b.entry for b in accepted], values_of(without), progress)
    return fit
