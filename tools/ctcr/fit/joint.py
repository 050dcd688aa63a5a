"""The joint fit: any parameters, all together, to a table of readings.

It maximises the posterior density: normal priors within bounds, normal readings with the tracker's jitter and smooth
field error, robust weights for outliers, and inflated jitter where the model misses what the noise cannot explain. The
Laplace approximation about the maximum gives covariance and log marginal likelihood. Positions are in m, rotations in
rad, tracker axes; residuals are measured - predicted: position, then rotation vector.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ctcr import _core, settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.audit import sensor_pose
from ctcr.errors import InputError, Problem
from ctcr.fit import folds, one_sided
from ctcr.fit.result import Fit, Priors, rms
from ctcr.fit.widening import Likelihood, Scales
from ctcr.frames import base_to_tracker
from ctcr.model import recording, user_recording
from ctcr.model.noise import Noise, has_field, noise_of_readings, with_field
from ctcr.model.protocol import LinearModel, ResidualModel
from ctcr.model.sessions import told
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show.wording import counted, listed
from ctcr.table.measurements import Measurements


class NoFit(InputError):
    """No fit is possible: the model has no solution where it starts."""


@dataclass(frozen=True)
class FitOptions:
    """How a fit is made."""

    start: Array | None = None  # (n,); the priors' mean by default
    weights: Array | None = None  # (M, 2) robust ones of another fit; by default outliers are found. 0: not fitted
    first_weights: Array | None = None  # (M, 2) from which the search for outliers starts
    inflation: ArrayLike | None = None  # (2,) of another fit; by default estimated from errors of the model.
    scales: Scales | None = None  # of another fit, on the stated uncertainties; by default those of most evidence.
    # Log evidences of models can be compared at the same weights, inflation and scales.
    starts: int = 1  # that are compared, all but the first drawn from the priors
    row: Integers | None = None  # (M,) of the table, to name them; by default from 1
    max_iterations: int = settings.ITERATIONS
    tolerance: float = settings.TOLERANCE  # of log evidence


def fit(
    robot: Robot,
    measurements: Measurements,
    free: str | Iterable[str] = "standard",
    *,
    rows: Mask | None = None,
    sd: Mapping[str, float] | None = None,
    noise: Noise | None = None,
    positions: Array | None = None,
    starts: int = settings.STARTS,
    **options: Any,
) -> Fit:
    """Fits the named parameters (see `parameters.expand`) to the readings, given the robot file's priors.

    rows     (M,) readings to fit, all by default; the others are judged with the result. Split by run, never by row.
    sd       {name: prior standard deviation in SI, or math.inf} over the file's `uncertainty`
    noise    of the tracker; `noise_of_readings` by default. What is uncertain of the sensor's pose is always free
    positions  (M, 3) [m] of the sensor, tracker frame, of another fit; by default those that the fit predicts
    starts   that are compared, all but the first drawn from the priors
    options  weights, inflation, scales and tolerance, as in `FitOptions`
    Raises NoFit where none is possible.
    """
    began = perf_counter()
    robot, measurements, said = sensor_pose.usable(robot, measurements)
    names = told(sensor_pose.with_pose(free, robot), measurements)
    noise = noise or noise_of_readings(robot, measurements)
    chosen = np.ones(len(measurements), bool) if rows is None else np.asarray(rows, dtype=bool)
    rows = measurements.measured & chosen
    at = sensor_positions(robot, measurements) if positions is None else positions
    priors = Priors.of(robot, names, measurements.beta[chosen], sd)
    steps = recording.steps_for(robot, measurements, noise)
    options["row"] = measurements.row

    def model() -> ResidualModel:
        return user_recording.recording_of(robot, measurements, names, steps=steps)

    def fit_from(start: Array, like: Fit | None = None, starts: int = 1) -> Fit:
        table, how = model(), options | {"start": start, "starts": starts, "positions": at}
        if like:
            table.begin_at(like.model)
            how |= like.frozen
        return fit_joint(table, priors, noise, rows=rows, **how)

    start, priors = _with_frame(model(), priors, noise, at, rows, **options)
    fitted = fit_from(start, starts=starts)
    if positions is None and has_field(noise):
        at = fitted.predicted_positions()
        near = options | {"start": fitted.values, "first_weights": fitted.weights, "few_first": False}
        fitted = replace(fit_joint(fitted.model, priors, noise, at, rows, **near), starts=fitted.starts)
    fitted = one_sided.widened(one_sided.restarted(fitted, fit_from))
    warnings = [*said, *_table_warnings(measurements, rows), *fitted.warnings]
    return replace(fitted, warnings=warnings, seconds=perf_counter() - began)


def fit_joint(
    model: ResidualModel,
    priors: Priors,
    noise: Noise,
    positions: Array,
    rows: Mask | None = None,
    *,
    few_first: bool = True,
    **options: Any,
) -> Fit:
    """Fits a model to its readings, where the sensor's `positions` (M, 3) [m], tracker frame, say how its field errors
    are related: best as predicted, see Fit.predicted_positions().

    rows       (M,) that are fitted, all by default
    few_first  whether, of many rows, fits to a few find the start and compare the starts
    options    those of FitOptions
    Raises NoFit where none is possible.
    """
    how, arguments = FitOptions(**options), (model, priors, noise, positions)
    rows = np.ones(len(positions), bool) if rows is None else rows
    if how.weights is not None:
        rows = rows & (how.weights > 0).any(axis=1)
    *parts, rows = folds.growing(rows) if few_first else [rows]
    compared = None
    for part in parts:
        model.activate(part.tolist())
        fitted = _fit_widened(*arguments, replace(how, tolerance=settings.COARSE))
        how = replace(how, start=fitted.values, starts=1, scales=fitted.priors.scales)
        compared = compared or fitted.starts
    model.activate(rows.tolist())
    if parts and how.weights is None:
        residual = np.where(rows[:, None], model.residual(how.start)[0].reshape(-1, 6), nan)
        how = replace(how, first_weights=_still(residual, noise, positions, inflation=how.inflation).weights)
    fitted = _fit_widened(*arguments, how)
    return replace(fitted, starts=compared or fitted.starts)


def _fit_widened(model: ResidualModel, priors: Priors, noise: Noise, positions: Array, how: FitOptions) -> Fit:
    """Like fit_joint(), on the active rows. It widens stated uncertainties that the readings contradict. Wider priors
    change the fit, so fits and scales alternate until the log evidence gains little."""
    if how.scales is not None:
        priors = replace(priors, scales=how.scales)
    fit = _fit_active(model, priors, noise, positions, how)
    for _ in range(settings.WIDENINGS if how.scales is None and any(priors.groups) else 0):
        likelihood = Likelihood.of(fit)
        scales = likelihood.likeliest()
        if likelihood.posterior(scales) - likelihood.posterior(fit.priors.scales) < settings.COARSE:
            break
        again = replace(how, start=fit.values, starts=1, first_weights=fit.weights)
        refitted = _fit_active(model, replace(priors, scales=scales), noise, positions, again)
        if refitted.log_evidence < fit.log_evidence:
            break
        fit = replace(refitted, starts=fit.starts)
    return fit


def _fit_active(model: ResidualModel, priors: Priors, noise: Noise, positions: Array, how: FitOptions) -> Fit:
    """Like fit_joint(), on the active rows with the priors as they are. With distributed friction the friction path
    depends on the parameters, so fits and solutions of the path alternate until the path hardly changes."""
    began, starts = perf_counter(), how.starts
    start = np.asarray(priors.mean if how.start is None else how.start, dtype=float)
    try:
        moved = model.solve_friction(start)
        evidence, found, few = -np.inf, how.first_weights, settings.FRICTION_PATH_ITERATIONS
        alternates = moved > 0 and how.tolerance < settings.COARSE
        for left in reversed(range(settings.FRICTION_PATH_ROUNDS if alternates else 1)):
            to_the_end = not left or moved < settings.FRICTION_PATH_CHANGE
            core, excluded = _core.identify(
                predict=model if isinstance(model, _core.Recording) else _as_function(model),
                names=priors.names,
                mean=priors.mean,
                sd=priors.sd,
                low=priors.low,
                high=priors.high,
                known=list(priors.gauges),
                within=list(priors.limits),
                correlations=priors.correlations,
                noise=noise,
                positions=np.asarray(positions, dtype=float),
                weights=how.weights,
                inflation=None if how.inflation is None else np.asarray(how.inflation, dtype=float),
                start=start,
                first_weights=found,
                starts=starts,
                max_iterations=how.max_iterations if to_the_end else min(how.max_iterations, few),
                tolerance=how.tolerance if to_the_end else max(how.tolerance, settings.COARSE),
            )
            start, starts, found = core.values, 1, core.weights
            gained, evidence = core.log_evidence - evidence, core.log_evidence
            if not left:
                break
            moved = model.solve_friction(start)
            settled = abs(gained) < settings.COARSE
            if core.converged and (settled or (to_the_end and moved < settings.FRICTION_PATH_CHANGE)):
                break
    except ValueError as error:
        unsolved = model.unsolved()
        which = f": the model has no solution for {_named(unsolved, how)}"
        hint = f"{which}; correct their joints or loads, or leave them out"
        raise NoFit([Problem(line + hint * bool(unsolved)) for line in str(error).splitlines()]) from None
    own = {name: getattr(core, name) for name in ("values", "sd", "covariance", "ratio", "starts")}
    warnings = [*core.warnings]
    if excluded:
        warnings.append(f"the model has no solution for {_named(excluded, how)}: left out, check joints and loads")
    return Fit(
        priors, noise, positions, core, model, excluded, **own, warnings=warnings, seconds=perf_counter() - began
    )


def _as_function(model: ResidualModel):
    """(x, derivatives) -> (residual, its derivative), or None where the prediction fails: for the compiled fit."""

    def predict(x: Array, derivatives: bool) -> tuple[Array, Array] | None:
        residual, jacobian, usable = model.residual(x, derivatives)
        return (residual, jacobian) if usable else None

    return predict


class _FrameAlone(ResidualModel):
    """A model of which only some parameters are free, the others keep their value; unsolved rows are left out."""

    def __init__(self, model: ResidualModel, values: Array, free: Mask):
        self._model, self._values, self._free = model, values, free

    def activate(self, rows) -> None:
        self._model.activate(rows)

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        values = self._values.copy()
        values[self._free] = x
        residual, jacobian, _ = self._model.residual(values, derivatives)
        return residual, jacobian[:, self._free] if derivatives else jacobian, True


def _with_frame(
    model: ResidualModel, priors: Priors, noise: Noise, positions: Array, rows: Mask, **options: Array | None
) -> tuple[Array, Priors]:
    """The start of a fit and its priors. Where the tracker frame and other parameters are free, the frame is first
    fitted by itself and its priors are widened: a grossly wrong frame would distort the other parameters."""
    start = np.clip(model.nominal(), priors.low, priors.high)
    frame = np.array([name.startswith("tracker.") for name in priors.names])
    if frame.any() and not frame.all() and rows.any():
        few, alone = folds.few_of(rows), _FrameAlone(model, start, frame)
        rows = rows if few is None else few
        found = fit_joint(
            alone, priors.some(frame), noise, positions, rows, start=start[frame], few_first=False, **options
        )
        start[frame] = found.values
        priors = replace(priors, scales=found.priors.scales)
    return start, priors


def linear_fit(
    at: Fit,
    *,
    noise: Noise | None = None,
    positions: Array | None = None,
    rows: Mask | None = None,
    only: Mask | None = None,
    more: ArrayLike = 0.0,
    weights: Array | None = None,
    **options,
) -> Fit:
    """Like fit_joint() with the parameters of a fit, but with the model linearised there: other noise, positions
    (M, 3), rows (M,) or weights (M, 2) are cheap. `rows` are used only where no weights are given; a weight of 0 leaves
    a row out. `more` (M, 6) is added to the residual. With `only` (M,) the fit holds these rows alone, and `weights`
    belongs to them."""
    residual, jacobian = at.residual + more, at.jacobian_all
    positions = at.positions if positions is None else positions
    if weights is None and rows is not None:
        residual = np.where(rows[:, None], residual, nan)
    if only is not None:
        residual, positions, jacobian = residual[only], positions[only], jacobian[np.repeat(only, 6)]
    model = LinearModel(residual.ravel(), jacobian, at.values, at.prior_mean)
    priors = replace(at.priors, gauges=(), limits=())
    options |= {"start": at.values, "few_first": False, "scales": priors.scales}
    return fit_joint(model, priors, noise or at.noise, positions, weights=weights, **options)


def p_value(fit: Fit) -> float:
    """Probability that the noise of a fit as stated, whatever model error had to be admitted, leaves such a
    residual or a larger one; 0 where the noise had to be inflated much."""
    if np.max(fit.inflation) > settings.INFLATION_EXPLAINED:
        return 0.0
    return as_stated(fit).p_value


def as_stated(fit: Fit) -> Fit:
    """The linearised fit under the noise as stated, whatever model error had to be admitted."""
    return linear_fit(fit, weights=fit.weights, inflation=np.ones(2))


def rejects(fit: Fit) -> bool:
    """Whether the noise as stated does not explain the residual of a fit."""
    return p_value(fit) < settings.SIGNIFICANCE


def with_likeliest_field(fit: Fit, stated: Noise | None = None, positions: Array | None = None) -> Fit:
    """The linearised fit at its weights with that part of the stated field error which makes the readings likeliest.
    Noise and `positions` (M, 3) [m] of the sensor are those of the fit where not given."""
    noises = (with_field(stated or fit.noise, part) for part in settings.FIELD_PARTS)
    fits = (linear_fit(fit, noise=noise, positions=positions, weights=fit.weights) for noise in noises)
    return max(fits, key=lambda tried: tried.log_evidence)


def tracker_error(fit: Fit, noise: Noise) -> tuple[float, float]:
    """RMS of position [mm] and rotation [deg] that the tracker alone leaves of a right model: its jitter as stated, and
    its smooth field error as the residual of the fitted readings shows it."""
    used = np.repeat((fit.weights > 0) & np.isfinite(fit.residual[:, ::3]), 3, axis=1)
    still = _still(np.where(used, fit.residual, nan), noise, fit.positions, weights=fit.weights, inflation=np.ones(2))
    field = still.field
    smooth = [rms(np.where(used, field, nan)[:, kind : kind + 3]) for kind in (0, 3)]
    error = np.hypot(np.sqrt(3) * np.array([noise.position_jitter, noise.rotation_jitter]), np.nan_to_num(smooth))
    return 1e3 * float(error[0]), float(np.rad2deg(error[1])) if used[:, 3:].any() else nan


def _still(residual: Array, noise: Noise, positions: Array, **options: ArrayLike | None) -> Fit:
    """The noise of a residual (M, 6) that stays as it is: a fit of one parameter without any effect."""
    zero = np.zeros(1)
    model = LinearModel(residual.ravel(), np.zeros((residual.size, 1)), zero, zero)
    priors = Priors(["nothing"], zero, zero + 1, zero - 1, zero + 1)
    return fit_joint(model, priors, noise, positions, few_first=False, **options)


def sensor_positions(robot: Robot, measurements: Measurements) -> Array:
    """Where the sensor was (M, 3) [m], tracker frame: as measured, or where that is missing as predicted."""
    positions = measurements.positions.copy()
    missing = np.isnan(positions).any(axis=1)
    if missing.any():
        tips = standard_tips(robot, measurements.rows(missing))
        positions[missing] = base_to_tracker(robot.tracker, tips.position, tips.quaternion)[0]
    return positions


def _table_warnings(measurements: Measurements, rows: Mask) -> Iterable[str]:
    """Shortcomings of the fitted rows (M,)."""
    if not rows.any():
        return
    fixed = np.ptp(np.hstack([measurements.beta, measurements.alpha])[rows], axis=0) == 0
    if fixed.all():
        yield "all joints are the same in every row: one pose determines few of the parameters"
    elif fixed.any():
        n = measurements.beta.shape[1]
        names = [f"beta{i + 1}" if i < n else f"alpha{i + 1 - n}" for i in np.flatnonzero(fixed)]
        yield f"these joints never move: {', '.join(names)}"
    if len(np.unique(measurements.run[rows])) < 2:
        yield "there is only one run: readings that follow one another cannot check what was learned from them"
    if not np.isfinite(measurements.quaternions[rows]).any():
        yield "no orientation was measured: positions alone tell the parameters apart less well"


def _named(rows: Sequence[int], how: FitOptions) -> str:
    """Rows counted from 0 by their numbers in the table."""
    named = [row + 1 if how.row is None else int(how.row[row]) for row in rows]
    return f"{counted(len(rows), 'reading')}, row{'s' * (len(rows) > 1)} {listed(named, 8)}"
