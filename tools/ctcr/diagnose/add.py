"""Effects put into a robot, fitted together with its calibration, and taken out again: `ctcr add` and `remove`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ctcr import settings
from ctcr.arguments import checked
from ctcr.arrays import Array, Mask
from ctcr.audit import prepared
from ctcr.calibrate.joint_fit import Stage, stage_of
from ctcr.diagnose import lags, outliers, smooth_field
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.held_out import check_size, fit_to_predict
from ctcr.diagnose.round import linearised_end, screen
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem, suggestion
from ctcr.fit import folds, joint, one_sided
from ctcr.fit.floors import Floors, floors, warnings
from ctcr.fit.sessions import placed
from ctcr.fit.widening import widened
from ctcr.model import fields
from ctcr.model.noise import noise_of_readings
from ctcr.model.sessions import as_given
from ctcr.robot import history, ledger
from ctcr.robot.description import Robot
from ctcr.robot.ledger import Change, Entry
from ctcr.show.output import Progress
from ctcr.show.result import Glance, Result, frame, picture
from ctcr.show.wording import deviation, number, sentence
from ctcr.table.measurements import Measurements

if TYPE_CHECKING:
    from pandas import DataFrame

    from ctcr.show.style import Picture


@dataclass(frozen=True, repr=False)
class Added(Result):
    """Effects fitted to measurements."""

    PAGE: ClassVar[str] = "diagnose.add_report"

    before: Robot  # as it was given
    after: Robot  # with them
    readings: Measurements  # as they were fitted
    ids: list[str]
    fit: joint.Fit  # of all rows
    stages: list[Stage]  # nominal, calibrated, each effect; `noise_floor`: the tracker's error. Of the judged rows
    held_out: str  # judged runs or blocks of time; empty: the fitted rows were judged
    notices: list[str]
    floors: Floors

    @property
    def files(self) -> list[str]:
        """Of the robot and of the measurements."""
        return [*self.before.files, *self.readings.files]

    def parameters(self) -> dict[str, dict[str, float]]:
        """Value and standard deviation of every fitted parameter of an effect, SI."""
        return {
            name: {"value": float(value), "sd": float(sd)}
            for name, value, sd in zip(self.fit.names, self.fit.values, self.fit.sd, strict=True)
            if name.startswith("effects.")
        }

    def rms(self, unit: str) -> dict[str, float]:
        """By stage; `unit` is rms_mm or rms_deg."""
        return {stage.name: getattr(stage, unit) for stage in self.stages}

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON."""
        return {
            "added": self.ids,
            "effects": self.after.effects,
            "parameters": self.parameters(),
            "rms_mm": self.rms("rms_mm"),
            "rms_deg": self.rms("rms_deg"),
            "held_out": self.held_out,
            **self.floors.as_dict(),
            "frames": self.readings.sessions and self.readings.sessions.as_dict(),
            "reduced_chi_square": self.fit.reduced_chi_square,
            "converged": self.fit.converged,
            "widened": widened(self.after, self.fit.priors.scales),
            "notices": self.notices,
        }

    @cached_property
    def robot(self) -> Robot:
        """The robot with the effects and an entry of the ledger, as `save` writes it."""
        changes, entry = _change(self)
        return ledger.changed(self.before, changes, entry, effects=self.after.effects)

    @checked
    def save(self, path: str | Path, *, in_place: bool = False) -> Robot:
        """Writes the robot with its effects and an entry of the ledger, and returns that robot.

        in_place    whether `path` may be the file that the robot came from
        """
        changes, entry = _change(self)
        return ledger.write(self.before, path, changes, entry, effects=self.after.effects, in_place=in_place)

    def plot(self) -> "Picture":
        """The error after each step, a matplotlib figure; `savefig` writes it."""
        return picture(history.draw_waterfall, self.steps, 10.4, 4.4)

    def to_frame(self) -> "DataFrame":
        """A row a fitted parameter of an effect, SI."""
        known, found = catalogue.parameter_of(self.before.n_tubes), self.parameters()
        columns: dict[str, list] = {"name": [*found], "unit": [known[name].unit for name in found]}
        return frame(columns | {key: [one[key] for one in found.values()] for key in ("value", "sd")})

    def glance(self) -> Glance:
        known = catalogue.parameter_of(self.before.n_tubes)
        rows = [
            [name.removeprefix("effects."), known[name].unit, number(one["value"], one["sd"]), deviation(one["sd"])]
            for name, one in self.parameters().items()
        ]
        errors = [f"{step.name}: {step.rms_mm:.3f} mm RMS" for step in self.steps]
        steps = self.rms("rms_mm")
        fall = f"{steps['calibrated']:.3g} to {steps[self.ids[-1]]:.3g} mm RMS"
        line = f"Added {', '.join(self.ids)} to {self.before.name}: {fall}"
        notes = [*errors, *self.notices]
        return Glance(line, ["fitted (SI)", "unit", "value", "sd"], rows, notes, 2, self.readings.doubts)

    @property
    def steps(self) -> list[history.Stage]:
        """The error of each step from the robot file on, the expected error last."""
        found = [("robot file", self.stages[0].rms_mm)]
        found += [(stage.name.replace("_", " "), stage.rms_mm) for stage in self.stages[1:-1]]
        found.append((history.FLOOR, self.floors.expected_error_mm))
        return [history.Stage(name, size, "") for name, size in found]


