"""The joint fit as `ctcr calibrate fit` runs it: the fit, its error on held-out readings, how far two halves agree."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ctcr import settings
from ctcr.arguments import checked
from ctcr.arrays import Array, Mask
from ctcr.audit import sensor_pose
from ctcr.calibrate import checks
from ctcr.calibrate.halves import Halves, compare_halves
from ctcr.errors import ArgumentError, InputError, Problem
from ctcr.fit import folds, joint, widening
from ctcr.fit.floors import Floors, floors
from ctcr.fit.result import Fit, rms
from ctcr.fit.sessions import placed, some_rows
from ctcr.model import fields
from ctcr.model.fields import Fitted
from ctcr.model.noise import Noise, has_field, noise_of_readings
from ctcr.model.sessions import told
from ctcr.robot import ledger
from ctcr.robot.description import Robot
from ctcr.show.output import Progress
from ctcr.show.result import Glance, Result, frame
from ctcr.show.wording import sentence
from ctcr.table.measurements import Measurements

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class Stage:
    """The error at one stage of the calibration, RMS, mean and largest; NaN where not known."""

    name: str
    rms_mm: float
    rms_deg: float = nan
    mean_mm: float = nan
    max_mm: float = nan


@dataclass(frozen=True)
class HeldOut:
    """The error of readings that were held out of the fits, and the error to be expected of a right model there."""

    kind: str  # what was kept together, runs or places (in joint space)
    fits: int  # each with other readings held out
    readings: int
    error: Stage
    floor: Stage


@dataclass(frozen=True, repr=False)
class Calibration(Result):
    """A joint fit and what is known of its worth."""

    PAGE = "calibrate.report"
    PICTURE = "calibrate.figures", "waterfall", 10.4, 4.2

    before: Robot  # as it was given
    after: Robot
    readings: Measurements
    fit: Fit
    fitted: list[Fitted]
    stages: list[Stage]  # nominal, frame alone (where more is fitted), calibrated
    held_out: HeldOut | None
    floor: Stage  # error to be expected of a right model at the fitted readings, by the noise of the fit
    floors: Floors
    halves: Halves | None
    notices: list[str]

    @cached_property
    def robot(self) -> Robot:
        """The robot with the fitted values and an entry of the ledger, as `save` writes it."""
        changes, entry, effects = _change(self)
        return ledger.changed(self.before, changes, entry, effects=effects)

    @property
    def files(self) -> list[str]:
        """The input files."""
        return [*self.before.files, *self.readings.files]

    @checked
    def save(self, path: str | Path, *, in_place: bool = False) -> Robot:
        """Writes the calibrated robot file with its entry in the ledger, and returns that robot.

        in_place    whether `path` may be the file that the robot came from
        """
        changes, entry, effects = _change(self)
        return ledger.write(self.before, path, changes, entry, effects=effects, in_place=in_place)

    def to_frame(self) -> "DataFrame":
        """A row a fitted parameter, in the unit of the robot file."""
        names = ("name", "unit", "nominal", "prior_sd", "value", "sd", "shift", "ratio", "flag")
        return frame({name: [getattr(item, name) for item in self.fitted] for name in names})

    def glance(self) -> Glance:
        stages = [*self.stages, *([self.held_out.error] if self.held_out else [])]
        rows = [[stage.name, f"{stage.rms_mm:.3f}"] for stage in stages]
        rows += [[name, f"{size:.3f}"] for name, size in self.floors.rows() if isfinite(size)]
        first, last = self.stages[0].rms_mm, self.stages[-1].rms_mm
        held = f", {self.held_out.error.rms_mm:.3g} mm held out" if self.held_out else ""
        line = f"Calibration {self.before.name}: {len(self.fitted)} parameters, {first:.3g} to {last:.3g} mm RMS{held}"
        return Glance(line, ["error", "mm RMS"], rows, [*self.doubts, *self.notices], warnings=self.readings.doubts)

    @property
    def doubts(self) -> list[str]:
        """Reasons to doubt the values, in sentences."""
        return [*checks.limits(self.fit), *fields.doubts(self.fitted)]

    @property
    def unexplained(self) -> Stage:
        """Scatter per axis by which the fit inflates the jitter: model error."""
        jitter = np.array([1e3 * self.fit.noise.position_jitter, np.degrees(self.fit.noise.rotation_jitter)])
        return Stage("unexplained", *map(float, jitter * np.sqrt(np.maximum(np.square(self.fit.inflation) - 1, 0))))

    @property
    def n_readings(self) -> int:
        """Readings that count in the fit."""
        return int(np.sum(self.fit.used))

    def rms(self, unit: str) -> dict[str, float]:
        """RMS errors by stage, `unit` being rms_mm or rms_deg; held_out and noise_floor among them."""
        values = {stage.name.replace(" ", "_"): getattr(stage, unit) for stage in self.stages}
        if self.held_out:
            values["held_out"] = getattr(self.held_out.error, unit)
        return values | {"noise_floor": getattr(self.floor, unit)}

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON."""
        fit, halves, sessions = self.fit, self.halves, self.readings.sessions
        plain = ("reduced_chi_square", "chi_square", "observations", "effective_parameters", "p_value", "converged")
        return {
            "robot": self.before.name,
            "parameters": self.fitted,
            "rms_mm": self.rms("rms_mm"),
            "rms_deg": self.rms("rms_deg"),
            "held_out": self.held_out,
            "half_data_difference": halves and {"rms_mm": halves.rms_mm, "from_noise_mm": halves.noise_mm},
            **{name: getattr(fit, name) for name in (*plain, "seconds")},
            "unexplained_scatter": {"position_mm": self.unexplained.rms_mm, "rotation_deg": self.unexplained.rms_deg},
            "correlations": [{"first": a, "second": b, "r": r} for a, b, r in fit.correlations],
            "widened": widening.widened(self.before, fit.priors.scales),
            "undetermined": [{"text": d.text, "ratio": d.ratio} for d in fit.directions],
            **self.floors.as_dict(),
            "frames": sessions and sessions.as_dict(),
            "outliers": checks.outlier_rows(fit, self.readings),
            "noise": {
                "jitter_mm": 1e3 * fit.noise.position_jitter,
                "jitter_deg": np.degrees(fit.noise.rotation_jitter),
                "field_mm": 1e3 * fit.noise.position_field,
                "field_deg": np.degrees(fit.noise.rotation_field),
            },
            "notices": [*self.doubts, *self.notices],
        }


