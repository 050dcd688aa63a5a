"""Joint identification: any set of parameters fitted to a table of readings, with what the readings cannot say.

Positions in m, rotations in rad, tracker axes. Residuals are measured - predicted: position, then rotation vector.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr import _core, fit_words, free_parameters, open_side, recording, sensor_roll, user_effects
from ctcr.errors import InputError, Problem
from ctcr.frames import base_to_tracker
from ctcr.measurements import Measurements
from ctcr.robot import Robot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEW_ROWS = 500  # a fit of so many comes first where there are twice as many or more
Noise = _core.Noise
expand = free_parameters.expand
parameter_names = free_parameters.names_of
priors = free_parameters.priors


def noise_of(
    robot: Robot,
    correlation_length: float = 0.1,
    field: bool = True,
    kinds: Sequence[str] = ("position", "rotation"),
) -> Noise:
    """The tracker's noise: its jitter, and with `field` the smooth error that its 95 % accuracy implies.

    `correlation_length` [m] is the distance over which that error changes; `kinds` is what was measured. Raises
    InputError where the robot file does not state the jitter of one of these.
    """
    tracker, problems, figures = robot.tracker, [], {}
    for kind, unit, scale in (("position", "mm", 1e-3), ("rotation", "deg", np.pi / 180)):
        jitter, accuracy = (getattr(tracker, f"{name}_{unit}") for name in ("jitter", "accuracy_95"))
        if kind in kinds and not jitter:
            text = f"a fit needs the standard deviation of one reading, above 0, in {unit}"
            problems.append(Problem(text, field=f"tracker.jitter_{unit}"))
            continue
        figures[f"{kind}_jitter"] = scale * (jitter or 1.0)  # of what was not measured any will do
        smooth = field and kind in kinds and accuracy
        figures[f"{kind}_field"] = scale * _core.field_of_accuracy(accuracy, jitter) if smooth else 0.0
    if problems:
        raise InputError(problems)
    return Noise(**figures, correlation_length=correlation_length)


@dataclass(frozen=True)
class Fit:
    """Fitted parameters and what is known of them. Arrays by parameter (n,) are in SI; by row (M, ..) over all rows."""

    names: list[str]
    units: list[str]
    prior_mean: Array  # (n,)
    prior_sd: Array  # (n,)
    values: Array  # (n,)
    sd: Array  # (n,) posterior; inf: not determined at all
    covariance: Array  # (n, n)
    shift: Array  # (n,) (value - mean) / prior sd; NaN without a prior
    ratio: Array  # (n,) posterior / prior sd: 1 means that the readings say nothing
    correlations: list[tuple[str, str, float]]  # beyond 0.9, strongest first
    directions: list[Any]  # undetermined combinations: .text, .ratio, .coefficients in prior sd
    chi_square: float  # under the noise as stated
    shift_square: float
    observations: int
    bulk_observations: float  # without outliers: degrees of freedom of chi_square + shift_square
    effective_parameters: float
    reduced_chi_square: float
    log_evidence: float  # Laplace, under this fit's weights and inflation; NaN where a prior is infinite
    inflation: (
        Array  # (2,) factor on the jitter of positions and rotations that the fit had to admit; 1: none
    )
    weights: Array  # (M, 2) 1 plain, less for outliers, 0 not fitted
    excluded: list[int]  # rows that the model cannot solve
    converged: bool
    status: str
    warnings: list[str]
    starts: list[Any]  # .cost, .distance from the result in posterior sd, .converged
    noise: Noise
    iterations: int
    evaluations: int
    seconds: float
    core: Any  # the compiled fit
    predict: Any  # what was fitted

    @property
    def used(self) -> Mask:
        """Rows that were fitted (M,)."""
        return (self.weights > 0).any(axis=1)

    @cached_property
    def _every_row(self) -> Any:
        """The predictor, of rows that were not fitted too."""
        if hasattr(self.predict, "activate"):
            active = np.ones(len(self.weights), bool)
            active[self.excluded] = False
            self.predict.activate(active.tolist())
        return self.predict

    @cached_property
    def _report(self) -> tuple[Array, Array, Array, Array]:
        return self.core.report(self._every_row)

    @property
    def residual(self) -> Array:
        """(M, 6) at the fitted values; NaN where not measured or not solved."""
        return self._report[0].reshape(-1, 6)

    @property
    def jacobian_all(self) -> Array:
        """(6 M, n) derivative of `residual`."""
        return self._report[1]

    @property
    def field(self) -> Array:
        """(M, 6) posterior mean of the tracker's smooth error, a part of the residual."""
        return self._report[2].reshape(-1, 6)

    @property
    def expected_square(self) -> Array:
        """(M, 2) of position [m^2] and rotation [rad^2]: noise and what the parameters leave open."""
        return self._report[3]

    @cached_property
    def nominal_residual(self) -> Array:
        """(M, 6) at the robot file's values."""
        every = self._every_row
        if not hasattr(every, "nominal"):
            return np.asarray(every(self.prior_mean, False)[0]).reshape(-1, 6)
        return np.asarray(every.residual(every.nominal())[0]).reshape(-1, 6)

    @cached_property
    def p_value(self) -> float:
        """Probability of so large a chi-square where model, priors and noise are right."""
        from scipy.stats import chi2

        return float(chi2.sf(self.chi_square + self.shift_square, self.bulk_observations))

    def rms_mm(self, rows: Mask | None = None) -> float:
        """RMS length of the position residual of some rows, all by default."""
        return 1e3 * _rms(self.residual[:, :3], rows)

    def rms_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(_rms(self.residual[:, 3:], rows)))

    def nominal_rms_mm(self, rows: Mask | None = None) -> float:
        return 1e3 * _rms(self.nominal_residual[:, :3], rows)

    def nominal_rms_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(_rms(self.nominal_residual[:, 3:], rows)))

    def floor_mm(self, rows: Mask | None = None) -> float:
        """RMS position residual that noise alone would leave, the uncertainty of the parameters included."""
        return 1e3 * self._floor(0, rows)

    def floor_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(self._floor(1, rows)))

    def apply(self, robot: Robot) -> Robot:
        """A copy of the robot with the fitted values."""
        return free_parameters.applied(robot, self.names, self.values)

    def whiten(self, columns: ArrayLike) -> Array:
        """Columns (M, 6) or (M, 6, k) with the noise of the fit made independent and of unit variance, (6 M, k).

        Rows that were not fitted become 0.
        """
        columns = np.asarray(columns, dtype=float)
        return self.core.whiten(columns.reshape(6 * len(columns), -1))

    def whitened(self) -> tuple[Array, Array]:
        """Whitened residual (6 M,) and its derivative (6 M, n) by the parameters; the prior is not in it."""
        both = self.core.whiten(np.column_stack([self.residual.ravel(), self.jacobian_all]))
        return both[:, 0], both[:, 1:]

    def _floor(self, kind: int, rows: Mask | None) -> float:
        known = np.isfinite(self.residual[:, 3 * kind]) & (True if rows is None else rows)
        return float(np.sqrt(self.expected_square[known, kind].mean())) if known.any() else nan