def add(
    robot: Robot,
    readings: Measurements,
    ids: Sequence[str],
    *,
    fixed: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    free: str | Sequence[str] = "standard",
) -> Added:
    """Fits the effects `ids` to the readings, jointly with the parameters `free` and the effects that the robot has.

    The amplitudes of each effect are fitted first, then its shape too, also from the starts that a linearised search
    finds. `fixed` parameters, by full name in SI, keep their value, those of `start` begin at it. One of four runs (or
    blocks of time, where there are few runs) is held out of the fits that give the errors; the values are those of a
    fit to all rows. Raises InputError where no fit is possible.
    """
    check_size(readings)
    given, unchanged, (robot, readings, said) = readings, robot, prepared(robot, readings)
    fixed = dict(fixed or {})
    robot = catalogue.with_values(robot, [*robot.effects, *ids], dict(start or {}) | fixed)
    fitted = [identity for identity in robot.effects if identity not in ids]
    before = robot.with_effects({identity: robot.effects[identity] for identity in fitted})
    held_out, everything = folds.held_out_rows(before, readings), np.ones(len(readings), bool)
    with Progress("fitting", 2 * len(ids) + 2) as progress:
        stage = _Fitter(robot, readings, free, fixed)
        now, nominal = stage.values(), stage.nominal(fitted)
        fit = stage(fitted, fitted, ~held_out, [now])
        progress.advance(1)
        errors = {"nominal": nominal, "calibrated": fit.residual}
        for identity in ids:
            fitted.append(identity)
            begun = set(catalogue.get(identity, robot.n_tubes).names()) & {*fixed, *(start or {})}
            elsewhere = [] if begun else [now | values for values in stage.starts(identity, fit, fitted)]
            now |= values_of(fit)
            fit = stage(fitted, fitted[:-1], ~held_out, [now])
            progress.advance(1)
            now |= values_of(fit)
            if stage.shapes(identity):
                fit = stage(fitted, fitted, ~held_out, [*elsewhere, now])
            progress.advance(1)
            errors[identity] = fit.residual
        isolated = outliers.isolated(readings, fit, held_out)
        judged = held_out & ~isolated if held_out.any() else everything
        stages = [stage_of(name, residual[judged]) for name, residual in errors.items()]
        about_outliers = [sentence(text) for text in outliers.messages(stage.robot, readings, fit, isolated)]
        if held_out.any():
            fit = stage(fitted, fitted, everything, [now | values_of(fit)])
        progress.advance(1)
    corrected, nuisances = lags.corrected(stage.engine, fit)
    explained = stage.explained or (bool(nuisances) and not joint.rejects(corrected))
    if (smooth := smooth_field.likeliest_noise(stage.engine, fit)) is not None:
        nuisances.append(smooth_field.message(smooth))
    fit = lags.widened(stage.engine, one_sided.widened(fit))
    useless = _not_lowered(stages[1:]) if held_out.any() else []
    stages.append(Stage("noise_floor", *joint.tracker_error(fit, fit.noise)))
    notices = [*map(sentence, said), *about_outliers, *useless, *_notices(robot, fit, ids, explained), *nuisances]
    after, name = fit.apply(stage.robot), folds.named(readings, held_out)
    floor = floors(robot.with_effects(after.effects), given)
    after = placed(after, readings.sessions)
    return Added(unchanged, after, readings, list(ids), fit, stages, name, notices, floor)