def calibrate(
    robot: Robot,
    readings: Measurements,
    free: str | Sequence[str],
    *,
    hold_out: int | None = None,
    halves: bool = True,
    noise: str = "auto",
    sd: Mapping[str, float] | None = None,
) -> Calibration:
    """Fits the parameters named in `free`; where runs are sessions, with the frame of each in place of the robot's.

    `hold_out`: runs that are held out; None: a quarter, each in turn. `halves`: whether the fits of two halves are
    compared.
    `noise`: "jitter", "field" (with the smooth error that the tracker's accuracy figure allows), or "auto": the smaller
    one that explains the residual, the second also where it nearly does; else that with the smaller held-out error.
    `sd`: prior standard deviations by name, in the units of the robot file, that come before its `uncertainty`.
    Raises InputError where the input cannot be used: nothing measured, a frame that is metres off, a name that does
    not exist, a prior of zero width, too few rows.
    """
    floor, given = floors(robot, readings), robot
    robot, readings, notices = sensor_pose.usable(robot, readings)
    names = told(sensor_pose.with_pose(free, robot), readings)
    if not names:
        text = "the frames of the runs are fitted by themselves: name other parameters in --free too"
        raise InputError(Problem(text))
    lever = checks.start(robot, readings)
    everything = np.ones(len(readings), bool)
    frame = [name for name in names if name.startswith("tracker.")]
    few = folds.part_of(everything, settings.CROSS_VALIDATION_ROWS)
    many = np.sum(few) < len(readings)
    table, rows = some_rows(robot, readings, few) if many else (readings, everything)
    split, judged = _held_out_parts(table, lever, hold_out)
    both = folds.parts_of(table, lever, 2) if halves else None
    prior_sd = fields.in_si(sd or {}, robot)
    with Progress("fitting", 4 + len(judged) + 2 * (both is not None)) as progress:

        def fitted(only: Sequence[str], of: Measurements, chosen: Mask, **options) -> Fit:
            found = joint.fit(robot, of, only, rows=chosen, sd=prior_sd, **options)
            progress.advance(1)
            return found

        def refitted(like: Fit, chosen: Mask) -> Fit:
            options = {"noise": like.noise, "inflation": like.inflation, "scales": like.priors.scales}
            return fitted(names, table, rows & chosen, starts=1, **options)

        tried = _explaining(fitted(names, table, rows, noise=one) for one in _noises(robot, readings, noise))
        fit, held_out = tried[-1], None
        if judged:
            errors = [
                _held_out([(refitted(one, split.part != k), rows & (split.part == k)) for k in judged], split.kind)
                for one in tried
            ]
            fit, held_out = min(zip(tried, errors, strict=True), key=lambda pair: pair[1].error.rms_mm)
        pair = [refitted(fit, both.part == part) for part in range(2)] if both else []
        likely = fit
        if many:
            fit = fitted(names, readings, everything, noise=fit.noise)
        stages = [stage_of("nominal", fit.nominal_residual)]
        if frame and len(frame) < len(names):
            alone = fitted(frame, readings, few, noise=fit.noise, starts=1)
            stages.append(stage_of("frame alone", alone.residual))
    return Calibration(
        before=given,
        after=placed(fit.apply(robot), readings.sessions),
        readings=readings,
        fit=fit,
        fitted=fields.fitted(fit),
        stages=[*stages, stage_of("calibrated", fit.residual)],
        held_out=held_out,
        floor=Stage("expected error", fit.expected_mm(), fit.expected_deg()),
        floors=floor,
        halves=compare_halves(robot, table, *pair, both.kind) if pair else None,
        notices=[
            *map(sentence, notices),
            *checks.of_sensor(fit.apply(robot), fit),
            *checks.notices(robot, readings, fit, likely),
        ],
    )


