"""The joint fit as `ctcr calibrate fit` runs it: the fit, its error on readings not seen, how far two halves agree."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr import settings
from ctcr.audit import sensor_roll
from ctcr.calibrate import checks
from ctcr.calibrate.halves import Halves, compare_halves
from ctcr.fit import joint
from ctcr.fit.folds import Split, parts_of, runs_left_out
from ctcr.fit.run_frames import fit_with_frames
from ctcr.model import fields
from ctcr.model.fields import Fitted
from ctcr.model.noise import noise_of_readings
from ctcr.robot import ledger
from ctcr.robot.description import Robot
from ctcr.show.output import Progress
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]


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
    """The error of readings that the fits did not see, and the noise floor of the same readings."""

    kind: str  # what was kept together, runs or places
    fits: int  # each with other readings left out
    readings: int
    error: Stage
    floor: Stage


@dataclass(frozen=True)
class Calibration:
    """A joint fit and what is known of its worth."""

    before: Robot
    after: Robot
    readings: Measurements
    fit: Any  # that to use: where the model lacks something, with unexplained scatter in the noise
    fitted: list[Fitted]
    stages: list[Stage]  # nominal, frame alone (where more is fitted), calibrated
    held_out: HeldOut | None
    floor: Stage  # what the noise makes of the fitted readings
    halves: Halves | None
    frames: Any  # RunFrames, or None
    notices: list[str]

    @property
    def unexplained(self) -> Stage:
        """Scatter per axis beside the stated noise: what the model cannot explain."""
        jitter = np.array([1e3 * self.fit.noise.position_jitter, np.degrees(self.fit.noise.rotation_jitter)])
        return Stage("unexplained", *map(float, jitter * np.sqrt(np.maximum(np.square(self.fit.inflation) - 1, 0))))

    @property
    def n_readings(self) -> int:
        """Readings that count in the fit."""
        return int(np.sum(self.fit.used))

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON."""
        fit = self.fit
        return {
            "robot": self.before.name,
            "parameters": [asdict(parameter) for parameter in self.fitted],
            "rms_mm": rms(self, "rms_mm"),
            "rms_deg": rms(self, "rms_deg"),
            "held_out": asdict(self.held_out) if self.held_out else None,
            "half_data_difference": self.halves
            and {"rms_mm": self.halves.rms_mm, "from_noise_mm": self.halves.noise_mm},
            "reduced_chi_square": fit.reduced_chi_square,
            "chi_square": fit.chi_square,
            "observations": fit.observations,
            "effective_parameters": fit.effective_parameters,
            "unexplained_scatter": {"position_mm": self.unexplained.rms_mm, "rotation_deg": self.unexplained.rms_deg},
            "correlations": [{"first": a, "second": b, "r": r} for a, b, r in fit.correlations],
            "undetermined": [{"text": d.text, "ratio": d.ratio} for d in fit.directions],
            "frames": self.frames and self.frames.as_dict(),
            "outliers": checks.outlier_rows(fit, self.readings),
            "noise": {
                "jitter_mm": 1e3 * fit.noise.position_jitter,
                "jitter_deg": np.degrees(fit.noise.rotation_jitter),
                "field_mm": 1e3 * fit.noise.position_field,
                "field_deg": np.degrees(fit.noise.rotation_field),
            },
            "p_value": fit.p_value,
            "converged": fit.converged,
            "seconds": fit.seconds,
            "notices": self.notices,
        }


def rms(c: Calibration, unit: str) -> dict[str, float]:
    """RMS errors by stage, `unit` being rms_mm or rms_deg; held_out and noise_floor among them."""
    values = {stage.name.replace(" ", "_"): getattr(stage, unit) for stage in c.stages}
    if c.held_out:
        values["held_out"] = getattr(c.held_out.error, unit)
    return values | {"noise_floor": getattr(c.floor, unit)}


def calibrate(
    robot: Robot,
    readings: Measurements,
    free: Sequence[str],
    *,
    frame_per_run: bool = False,
    hold_out: int | None = None,
    halves: bool = True,
    noise: str = "auto",
    sd: Mapping[str, float] | None = None,
) -> Calibration:
    """Fits the parameters named in `free`.

    `noise`: "jitter", "field" (with the smooth error that the tracker's accuracy figure allows), or "auto": the smaller
    one that explains the residual, the second also where it nearly does; else that with the smaller held-out error.
    `sd`: prior standard deviations by name, in the units of the robot file, that come before its `uncertainty`.
    Raises InputError where the input cannot be used: nothing measured, a frame that is metres off, a name that does
    not exist, a prior of zero width, too few rows.
    """
    robot, readings, notices = sensor_roll.usable(robot, readings)
    names = sensor_roll.with_roll(list(free), robot)
    lever = checks.start(robot, readings)
    usable, repeated = checks.usable_rows(readings)
    frame = [name for name in names if name.startswith("tracker.")]
    if frame_per_run:
        names = [name for name in names if name not in frame or name == sensor_roll.NAME]
    parts = _held_out_split(readings, lever, hold_out)
    judged = range(parts.parts) if parts else []
    if hold_out or len(readings) > settings.CROSS_VALIDATION_ROWS:
        judged = judged[1:2]
    both = parts_of(readings, lever, 2) if halves else None
    engine = _engine(robot, readings, usable, frame_per_run, fields.in_si(sd or {}, robot))
    with Progress("fitting", 3 + len(judged) + 2 * (both is not None)) as progress:

        def fitted(only: Sequence[str], **options):
            found = engine(only, **options)
            progress.advance(1)
            return found

        fit, held_out = _chosen(fitted, names, _noises(robot, readings, noise), parts, judged, usable)
        alone = None
        if frame and len(frame) < len(names) and not frame_per_run:
            alone = fitted(frame, noise=fit.noise, starts=1)
        pair = [fitted(names, rows=both.part == part, **_as_in(fit)) for part in range(2)] if both else []
    after = fit.apply(robot)
    stages = [_stage("nominal", fit.nominal_residual[usable])]
    if alone is not None:
        stages.append(_stage("frame alone", alone.residual[usable]))
    stages.append(_stage("calibrated", fit.residual[usable]))
    return Calibration(
        before=robot,
        after=after,
        readings=readings,
        fit=fit,
        fitted=fields.fitted(fit),
        stages=stages,
        held_out=held_out,
        floor=Stage("noise floor", fit.expected_mm(usable), fit.expected_deg(usable)),
        halves=compare_halves(robot, readings, *pair, both.kind) if pair else None,
        frames=fit.frames,
        notices=[*map(checks.sentence, notices), *repeated, *checks.notices(after, readings, fit, frame_per_run)],
    )