def _change(added: Added) -> tuple[list[Change], Entry]:
    """The changes of the robot file beside its effects, and the entry of the ledger."""
    before = added.before
    changes = fields.changes(added.fit, before, added.after)
    rms_mm = added.rms("rms_mm") | {"noise_floor": added.floors.expected_error_mm}
    figures: dict[str, Any] = {"added": added.ids, "rms_mm": rms_mm}
    if np.isfinite([stage.rms_deg for stage in added.stages]).all():
        figures["rms_deg"] = added.rms("rms_deg")
    figures |= {"held_out": added.held_out, "parameters": added.parameters(), "effects_before": before.effects}
    return changes, Entry(f"ctcr add {' '.join(added.ids)}", added.readings.files, figures, " ".join(added.notices))


def write_values(before: Robot, after: Robot, ids: Sequence[str], target: str | Path, in_place: bool = False) -> Robot:
    """Writes the robot with effects whose values were given, not fitted."""
    figures = {"added": list(ids), "effects_before": before.effects}
    entry = Entry(f"ctcr add {' '.join(ids)}", [], figures, "Values as given, not fitted.")
    return ledger.write(before, target, [], entry, effects=after.effects, in_place=in_place)


def remove(robot: Robot, ids: Sequence[str], target: str | Path, in_place: bool = False) -> tuple[Robot, list[str]]:
    """Writes the robot without these effects; returns it and notices.

    Values that were fitted together with them go back to what they were, where nothing has changed them since and no
    other effect that the robot keeps was added with them. Raises InputError for effects that it does not have.
    """
    absent = [identity for identity in ids if identity not in robot.effects]
    if absent:
        hint = suggestion(absent[0], robot.effects, f"it has {', '.join(robot.effects) or 'none'}")
        raise InputError(Problem(f"the robot has no effect {absent[0]}: {hint}"))
    section = {name: given for name, given in robot.effects.items() if name not in ids}
    changes, notices = [], []
    for entry in reversed(robot.history):
        figures = entry.get("figures") or {}
        with_it = figures.get("added") or []
        if not set(with_it) & set(ids):
            continue
        if not set(with_it) <= set(ids):
            notices.append(f"{', '.join(with_it)} were fitted together: fit the others again with ctcr add --fit")
            continue
        undone, kept = _undone(robot, entry)
        changes += [change for change in undone if change.path not in {other.path for other in changes}]
        if kept:
            notices.append(f"{kept} values of the calibration were changed since and stay: fit them again")
        earlier = figures.get("effects_before") or {}
        section = {name: earlier.get(name, given) for name, given in section.items()}
    entry = Entry(f"ctcr remove {' '.join(ids)}", [], {"removed": list(ids)}, " ".join(notices))
    return ledger.write(robot, target, changes, entry, effects=section, in_place=in_place), notices


def _undone(robot: Robot, entry: Mapping[str, Any]) -> tuple[list[Change], int]:
    """The changes that restore the values before an entry, and how many cannot be restored."""
    changes, kept = [], 0
    for row in entry.get("changes") or []:
        path = _path(str(row.get("field", "")))
        try:
            now = fields.value_at(robot, path)
        except (AttributeError, IndexError, TypeError, KeyError):
            kept += 1
            continue
        if "old" not in row or now != row.get("new"):
            kept += 1
        else:
            changes.append(Change(path, str(row.get("unit", "")), row["old"]))
    return changes, kept


def _path(text: str) -> tuple[str | int, ...]:
    """tubes[0].length_mm as ("tubes", 0, "length_mm")."""
    return tuple(int(part) if part.isdigit() else part for part in re.split(r"[.\[\]]+", text) if part)