def _change(c: Calibration) -> tuple[list[ledger.Change], ledger.Entry, dict[str, Any] | None]:
    """The changes of the robot file by a fit, its entry of the ledger, and the effects where they changed."""
    rms_mm = c.rms("rms_mm") | {"noise_floor": c.floors.expected_error_mm}
    figures = {"rms_mm": rms_mm, "reduced_chi_square": c.fit.reduced_chi_square}
    if np.isfinite(c.floor.rms_deg):
        figures["rms_deg"] = c.rms("rms_deg")
    wider = [one.sentence for one in widening.widened(c.before, c.fit.priors.scales)]
    entry = ledger.Entry("ctcr calibrate fit", c.readings.files, figures, " ".join([*wider, *c.doubts]))
    changes = fields.changes(c.fit, c.before, c.after)
    effects = c.after.effects if c.after.effects != c.before.effects else None
    return changes, entry, effects


def _held_out_parts(readings: Measurements, lever: float, count: int | None) -> tuple[folds.Split | None, list[int]]:
    """How the table is split, and the parts that are held out: each in turn, or `count` runs."""
    if count:
        try:
            return folds.runs_left_out(readings, count), [1]
        except InputError as error:
            raise ArgumentError(error.problems) from None
    split = folds.parts_of(readings, lever, settings.FOLDS) if count is None else None
    return split, list(range(settings.FOLDS)) if split else []


def _noises(robot: Robot, readings: Measurements, noise: str) -> list[Noise]:
    """The noises to try, the smaller first."""
    jitter, field = (noise_of_readings(robot, readings, field=wanted) for wanted in (False, True))
    smooth = has_field(field)
    return {"jitter": [jitter], "field": [field], "auto": [jitter, field] if smooth else [jitter]}[noise]


def _explaining(fits: Iterable[Fit]) -> list[Fit]:
    """The first of some fits whose noise explains the residual, or the last that nearly does; else all of them."""
    tried: list[Fit] = []
    for fit in fits:  # later ones are made only where earlier ones do not explain it
        if fit.p_value > settings.SIGNIFICANCE:
            return [fit]
        tried.append(fit)
    nearly = tried[-1].noise.position_field > 0 and tried[-1].reduced_chi_square < settings.NEARLY_EXPLAINED
    return tried[-1:] if nearly else tried


def stage_of(name: str, residual: Array) -> Stage:
    """The errors of residuals (K, 6), position [m] and rotation [rad]."""
    size = 1e3 * np.linalg.norm(residual[:, :3], axis=1)
    size = size[np.isfinite(size)]
    errors = 1e3 * rms(residual[:, :3]), float(np.degrees(rms(residual[:, 3:])))
    return Stage(name, *errors, *((float(size.mean()), float(size.max())) if len(size) else ()))


def _held_out(judged: list[tuple[Fit, Mask]], kind: str) -> HeldOut:
    """All held-out readings together: fits, each with the rows (M,) that it judges."""
    residual = np.concatenate([fit.residual[rows] for fit, rows in judged])
    expected = np.concatenate([fit.expected_square[rows] for fit, rows in judged])
    known = np.isfinite(residual[:, [0, 3]])
    floor = [rms(np.sqrt(expected[:, [i]]), known[:, i]) for i in range(2)]
    floor = Stage("expected error", 1e3 * floor[0], float(np.degrees(floor[1])))
    return HeldOut(kind, len(judged), int(known[:, 0].sum()), stage_of("held out", residual), floor)