def noise_floor(fit: Fit, noise: Noise, places: Array) -> tuple[float, float]:
    """RMS of position [mm] and rotation [deg] that the tracker's noise leaves of a right model.

    The jitter as stated, and what the tracker's smooth error may be of the residual of the fitted readings, at
    `places` (M, 3) [m], tracker frame.
    """
    used = np.repeat((fit.weights > 0) & np.isfinite(fit.residual[:, ::3]), 3, axis=1)
    residual = np.where(used, fit.residual, nan).ravel()
    nothing, one = np.zeros((residual.size, 1)), np.ones(1)
    field = identify_with(
        lambda _x, _derivatives: (residual, nothing), ["nothing"], 0 * one, one, -one, one, noise, places,
        robust=False, weights=fit.weights, admit_model_error=False, inflation=np.ones(2), start=0 * one, starts=1,
    ).field  # fmt: skip
    smooth = [_rms(np.where(used, field, nan)[:, kind : kind + 3], None) for kind in (0, 3)]
    floors = np.hypot(
        np.sqrt(3) * np.array([noise.position_jitter, noise.rotation_jitter]), np.nan_to_num(smooth)
    )
    return 1e3 * float(floors[0]), float(np.rad2deg(floors[1])) if used[:, 3:].any() else nan


def places_of(robot: Robot, measurements: Measurements) -> Array:
    """Where the sensor was (M, 3) [m], tracker frame: as measured, or where that is missing as predicted."""
    places = (
        np.full((len(measurements), 3), nan)
        if measurements.position is None
        else measurements.position.copy()
    )
    missing = np.isnan(places).any(axis=1)
    if missing.any():
        from ctcr.model import Model

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
    noise    of the tracker; `noise_of(robot)` by default. An unknown roll of the sensor is always free
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
    mean, width, low, high = priors(robot, names, sd)
    kinds = [kind for kind in ("position", "rotation") if _is_measured(measurements, kind)]
    noise = noise or noise_of(robot, kinds=kinds)
    chosen = np.ones(len(measurements), bool) if rows is None else np.asarray(rows, dtype=bool)
    warnings = [*said, *fit_words.doubts(measurements, measured_rows(measurements) & chosen)]
    steps = steps or recording.steps_for(robot, measurements, noise)
    table = user_effects.recording_of(robot, measurements, names, steps=steps, threads=threads)
    fitted = identify_rows(
        table, measured_rows(measurements) & chosen, names, mean, width, low, high, noise,
        places_of(robot, measurements), robust=robust, admit_model_error=admit_model_error, weights=weights,
        inflation=inflation, starts=starts, start=np.clip(table.nominal(), low, high),
        known=free_parameters.known_directions(robot, names),
        within=free_parameters.admissible(robot, measurements.beta[chosen], names),
    )  # fmt: skip
    units = free_parameters.units_with_effects(robot)
    fitted = open_side.widened(replace(fitted, units=[units[name] for name in names]))
    return replace(fitted, warnings=warnings + fitted.warnings, seconds=perf_counter() - began)


