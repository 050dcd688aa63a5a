"""Joint identification: any set of parameters fitted to a table of readings, with what the readings cannot say.

Positions in m, rotations in rad, tracker axes. Residuals are measured - predicted: position, then rotation vector.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import nan
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr import _core
from ctcr.audit import sensor_roll
from ctcr.errors import InputError, Problem
from ctcr.fit import folds, messages, one_sided
from ctcr.fit.result import Fit, rms
from ctcr.frames import base_to_tracker
from ctcr.model import parameters, recording, user_recording
from ctcr.model.model import Model
from ctcr.model.noise import Noise, noise_of_readings
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COARSE = 0.5  # tolerance of fits that only find a start, or tell models apart [of log evidence]
WOUND = 0.005  # a fit is repeated until rubbing tubes are wound up as its values say, so nearly [rad]
WINDINGS = 10  # and at most so often
BETWEEN = 2  # iterations in between, as long as the twist still changes much
FIELDS = (1.0, 0.3, 0.1, 0.0)  # parts of the tracker's stated field error that are tried


def noise_floor(fit: Fit, noise: Noise, places: Array) -> tuple[float, float]:
    """RMS of position [mm] and rotation [deg] that the tracker's noise leaves of a right model.

    The jitter as stated, and what the tracker's smooth error may be of the residual of the fitted readings, at
    `places` (M, 3) [m], tracker frame.
    """
    used = np.repeat((fit.weights > 0) & np.isfinite(fit.residual[:, ::3]), 3, axis=1)
    residual = np.where(used, fit.residual, nan).ravel()
    nothing, one = np.zeros((residual.size, 1)), np.ones(1)
    field = identify_with(
        lambda _x, _derivatives: (residual, nothing),
        ["nothing"],
        0 * one,
        one,
        -one,
        one,
        noise,
        places,
        robust=False,
        weights=fit.weights,
        admit_model_error=False,
        inflation=np.ones(2),
        start=0 * one,
        starts=1,
    ).field
    smooth = [rms(np.where(used, field, nan)[:, kind : kind + 3], None) for kind in (0, 3)]
    floors = np.hypot(np.sqrt(3) * np.array([noise.position_jitter, noise.rotation_jitter]), np.nan_to_num(smooth))
    return 1e3 * float(floors[0]), float(np.rad2deg(floors[1])) if used[:, 3:].any() else nan


def places_of(robot: Robot, measurements: Measurements) -> Array:
    """Where the sensor was (M, 3) [m], tracker frame: as measured, or where that is missing as predicted."""
    places = np.full((len(measurements), 3), nan) if measurements.position is None else measurements.position.copy()
    missing = np.isnan(places).any(axis=1)
    if missing.any():
        beta, alpha = robot.joints_of_table(measurements.beta[missing], measurements.alpha[missing])
        tips = Model(robot.standard).predict(beta, alpha, measurements.force[missing])
        places[missing] = base_to_tracker(robot.tracker, tips.position, tips.quaternion)[0]
    return places


def fit(
    robot: Robot,
    measurements: Measurements,
    free: str | Iterable[str] = "standard",
    *,
    rows: Mask | None = None,
    sd: Mapping[str, float] | None = None,
    noise: Noise | None = None,
    robust: bool = True,
    admit_model_error: bool = True,
    weights: Array | None = None,
    inflation: ArrayLike | None = None,
    starts: int = 3,
    steps: int | None = None,
    threads: int = 0,
) -> Fit:
    """The most probable values of the named parameters (see `expand`), given the readings and the robot file's priors.

    rows     (M,) readings to fit, all by default; the others are judged with the result. Split by run, never by row.
    sd       {name: prior standard deviation in SI, or math.inf} over the file's `uncertainty`
    noise    of the tracker; `noise_of_readings` by default. An unknown roll of the sensor is always free
    robust   whether outliers count for little; `weights` (M, 2) of another fit freezes theirs
    admit_model_error   whether jitter is added where the model misses what the noise cannot explain; `inflation` (2,)
             of another fit freezes it. Compare evidences of models at frozen weights and inflation.
    starts   how many starts to compare
    steps    of integration per segment; as many as the readings call for by default (recording.steps_for)
    threads  as in Model
    Raises InputError where no fit is possible.
    """
    began = perf_counter()
    robot, measurements, said = sensor_roll.usable(robot, measurements)
    names = sensor_roll.with_roll(free, robot)
    mean, width, low, high = parameters.priors(robot, names, sd)
    noise = noise or noise_of_readings(robot, measurements)
    chosen = np.ones(len(measurements), bool) if rows is None else np.asarray(rows, dtype=bool)
    rows, places = folds.measured_rows(measurements) & chosen, places_of(robot, measurements)
    warnings = [*said, *messages.doubts(measurements, rows)]
    steps = steps or recording.steps_for(robot, measurements, noise)
    table = user_recording.recording_of(robot, measurements, names, steps=steps, threads=threads)
    options = {"robust": robust, "admit_model_error": admit_model_error, "weights": weights, "inflation": inflation}
    within = parameters.admissible(robot, measurements.beta[chosen], names)

    def fitted_from(start: Array, like: Fit | None = None, starts: int = 1) -> Fit:
        frozen = {} if like is None else {"weights": like.weights, "inflation": like.inflation}
        own = user_recording.recording_of(robot, measurements, names, steps=steps, threads=threads)
        return identify_rows(
            own,
            rows,
            names,
            mean,
            width,
            low,
            high,
            noise,
            places,
            **options | frozen,
            starts=starts,
            start=np.clip(start, low, high),
            known=parameters.known_directions(robot, names),
            within=within,
        )

    start = np.clip(table.nominal(), low, high)
    start = _with_frame(start, table, rows, names, (mean, width, low, high), noise, places, options)
    fitted = one_sided.crossed(fitted_from(start, starts=starts), fitted_from)
    units = parameters.units_with_effects(robot)
    fitted = one_sided.widened(replace(fitted, units=[units[name] for name in names]))
    return replace(fitted, warnings=warnings + fitted.warnings, seconds=perf_counter() - began)


def _with_frame(
    start: Array,
    table: Any,
    rows: Mask,
    names: Sequence[str],
    priors: Sequence[Array],
    noise: Noise,
    places: Array,
    options: Mapping[str, Any],
) -> Array:
    """The start with the tracker frame that fits the other values best, where both are free.

    A frame that is far off would drag the others along.
    """
    frame = np.array([name.startswith("tracker.") for name in names])
    if not frame.any() or frame.all() or not rows.any():
        return start
    few = folds.few_of(rows)
    table.activate((rows if few is None else few).tolist())

    def predict(x: Array, derivatives: bool) -> tuple[Array, Array]:
        values = start.copy()
        values[frame] = x
        residual, jacobian, _ = table.residual(values, derivatives)
        return residual, jacobian[:, frame] if derivatives else jacobian

    chosen = [name for name, free in zip(names, frame, strict=True) if free]
    fitted = identify_with(
        predict, chosen, *(part[frame] for part in priors), noise, places, **options, start=start[frame], starts=1
    )
    start = start.copy()
    start[frame] = fitted.values
    return start


def identify_rows(
    table: Any,
    rows: Mask,
    *arguments: Any,
    start: Array,
    starts: int = 1,
    few_first: bool = True,
    weights: Array | None = None,
    **options: Any,
) -> Fit:
    """identify_with() of some rows of a Recording. Where they are many, the starts are compared on a few of them, with
    few_first."""
    options["weights"] = weights
    if weights is not None:
        rows = rows & (weights > 0).any(axis=1)
    few = folds.few_of(rows) if few_first else None
    if few is None:
        table.activate(rows.tolist())
        return identify_with(table, *arguments, start=start, starts=starts, **options)
    table.activate(few.tolist())
    first = identify_with(table, *arguments, start=start, starts=starts, **options | {"tolerance": COARSE})
    table.activate(rows.tolist())
    fitted = identify_with(table, *arguments, start=first.values, starts=1, **options)
    return replace(fitted, starts=first.starts)


def identify_with(
    predict: Any,
    names: Sequence[str],
    mean: Array,
    sd: Array,
    low: Array,
    high: Array,
    noise: Noise,
    places: Array,
    *,
    robust: bool = True,
    admit_model_error: bool = True,
    weights: Array | None = None,
    inflation: ArrayLike | None = None,
    start: Array | None = None,
    starts: int = 3,
    max_iterations: int = 50,
    tolerance: float = 0.02,
    known: Sequence[tuple[str, Array]] = (),
    within: Sequence[tuple[str, Array, float]] = (),
) -> Fit:
    """As `fit`, for any predictor: a Recording (whose active rows are fitted), or a function
    (x, derivatives: bool) -> (residual (6 M,), its derivative (6 M, n) or anything), or None where it fails; NaN in the
    residual means not measured. Nominal is where x is `mean`. Raises InputError where no fit is possible."""
    began = perf_counter()
    wind_up = getattr(predict, "wind_up", lambda x: 0.0)
    try:
        moved = wind_up(start) if start is not None else 0.0
        evidence, found = -np.inf, None
        for left in reversed(range(WINDINGS if moved > 0 and tolerance < COARSE else 1)):
            whole = not left or moved < WOUND
            core, excluded = _core.identify(
                predict=predict,
                names=list(names),
                mean=mean,
                sd=sd,
                low=low,
                high=high,
                noise=noise,
                places=np.asarray(places, dtype=float),
                robust=robust,
                admit_model_error=admit_model_error,
                weights=weights,
                inflation=None if inflation is None else np.asarray(inflation, dtype=float),
                start=start,
                first_weights=found,
                starts=starts,
                max_iterations=max_iterations if whole else min(max_iterations, BETWEEN),
                tolerance=tolerance if whole else max(tolerance, COARSE),
                known=list(known),
                within=list(within),
            )
            start, starts, found = core.values, 1, core.weights
            gained, evidence = core.log_evidence - evidence, core.log_evidence
            if not left:
                break
            moved = wind_up(start)
            if core.converged and (abs(gained) < COARSE or (whole and moved < WOUND)):
                break
    except ValueError as error:
        raise InputError([Problem(line) for line in str(error).splitlines()]) from None
    return Fit(
        names=list(names),
        units=[""] * len(names),
        prior_mean=np.asarray(mean),
        prior_sd=np.asarray(sd),
        correlations=[(names[c.first], names[c.second], c.coefficient) for c in core.correlations],
        excluded=excluded,
        noise=noise,
        seconds=perf_counter() - began,
        core=core,
        predict=predict,
        warnings=[*core.warnings, *messages.left_out(excluded)],
        **{
            name: getattr(core, name)
            for name in (
                "values",
                "sd",
                "covariance",
                "shift",
                "ratio",
                "directions",
                "chi_square",
                "admitted_chi_square",
                "shift_square",
                "observations",
                "bulk_observations",
                "effective_parameters",
                "reduced_chi_square",
                "log_evidence",
                "inflation",
                "weights",
                "converged",
                "status",
                "starts",
                "iterations",
                "evaluations",
            )
        },
    )


def linear_fit(
    at: Fit,
    low: Array,
    high: Array,
    places: Array,
    *,
    noise: Noise | None = None,
    rows: Mask | None = None,
    weights: Array | None = None,
    inflation: ArrayLike | None = None,
    max_iterations: int = 50,
    more: ArrayLike = 0.0,
) -> Fit:
    """As identify_with() with the parameters of a fit, but of the model linearised there: other noise, rows (M,) or
    weights (M, 2) are cheap. Weights of 0 leave rows out, so that `rows` count only without any. `more` (M, 6) is added
    to the residual."""
    shown = at.residual + more
    if weights is None and rows is not None:
        shown = np.where(rows[:, None], shown, nan)
    residual = shown.ravel()

    def predict(x: Array, _: bool) -> tuple[Array, Array]:
        return residual + at.jacobian_all @ (x - at.values), at.jacobian_all

    return identify_with(
        predict,
        at.names,
        at.prior_mean,
        at.prior_sd,
        low,
        high,
        noise or at.noise,
        places,
        robust=weights is None,
        weights=weights,
        admit_model_error=inflation is None,
        inflation=inflation,
        start=at.values,
        starts=1,
        max_iterations=max_iterations,
    )


def with_field(noise: Noise, part: float) -> Noise:
    """The tracker's noise with a part of its stated field error."""
    return Noise(
        position_jitter=noise.position_jitter,
        rotation_jitter=noise.rotation_jitter,
        position_field=part * noise.position_field,
        rotation_field=part * noise.rotation_field,
        correlation_length=noise.correlation_length,
    )


def likeliest_field(fit: Fit, low: Array, high: Array, places: Array) -> Noise:
    """The noise of a fit with the part of its field error that makes the readings likeliest, by the fit's slopes."""
    others = [
        linear_fit(fit, low, high, places, noise=with_field(fit.noise, part), weights=fit.weights)
        for part in FIELDS[1:]
    ]
    return max([fit, *others], key=lambda tried: tried.log_evidence).noise
