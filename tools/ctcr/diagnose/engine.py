"""Fits and linearisations of a robot with any effects, at one table of measurements, one noise and one split."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from ctcr import _core
from ctcr.effects import catalogue
from ctcr.fit import folds, joint
from ctcr.model import parameters, recording, user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


SLOPES = 1500  # rows by whose slopes candidates are screened where there are twice as many or more
OUTLIER = 0.3  # weight below which a reading is taken for one
SIGNIFICANCE = 0.01
FITS = 1.2  # inflation of the noise beyond which the model certainly does not explain the readings
SAID = 5.0  # log evidence by which readings say how the robot came to its first row
CLOSE = 1.0  # chi-square of integration errors: log evidences are meant to a half


@dataclass(frozen=True)
class Gain:
    """What a candidate would bring, by the slopes at a fit alone."""

    log_evidence: float  # over the fit without it
    values: Array  # of its parameters, over their neutral values, in units of their prior sd
    calibration: Array  # change of the fitted parameters that goes with them, in units of their prior sd
    signal: Array  # whitened change of the residual that calibration cannot imitate (K,)
    columns: Array  # whitened slopes that calibration cannot imitate (K, k)


def laplace(information: Array, gradient: Array) -> tuple[Array, Array]:
    """Log evidence of adding parameters, and their values, in units of their prior sd: of what the readings tell of
    them beside calibration (..., k, k), and the gradient (..., k) of half the chi-square."""
    S = information + np.eye(information.shape[-1])
    S = 0.5 * (S + np.swapaxes(S, -1, -2))
    eta = -np.linalg.solve(S, gradient[..., None])[..., 0]
    return -0.5 * np.sum(gradient * eta, axis=-1) - 0.5 * np.linalg.slogdet(S)[1], eta


class Linear:
    """Whitened residual and slopes at a fit, everything in units of prior sd."""

    def __init__(self, residual: Array, jacobian: Array) -> None:
        self.residual, self.jacobian = residual, jacobian
        information = jacobian.T @ jacobian + np.eye(jacobian.shape[1])
        self.cholesky = np.linalg.cholesky(information)

    def imitation(self, columns: Array) -> Array:
        """The change of the fitted parameters that imitates whitened columns best, given their priors."""
        return self.imitation_by(self.jacobian.T @ columns)

    def imitation_by(self, overlap: Array) -> Array:
        """The same of columns of which this is jacobian.T @ columns."""
        return cho_solve((self.cholesky, True), overlap, check_finite=False)

    def covariance(self) -> Array:
        """Of the parameters, given the readings and the priors."""
        return self.imitation_by(np.eye(len(self.cholesky)))

    def gain(self, columns: Array) -> Gain:
        """Laplace evidence of adding parameters with these slopes, exact where the model is linear in them."""
        imitation = self.imitation(columns)
        left = columns - self.jacobian @ imitation
        log_evidence, eta = laplace(columns.T @ left, columns.T @ self.residual)
        return Gain(float(log_evidence), eta, -imitation @ eta, left @ eta, left)


@dataclass
class Engine:
    robot: Robot
    measurements: Measurements
    noise: Any
    rows: Mask  # that are fitted
    robust: bool = True  # whether readings that are far off count for little
    threads: int = 0
    free: Sequence[str] = ("standard",)  # calibration parameters that are fitted, as in identify.expand
    tolerance: float = 0.02  # of log evidence, in fits that are not told another one
    steps: int = field(init=False)
    places: Array = field(init=False)
    base: list[str] = field(init=False)  # their names
    _wound: _core.Recording | None = field(init=False, default=None)  # of the last fit in which tubes rub

    def __post_init__(self) -> None:
        self.places = joint.places_of(self.robot, self.measurements)
        self.base = parameters.expand(list(self.free), self.robot)
        self.measured = folds.measured_rows(self.measurements)
        self.steps = recording.steps_for(self.robot, self.measurements, self.noise, CLOSE)

    @property
    def fitted(self) -> Mask:
        """Rows that hold something to fit."""
        return self.measured & self.rows

    def noise_with(self, part: float) -> Any:
        """The tracker's noise with a part of its stated field error."""
        return joint.with_field(self.noise, part)

    def priors(self, names: Sequence[str]) -> tuple[Array, Array, Array, Array]:
        """Mean, standard deviation, lower and upper bound of parameters of the robot and of effects."""
        found: dict[str, tuple[float, ...]] = {}
        own = [name for name in names if not name.startswith("effects.")]
        added = [name for name in names if name.startswith("effects.")]
        for source, some in ((parameters, own), (catalogue, added)):
            if some:
                found |= zip(some, zip(*source.priors(self.robot, some), strict=True), strict=True)
        mean, sd, low, high = np.array([found[name] for name in names]).reshape(-1, 4).T
        return mean, sd, low, high

    def recording(self, names: Sequence[str], fixed: dict[str, float] | None = None) -> Any:
        return user_recording.recording_of(
            self.robot, self.measurements, names, fixed=fixed, steps=self.steps, threads=self.threads
        )

    def fit(
        self,
        added: Iterable[str] = (),
        *,
        start: dict[str, float] | None = None,
        fixed: dict[str, float] | None = None,
        weights: Array | None = None,
        inflation: Array | None = None,
        noise: Any = None,
        max_iterations: int = 50,
        tolerance: float | None = None,
        near: bool = False,
    ) -> joint.Fit:
        """Calibration and `added` parameters of effects together. `near`: the start is where a like fit ended, so that
        a fit of few of many rows would teach nothing.

        Frozen `weights` of outliers and `inflation` of the noise make evidences comparable; without them both follow
        the fit: where the model is wrong, the noise is inflated so that calibration stays plausible.
        """
        names = [*self.base, *added]
        mean, sd, low, high = self.priors(names)
        mean_of = dict(zip(names, mean, strict=True))
        at = np.clip([(start or {}).get(name, mean_of[name]) for name in names], low, high)
        table = self.recording(names, fixed)
        _wind_as(table, self._wound)
        if weights is None and not self.robust:
            weights = np.ones((len(self.measurements), 2))
        fitted = joint.identify_rows(
            table,
            self.fitted,
            names,
            mean,
            sd,
            low,
            high,
            noise or self.noise,
            self.places,
            robust=weights is None,
            weights=weights,
            admit_model_error=inflation is None,
            inflation=inflation,
            start=at,
            max_iterations=max_iterations,
            tolerance=tolerance or self.tolerance,
            few_first=not near,
            known=parameters.known_directions(self.robot, names),
            within=parameters.admissible(self.robot, self.measurements.beta[self.rows], names),
        )
        if isinstance(table, _core.Recording) and table.is_wound:
            self._wound = table
        return fitted

    def fit_like(self, other: joint.Fit, added: Iterable[str] = (), **options: Any) -> joint.Fit:
        """As fit(), at the noise, weights and inflation of another fit: their evidences can be compared."""
        return self.fit(added, noise=other.noise, weights=other.weights, inflation=other.inflation, **options)

    def begins_otherwise(self, fit: joint.Fit, added: Iterable[str], fixed: dict[str, float] | None = None) -> bool:
        """Whether the robot came to its first row the other way than a fit has it, straight from home or at rest there:
        where the readings say so, that is taken for all fits to come."""
        other = replace(self, measurements=replace(self.measurements, from_home=not self.measurements.from_home))
        there = other.fit_like(fit, added, start=values_of(fit), fixed=fixed, near=True, tolerance=joint.COARSE)
        if there.log_evidence - fit.log_evidence < SAID:
            return False
        self.measurements = other.measurements
        return True

    def linear_fit(
        self,
        at: joint.Fit,
        *,
        noise: Any = None,
        weights: Array | None = None,
        inflation: Array | None = None,
        max_iterations: int = 50,
        more: Array | float = 0.0,
    ) -> joint.Fit:
        """As fit() with the same parameters, but of the model linearised at a fit: other noise or weights are cheap,
        and so is `more` (M, 6) residual."""
        _, _, low, high = self.priors(at.names)
        return joint.linear_fit(
            at,
            low,
            high,
            self.places,
            noise=noise,
            rows=self.rows,
            weights=weights,
            inflation=inflation,
            max_iterations=max_iterations,
            more=more,
        )

    def likeliest_noise(self, fit: joint.Fit) -> Any:
        """The noise of a fit with the part of the field error that its readings ask for."""
        _, _, low, high = self.priors(fit.names)
        return joint.likeliest_field(fit, low, high, self.places)

    def thinned(self, fit: joint.Fit, least: int = SLOPES) -> tuple["Engine", joint.Fit]:
        """Itself and a fit, or both with at least so many of many rows, each of which counts for its neighbours."""
        few = folds.few_of(self.fitted, least)
        if few is None:
            return self, fit
        weights = fit.weights * few[:, None] * (np.sum(self.fitted) / np.sum(few))
        thin = self.linear_fit(fit, weights=weights, inflation=fit.inflation, max_iterations=0)
        return replace(self, rows=few), thin

    def as_stated(self, fit: joint.Fit) -> joint.Fit:
        """The linearised fit under the noise as stated, whatever model error had to be admitted."""
        return self.linear_fit(fit, weights=fit.weights, inflation=np.ones(2))

    def rejects(self, fit: joint.Fit) -> bool:
        """Whether noise alone, as stated, does not explain what is left."""
        return bool(np.max(fit.inflation) > FITS or self.as_stated(fit).p_value < SIGNIFICANCE)

    def linear(self, fit: joint.Fit) -> Linear:
        residual, jacobian = fit.whitened()
        return Linear(residual, jacobian * fit.prior_sd)

    def slopes(self, fit: joint.Fit, names: Sequence[str], fixed: dict[str, float] | None = None) -> Array:
        """Raw slopes (M, 6, k) of the residual by parameters, fitted or neutral, in units of their prior sd.

        0 in rows that are not fitted.
        """
        everything = [*(name for name in fit.names if name not in names), *names]
        neutral, sd, _, _ = self.priors(everything)
        at = dict(zip(everything, neutral, strict=True)) | values_of(fit)
        table = self.recording(everything, fixed)
        _wind_as(table, fit.predict)
        table.activate(self.fitted.tolist())
        values = np.array([at[name] for name in everything])
        # A part of the table, scaled in place: of many rows this is the largest one of all.
        slopes = table.residual(values, True)[1][:, len(everything) - len(names) :]
        slopes *= sd[len(everything) - len(names) :]
        slopes[~np.isfinite(slopes)] = 0.0
        return slopes.reshape(len(self.measurements), 6, len(names))


def _wind_as(table: Any, other: Any) -> None:
    """Begins where another recording has wound up tubes that rub: much as it will be."""
    if isinstance(table, _core.Recording) and isinstance(other, _core.Recording):
        table.begin_at(other)


def values_of(fit: joint.Fit) -> dict[str, float]:
    return dict(zip(fit.names, map(float, fit.values), strict=True))