def identify_rows(
    table: Any, rows: Mask, *arguments: Any, start: Array, starts: int = 1, **options: Any
) -> Fit:
    """identify_with() of some rows of a Recording. Where they are many, the starts are compared on a few of them."""
    few = few_of(rows)
    if few is None:
        table.activate(rows.tolist())
        return identify_with(table, *arguments, start=start, starts=starts, **options)
    table.activate(few.tolist())
    first = identify_with(table, *arguments, start=start, starts=starts, **options)
    table.activate(rows.tolist())
    fitted = identify_with(table, *arguments, start=first.values, starts=1, **options)
    return replace(fitted, starts=first.starts)


def few_of(rows: Mask) -> Mask | None:
    """FEW_ROWS or more of many rows (M,), evenly spread; None where they are few."""
    chosen = np.flatnonzero(rows)
    every = len(chosen) // FEW_ROWS
    if every < 2:
        return None
    few = np.zeros_like(rows)
    few[chosen[::every]] = True
    return few


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
    known: Sequence[tuple[str, Array]] = (),
    within: Sequence[tuple[str, Array, float]] = (),
) -> Fit:
    """As `fit`, for any predictor: a Recording (whose active rows are fitted), or a function
    (x, derivatives: bool) -> (residual (6 M,), its derivative (6 M, n) or anything), or None where it fails; NaN in the
    residual means not measured. Nominal is where x is `mean`. Raises InputError where no fit is possible."""
    began = perf_counter()
    try:
        core, excluded = _core.identify(
            predict=predict, names=list(names), mean=mean, sd=sd, low=low, high=high, noise=noise,
            places=np.asarray(places, dtype=float), robust=robust,
            admit_model_error=admit_model_error, weights=weights,
            inflation=None if inflation is None else np.asarray(inflation, dtype=float), start=start, starts=starts,
            max_iterations=max_iterations, known=list(known), within=list(within),
        )  # fmt: skip
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
        warnings=[*core.warnings, *fit_words.left_out(excluded)],
        **{
            name: getattr(core, name)
            for name in (
                "values", "sd", "covariance", "shift", "ratio", "directions", "chi_square", "shift_square",
                "observations", "bulk_observations", "effective_parameters", "reduced_chi_square", "log_evidence",
                "inflation", "weights", "converged", "status", "starts", "iterations", "evaluations",
            )
        },
    )  # fmt: skip


def measured_rows(measurements: Measurements) -> Mask:
    """Rows that hold a position or an orientation (M,)."""
    found = np.zeros(len(measurements), bool)
    for values in (measurements.position, measurements.quaternion):
        if values is not None:
            found |= np.isfinite(values).all(axis=1)
    return found


def _is_measured(measurements: Measurements, kind: str) -> bool:
    values = measurements.position if kind == "position" else measurements.quaternion
    return values is not None and bool(np.isfinite(values).all(axis=1).any())


def _rms(residual: Array, rows: Mask | None) -> float:
    square = np.sum(residual**2, axis=1)
    known = np.isfinite(square) & (True if rows is None else rows)
    return float(np.sqrt(square[known].mean())) if known.any() else nan