class _Fitter:
    """Fits of one recording with more and more parameters free."""

    def __init__(self, robot: Robot, readings: Measurements, free: str | Sequence[str], fixed: Mapping[str, float]):
        self.robot, self.fixed = robot, fixed
        self.engine = Engine(robot, readings, noise_of_readings(robot, readings), readings.measured, free=free)

    def shapes(self, identity: str) -> list[str]:
        return [name for name in catalogue.get(identity, self.robot.n_tubes).shapes if name not in self.fixed]

    def values(self) -> dict[str, float]:
        """Nominal values of all parameters."""
        known = [*self.engine.base, *catalogue.value_of(self.robot)]
        return dict(zip(known, self.engine.recording(known).nominal().tolist(), strict=True))

    def nominal(self, ids: Sequence[str]) -> Array:
        """Residuals (M, 6) at nominal values, with these effects alone."""
        self.engine.robot = self._with(ids)
        recorded = as_given(self.engine.recording([]))
        return recorded.residual(recorded.nominal())[0].reshape(-1, 6)

    def _with(self, ids: Sequence[str]) -> Robot:
        return self.robot.with_effects({identity: self.robot.effects[identity] for identity in ids})

    def __call__(
        self, ids: Sequence[str], shaped: Sequence[str], rows: Mask, starts: Sequence[Mapping[str, float]]
    ) -> joint.Fit:
        """Fits the amplitudes of the effects `ids`, and the shapes of `shaped`, to rows (M,) from the best start."""
        engine = self.engine
        engine.robot, engine.rows = self._with(ids), rows
        known = [catalogue.get(identity, self.robot.n_tubes) for identity in ids]
        own = [name for effect in known for name in effect.amplitudes if name not in self.fixed]
        own += [name for identity in shaped for name in self.shapes(identity)]
        likely = engine.fit_with_field(own, self._best(own, starts))
        if any("order" in effect.needs for effect in known) and engine.revise_initial_history(likely):
            likely = engine.fit_with_field(own, values_of(likely))
        self.explained = not joint.rejects(likely)
        # Values under the noise that predicts best, uncertainty under the likeliest noise.
        fit = fit_to_predict(engine, likely, {}, tolerance=engine.tolerance)
        return replace(fit, sd=np.maximum(fit.sd, likely.sd), ratio=np.maximum(fit.ratio, likely.ratio))

    def starts(self, identity: str, before: joint.Fit, ids: Sequence[str]) -> list[dict[str, float]]:
        """Starts of an effect by a search that is linearised at the fit before, over all rows.

        A choice, such as the moment of a jump, is taken over at once: no fit finds it.
        """
        engine = self.engine
        engine.robot, engine.rows = self._with(ids), np.ones(len(engine.measurements), bool)
        usual, _ = candidates(engine.robot, engine.measurements)
        plain = [one for one in usual if one.id == identity and not one.shape]
        found = []
        # Readings of a contact look like outliers: with and without down-weighting.
        for weights in (None, np.ones((len(engine.measurements), 2))):
            there = engine.linear_fit(before, weights=weights)
            screened = [one for one in screen(*engine.thinned(there), plain, {}) if one.candidate.shape]
            found += [(one, linearised_end(engine, there, one)) for one in screened[: settings.ADDED_STARTS]]
        if found:
            choices = catalogue.get(identity, self.robot.n_tubes).of_kind("choice")
            chosen = {name: x for name, x in found[0][0].candidate.shape if name in choices}
            self.robot = catalogue.with_values(self.robot, [identity], chosen)
        return [start for _, start in found]

    def _best(self, own: Sequence[str], starts: Sequence[Mapping[str, float]]) -> dict[str, float]:
        """The best of all starts for these parameters of effects."""
        first, *others = [dict(values) for values in starts]
        if not others:
            return first
        fit = self.engine.fit(own, start=first, near=True, tolerance=settings.COARSE)
        fits = [fit, *(self.engine.fit_like(fit, own, other, tolerance=settings.COARSE) for other in others)]
        return values_of(max(fits, key=lambda tried: tried.log_evidence))


def _not_lowered(stages: Sequence[Stage]) -> list[str]:
    """The effects with which the error on held-out readings is no smaller than at the stage before."""
    return [
        f"{after.name} does not lower the error on held-out readings: {before.rms_mm:.3f} mm without it, "
        f"{after.rms_mm:.3f} mm with it."
        for before, after in pairwise(stages)
        if after.rms_mm >= before.rms_mm
    ]


def _notices(robot: Robot, fit: joint.Fit, ids: Sequence[str], explained: bool) -> list[str]:
    """Doubts about the fitted effects; `explained`: whether the noise explains the residual."""
    known = catalogue.parameter_of(robot.n_tubes)
    said = [wider.sentence for wider in widened(robot, fit.priors.scales)]
    said += [*([] if fit.converged else [f"The fit has {fit.status}."]), *map(sentence, warnings(fit, explained))]
    values, sds, ratios = (dict(zip(fit.names, of, strict=True)) for of in (fit.values, fit.sd, fit.ratio))
    for identity in ids:
        effect = catalogue.get(identity, robot.n_tubes)
        mine = [name for name in effect.amplitudes if name in values]
        if mine and all(ratios[name] > settings.UNDETERMINED for name in mine):
            said.append(f"The data do not determine {identity}: {effect.measure}".rstrip())
        elif mine and all(abs(values[name]) < 2 * sds[name] for name in mine):
            said.append(f"{identity} is not larger than its uncertainty: these data do not need it.")
        for name in effect.names():
            low, high = known[name].soft
            if name in values and not low <= values[name] <= high:
                said.append(
                    f"{name} = {values[name]:.3g} is hardly physical ({low:g} to {high:g} is usual): the effect may "
                    "imitate another one."
                )
    return said