def write_robot(c: Calibration, target: str | Path, measurements: str | Path, in_place: bool = False) -> Robot:
    """Writes the calibrated robot file with its entry in the ledger."""
    figures = {"rms_mm": rms(c, "rms_mm"), "reduced_chi_square": c.fit.reduced_chi_square}
    if np.isfinite(c.floor.rms_deg):
        figures["rms_deg"] = rms(c, "rms_deg")
    entry = ledger.Entry("ctcr calibrate fit", [measurements], figures, " ".join(fields.doubts(c.fitted)))
    return ledger.write(
        c.before,
        target,
        fields.changes(c.fit, c.before, c.after),
        entry,
        effects=c.after.effects if c.after.effects != c.before.effects else None,
        in_place=in_place,
    )


def _engine(robot: Robot, readings: Measurements, usable: Array, frame_per_run: bool, sd: Mapping[str, float]):
    """fit(names, rows=, ..): the plain fit, or that with a frame for every run."""

    def fit(names: Sequence[str], rows: Array | None = None, **options):
        kept = usable if rows is None else usable & rows
        if frame_per_run:
            return fit_with_frames(robot, readings, names, kept, sd=sd, **options)
        return joint.fit(robot, readings, free=list(names), rows=kept, sd=sd, **options)

    return fit


def _noises(robot: Robot, readings: Measurements, noise: str) -> list:
    """The noises to try, the smaller first."""
    jitter, field = (noise_of_readings(robot, readings, field=wanted) for wanted in (False, True))
    smooth = field.position_field > 0 or field.rotation_field > 0
    return {"jitter": [jitter], "field": [field], "auto": [jitter, field] if smooth else [jitter]}[noise]


def _chosen(fitted, names: Sequence[str], noises: list, parts: Split | None, judged: Sequence[int], usable: Array):
    """The fit with the noise to use, and its error on the parts that are left out in turn."""
    tried = []
    for noise in noises:
        tried.append(fitted(names, noise=noise))
        near = (
            noise is noises[-1]
            and noise.position_field > 0
            and tried[-1].reduced_chi_square < settings.NEARLY_EXPLAINED
        )
        if tried[-1].p_value > settings.SIGNIFICANCE or near:
            tried = tried[-1:]
            break
    if not judged:
        return tried[-1], None
    held_out = []
    for fit in tried:
        folds = [(fitted(names, rows=parts.part != part, **_as_in(fit)), parts.part == part) for part in judged]
        held_out.append(_held_out(folds, parts.kind, usable))
    best = min(range(len(tried)), key=lambda i: held_out[i].error.rms_mm)
    return tried[best], held_out[best]


def _as_in(fit) -> dict[str, Any]:
    """Options of a fit to a part of the rows, with the noise of the whole."""
    return {"noise": fit.noise, "inflation": fit.inflation, "starts": 1}


def _held_out_split(readings: Measurements, lever: float, hold_out: int | None) -> Split | None:
    if hold_out == 0:
        return None
    return runs_left_out(readings, hold_out) if hold_out else parts_of(readings, lever, settings.FOLDS)


def _stage(name: str, residual: Array) -> Stage:
    """Of residuals (K, 6), position [m] and rotation [rad]."""
    position, rotation = (np.linalg.norm(part, axis=1) for part in (residual[:, :3], residual[:, 3:]))
    position, rotation = (1e3 * position[np.isfinite(position)], np.degrees(rotation[np.isfinite(rotation)]))
    rms = [float(np.sqrt(np.mean(part**2))) if len(part) else nan for part in (position, rotation)]
    return Stage(name, *rms, *((float(position.mean()), float(position.max())) if len(position) else ()))


def _held_out(folds: list, kind: str, usable: Array) -> HeldOut:
    """All held-out readings together."""
    seen = [(fit.residual[rows & usable], fit.expected_square[rows & usable]) for fit, rows in folds]
    residual, expected = (np.concatenate([pair[i] for pair in seen]) for i in range(2))
    known = np.isfinite(residual[:, [0, 3]])
    floor = [float(np.sqrt(np.mean(expected[known[:, i], i]))) if known[:, i].any() else nan for i in range(2)]
    return HeldOut(
        kind,
        len(folds),
        int(known[:, 0].sum()),
        _stage("held out", residual),
        Stage("noise floor", 1e3 * floor[0], float(np.degrees(floor[1]))),
    )
