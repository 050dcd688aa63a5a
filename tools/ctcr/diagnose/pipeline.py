"""The whole diagnosis: which effects are missing, judged on runs that no fit has seen."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask
from ctcr.audit import prepared
from ctcr.conventions import Finding
from ctcr.diagnose import lags, outliers, smooth_field
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine, Progress, values_of
from ctcr.diagnose.explanations import probability
from ctcr.diagnose.held_out import check_size, explained_by_run, fit_to_predict
from ctcr.diagnose.residual import Residual, residual_of
from ctcr.diagnose.round import Round, implausible_values, parameters_of
from ctcr.diagnose.selection import Accepted, select_effects
from ctcr.diagnose.starts import rows_around
from ctcr.diagnose.varying_coefficients import VaryingModel, varying_model
from ctcr.diagnose.verdict import Verdict, judge
from ctcr.effects import catalogue
from ctcr.fit import folds, joint, one_sided
from ctcr.fit.floors import Floors, floors
from ctcr.fit.result import rms
from ctcr.fit.widening import Widened, widened
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.show.result import Glance, Result, frame
from ctcr.show.wording import counted, listed, sentence
from ctcr.table.measurements import Measurements

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(repr=False)
class Diagnosis(Result):
    """The course of the selection, the effects that were found, and the verdict."""

    PAGE = "diagnose.report"
    PICTURE = "diagnose.figures", "waterfall", 5.2, 3.8

    robot: Robot
    measurements: Measurements
    held_out: Mask  # (M,) rows that no fit has seen
    isolated: Mask  # (M,) isolated outliers among them, which do not count
    not_testable: dict[str, str]  # effects that these data cannot show, and why
    calibrated: joint.Fit  # without effects, for prediction
    with_effects: joint.Fit  # for prediction
    final: joint.Fit  # with effects, under the noise of the most evidence: its values are those to quote
    noise_floor_mm: float  # RMS position residual that the tracker's noise leaves, as the residual shows it
    floors: Floors  # of the model with the effects found
    rounds: list[Round]
    accepted: list[Accepted]
    residual: Residual
    varying: VaryingModel | None  # an explanation of the residual
    verdict: Verdict
    notices: list[str] = field(default_factory=list)
    seconds: float = 0.0
    conventions: Sequence[Finding] = ()  # that the review of the table found
    without_effects: "Diagnosis | None" = None  # the answer instead, where accepted effects predict nothing

    @property
    def files(self) -> list[str]:
        """The input files."""
        return [*self.robot.files, *self.measurements.files]

    def to_frame(self) -> "DataFrame":
        """A row an effect that was tried in a round: log evidence gained, linearised and in the joint fit (NaN: not
        fitted), fraction of the unexplained chi-square, and whether it was accepted or is as likely."""
        rows = [(number, one, r) for number, r in enumerate(self.rounds, start=1) for one in r.best]
        return frame(
            {
                "round": [number for number, _, _ in rows],
                "effect": [one.id for _, one, _ in rows],
                "linear": [one.linear for _, one, _ in rows],
                "fit": [np.nan if one.refit is None else one.refit for _, one, _ in rows],
                "explained": [np.nan if one.refit is None else one.explained for _, one, _ in rows],
                "accepted": [one is r.accepted for _, one, r in rows],
                "as_likely": [one.id in r.ids for _, one, r in rows],
            }
        )

    def glance(self) -> Glance:
        found = " and ".join(" or ".join(a.ids) for a in self.accepted)
        line = f"Diagnosis {self.robot.name}: {self.verdict.word.replace('_', ' ')}{f', {found}' if found else ''}"
        rows = [[name.replace("_", " "), f"{size:.3f}"] for name, size in self.rms_mm.items() if name != "noise_floor"]
        rows += [[name, f"{size:.3f}"] for name, size in self.floors.rows()]
        notes = [*self.verdict.sentences, *map(sentence, self.notices)]
        return Glance(line, ["error on held-out readings", "mm RMS"], rows, notes, warnings=self.measurements.doubts)

    @property
    def in_doubt(self) -> list[str]:
        """Sentences on fitted values of its effects that no real robot has, and on held-out readings that they do not
        predict better, where it is so."""
        n = self.robot.n_tubes
        odd = [text for a in self.accepted for text in implausible_values(n, self.final, a.best.candidate)]
        said = [f"The data ask for implausible values: {listed(odd)}."] if odd else []
        without, beside = self.rms_mm["calibrated"], self.rms_mm["with_effects"]
        if self.accepted and beside >= without:
            errors = f"{without:.3f} mm without effects, {beside:.3f} mm with them"
            said.append(f"Held-out readings are predicted no better for it: {errors}.")
        return said

    @property
    def judged(self) -> Mask:
        """Held-out rows that hold a reading, without isolated outliers (M,)."""
        return self.held_out & ~self.isolated & self.measurements.measured

    @property
    def judged_on(self) -> str:
        """How many readings these are, and of which runs or blocks of time."""
        groups = folds.named(self.measurements, self.held_out)
        return f"{counted(int(self.judged.sum()), 'held-out reading')} ({groups})"

    @property
    def rms_mm(self) -> dict[str, float]:
        """Position error of the judged rows."""
        return {
            "nominal": self.calibrated.nominal_rms_mm(self.judged),
            "calibrated": self.calibrated.rms_mm(self.judged),
            "with_effects": self.with_effects.rms_mm(self.judged),
            "noise_floor": self.noise_floor_mm,
        }

    @property
    def widened(self) -> list[Widened]:
        """Uncertainties of the robot file that the measurements contradict."""
        return widened(self.robot, self.final.priors.scales)

    def rms_mm_after(self, accepted: Accepted) -> float:
        """RMS error of the judged rows with this effect and those accepted before."""
        return 1e3 * rms(accepted.residual, self.judged)

    def release_memory(self) -> None:
        """Drops what its fits can compute again, as a copy of a fit has no cached residual."""
        fits = self.calibrated, self.with_effects, self.final
        self.calibrated, self.with_effects, self.final = map(replace, fits)

    def parameters(self, accepted: Accepted) -> dict[str, float]:
        """The fitted parameters and the choices of an effect, by name without its id."""
        stem = f"effects.{accepted.id}."
        values = dict(accepted.best.candidate.shape) | values_of(self.final)
        return {name.removeprefix(stem): value for name, value in values.items() if name.startswith(stem)}

    @property
    def depends_on(self) -> list[str]:
        """Ids of the quantities on which the residual depends."""
        more = self.varying.depends_on if self.varying else []
        return list(dict.fromkeys([*self.residual.depends_on, *more]))

    def as_dict(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict.word,
            "probability": round(self.verdict.probability, 6),
            "effects": [
                {
                    "class": a.ids,
                    "parameters": self.parameters(a),
                    "delta_log_evidence": round(a.log_evidence, 3),
                    "probability": round(probability(self.verdict.explanations, [a.ids]), 6),
                }
                for a in self.accepted
            ],
            "explanations": [one.as_dict() for one in self.verdict.explanations],
            "leftover": {"structured": self.residual.structured, "depends_on": self.depends_on},
            "widened": [vars(wider) for wider in self.widened],
            "rms_mm": {name: round(value, 5) for name, value in self.rms_mm.items()},
            **{name: round(value, 5) for name, value in self.floors.as_dict().items()},
            "frames": self.measurements.sessions and self.measurements.sessions.as_dict(),
            "seconds": round(self.seconds, 2),
            "conventions": [one.as_dict() for one in self.conventions],
        }


def diagnose(
    robot: Robot, measurements: Measurements, *, progress: Progress = lambda _: None, threads: int = 0
) -> Diagnosis:
    """Which effects are missing. Raises InputError where no fit is possible.

    What is found in three quarters of the runs is judged on the held-out quarter. Where nothing was found and noise
    does not explain all runs, another quarter is held out and everything begins anew; so it does without those held-out
    runs that the others turn out not to determine.
    """
    began = perf_counter()
    check_size(measurements)
    options = {"progress": progress, "threads": threads}
    robot, measurements, notices = prepared(robot, measurements)
    for turn in range(settings.TURNS):
        held_out = folds.held_out_rows(robot, measurements, turn)
        result = _diagnose(robot, measurements, held_out, **options)
        undetermined = _undetermined_groups(result)
        if undetermined:
            result.release_memory()
            held_out = folds.held_out_rows(robot, measurements, turn, undetermined)
            again = _diagnose(robot, measurements, held_out, **options)
            if again.accepted or not result.accepted:  # else the runs that showed the effect are now held out
                result = again
        if result.accepted or not result.residual.structured:
            break
    result = result.without_effects or result
    if not result.measurements.from_home:
        notices.append("taken to have been at rest at the first reading, not to have come from home: it fits better")
    result.notices += [*notices, *(wider.sentence for wider in result.widened)]
    result.seconds = perf_counter() - began
    return result


def _with_effects(robot: Robot, fit: joint.Fit, accepted: list[Accepted], fixed: dict[str, float]) -> Robot:
    """The robot as its file describes it, with the effects that were found."""
    found = fixed | {name: value for name, value in values_of(fit).items() if name.startswith("effects.")}
    return catalogue.with_values(robot, [*robot.effects, *(a.id for a in accepted)], found)


def _undetermined_groups(result: Diagnosis) -> set[int]:
    """Held-out groups that the fitted ones turned out not to determine, whatever the model."""
    fit, group = result.with_effects, folds.groups(result.measurements)
    expected = fit.expected_square[:, 0]
    usual = np.nanmean(expected[~result.held_out])
    held_out = np.unique(group[result.held_out])
    found = {k for k in held_out if np.nanmean(expected[group == k]) > settings.MOST_UNCERTAIN * usual}
    for a in result.accepted:
        effect = catalogue.get(a.id, result.robot.n_tubes)
        if "order" in effect.needs and 0 in held_out:
            found.add(0)  # how the robot came to its first row is not recorded
        for moment in effect.names_with("moment"):
            when = dict(a.best.candidate.shape)[moment]
            found |= set(group[rows_around(result.measurements, ~result.held_out, when)])
    return found


def _diagnose(robot: Robot, measurements: Measurements, held_out: Mask, progress: Progress, threads: int) -> Diagnosis:
    # Forward selection of effects on the fitted runs, each judged together with the calibration.
    noise = noise_of_readings(robot, measurements)
    engine = Engine(robot, measurements, noise, ~held_out, threads=threads, progress=progress)
    pool, not_testable = candidates(robot, measurements)
    chosen = select_effects(engine, [c for c in pool if c.id not in robot.effects])
    accepted, fit = chosen.accepted, chosen.fit
    names, fixed = parameters_of(chosen.fits)

    # Structure of the residual, corrected for a delay that varies between time segments.
    progress("structure of the residual")

    def structure(fit: joint.Fit) -> tuple[joint.Fit, list[str], Residual]:
        corrected, corrections = lags.corrected(engine, fit)
        corrections += [lags.CORRECTED] if corrections else []
        return corrected, corrections, residual_of(engine, chosen.calibrated, corrected, corrections)

    corrected, corrections, residual = structure(fit)

    # Prediction of the held-out runs without and with effects.
    progress("prediction of held-out readings")
    calibrated = with_effects = fit_to_predict(engine, chosen.calibrated, {})
    if accepted:
        with_effects = fit_to_predict(engine, fit, fixed)
        if corrections:
            with_effects, _ = lags.corrected(engine, with_effects)
    explained = explained_by_run(engine, calibrated, with_effects) if accepted else {}
    isolated = outliers.isolated(engine.measurements, with_effects, held_out)

    verdict = judge(chosen.rounds, accepted, residual, explained)
    floor_noise = fit.noise

    # A smooth field error explains many causes that have nothing to do with the field: only beside a distorted field.
    smooth = smooth_field.likeliest_noise(engine, fit) if verdict.word == "identified" else None
    if smooth is not None:
        fit = engine.fit(names, start=values_of(fit), fixed=fixed, noise=smooth, near=True)
        corrected = lags.corrected(engine, fit)[0] if corrections else fit
        with_effects = smooth_field.corrected(engine, corrected, smooth)
        corrections = [*corrections, smooth_field.message(smooth), smooth_field.CORRECTED]
        residual = residual_of(engine, chosen.calibrated, corrected, corrections)

    # What would have to vary to explain a residual that is more than noise.
    varying = None
    if residual.rejected:
        progress("parameters that are not constant")
        varying = varying_model(engine, chosen.calibrated if verdict.names_no_cause else fit, residual.sample)

    result = Diagnosis(
        robot=robot,
        measurements=engine.measurements,
        held_out=held_out,
        isolated=isolated,
        not_testable=not_testable,
        calibrated=calibrated,
        with_effects=one_sided.widened(with_effects),
        final=lags.widened(engine, one_sided.widened(fit)),
        floors=floors(_with_effects(robot, fit, accepted, fixed), measurements),
        noise_floor_mm=joint.tracker_error(with_effects, floor_noise)[0],
        rounds=chosen.rounds,
        accepted=accepted,
        residual=residual,
        varying=varying,
        verdict=verdict,
        notices=outliers.messages(robot, engine.measurements, with_effects, isolated),
    )
    if not verdict.names_no_cause:
        verdict.sentences += result.in_doubt
    if verdict.word == "not_in_catalogue" and accepted:
        plain = engine.continued(chosen.calibrated)
        _, _, residual = structure(plain)
        result.without_effects = replace(
            result,
            accepted=[],
            residual=residual,
            with_effects=one_sided.widened(calibrated),
            final=lags.widened(engine, one_sided.widened(plain)),
            floors=floors(robot, measurements),
        )
    return result
