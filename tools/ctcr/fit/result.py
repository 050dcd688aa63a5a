"""The result of a joint fit: the maximum a posteriori estimate and its Laplace approximation."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import nan
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from ctcr import _core, settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.fit import widening
from ctcr.fit.widening import Scales
from ctcr.model import parameters
from ctcr.model.noise import Noise
from ctcr.model.protocol import ResidualModel
from ctcr.model.sessions import as_given
from ctcr.robot.description import Robot


@dataclass(frozen=True)
class Priors:
    """The prior distribution of n parameters, SI: normal within bounds."""

    names: list[str]
    mean: Array  # (n,)
    stated: Array  # (n,) standard deviation as stated; inf: nothing is known
    low: Array  # (n,)
    high: Array  # (n,)
    gauges: Sequence[tuple[str, Array]] = ()  # changes (n,) that leave the readings nearly as they are, with words
    limits: Sequence[tuple[str, Array, float]] = ()  # least values of row @ change, row (n,), with words
    groups: Sequence[str | None] = ()  # (n,) which stated number each standard deviation is, see parameters.group_of
    correlations: Array | None = None  # (n, n); independent without
    scales: Scales = field(default_factory=dict)  # by group on the stated standard deviations, see fit.widening

    @classmethod
    def of(cls, robot: Robot, names: Sequence[str], beta: Array, sd: Any = None) -> "Priors":
        """From the robot file, for joints beta (M, N) [m] that must stay possible; `sd` as of parameters.priors."""
        gauges, limits = parameters.known_directions(robot, names), parameters.admissible(robot, beta, names)
        groups = [parameters.group_of(robot, name) for name in names]
        known, correlations = parameters.priors(robot, names, sd), parameters.correlations(robot, list(names))
        if correlations is not None:
            stated = np.isfinite(known[1])  # what is not known at all correlates with nothing
            correlations = np.where(np.outer(stated, stated), correlations, np.eye(len(names)))
        return cls(list(names), *known, gauges, limits, groups, correlations)

    def some(self, chosen: Mask) -> "Priors":
        """The priors of some parameters (n,), without gauges and limits, which combine several."""
        names = [name for name, kept in zip(self.names, chosen, strict=True) if kept]
        parts = (part[chosen] for part in (self.mean, self.stated, self.low, self.high))
        groups = [group for group, kept in zip(self.groups, chosen, strict=True) if kept]
        correlations = None if self.correlations is None else self.correlations[np.ix_(chosen, chosen)]
        return Priors(names, *parts, groups=groups, correlations=correlations, scales=self.scales)

    @cached_property
    def scale(self) -> Array:
        """(n,) on the stated standard deviation."""
        if not self.scales:
            return np.ones(len(self.names))
        return np.array([self.scales.get(group, 1.0) for group in self.groups])

    @property
    def sd(self) -> Array:
        """(n,) Standard deviation; inf: nothing is known."""
        return self.stated * self.scale

    @property
    def factor(self) -> Array:
        """(n, n) that makes correlated parameters of independent ones of unit variance."""
        if self.correlations is None:
            return np.diag(self.sd)
        return self.sd[:, None] * np.linalg.cholesky(self.correlations)

    @property
    def precision(self) -> Array:
        """(n, n) inverse of the covariance; 0 where nothing is known."""
        inverse = np.eye(len(self.names)) if self.correlations is None else np.linalg.inv(self.correlations)
        return inverse / np.outer(self.sd, self.sd)


@dataclass(frozen=True)
class Fit:
    """Fitted parameters and their uncertainty. Arrays by parameter (n,) are in SI; by row (M, ..) over all rows.

    All attributes of the compiled fit (`_core.Identification`) are attributes of this one:
    shift, ratio     (n,) (value - mean) / prior sd, and posterior over prior sd: 1: the readings do not determine it;
                     the prior sd is the widened one
    directions       undetermined combinations: .text, .ratio, .coefficients in prior sd
    weights          (M, 2) robust weights of position and rotation: 1 plain, less for outliers, 0 not fitted
    inflation        (2,) factor on the jitter of positions and rotations by which the fit admits model error; 1: none
    chi_square       under the noise as stated; admitted_chi_square: under the inflated noise
    shift_square     of the prior; observations: numbers fitted
    bulk_observations    without outliers: degrees of freedom of chi_square + shift_square
    reduced_chi_square, effective_parameters, converged, status, iterations, evaluations
    """

    priors: Priors
    noise: Noise
    positions: Array | None  # (M, 3) [m] of the sensor, tracker frame, on which the field error depends
    core: Any  # _core.Identification
    model: ResidualModel | None  # that was fitted
    excluded: list[int]  # rows that the model cannot solve
    values: Array  # (n,)
    sd: Array  # (n,) posterior; inf: not determined at all
    covariance: Array  # (n, n)
    ratio: Array  # (n,)
    starts: list[Any]  # that were compared: .cost, .distance from the result in posterior sd, .converged
    warnings: list[str]
    seconds: float

    def __getattr__(self, name: str):
        if name.startswith("__") or name == "core":
            raise AttributeError(name)
        return getattr(self.core, name)

    @property
    def names(self) -> list[str]:
        return self.priors.names

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood (Laplace) at these weights, this inflation and these scales, with the prior of the
        scales; NaN where a prior is infinite."""
        return self.core.log_evidence + widening.log_prior(self.priors.scales)

    @property
    def prior_mean(self) -> Array:
        return self.priors.mean

    @property
    def prior_sd(self) -> Array:
        return self.priors.sd

    @property
    def correlations(self) -> list[tuple[str, str, float]]:
        """Pairs of parameters whose posterior correlation is beyond 0.9, the strongest first."""
        return [(self.names[c.first], self.names[c.second], c.coefficient) for c in self.core.correlations]

    @property
    def used(self) -> Mask:
        """Rows that were fitted (M,)."""
        return (self.weights > 0).any(axis=1)

    def predicted_positions(self) -> Array:
        """(M, 3) [m] of the sensor, tracker frame, at the fitted values; `positions` where the model has no solution.

        At measured positions the jitter of a reading would pass for a change of the field.
        """
        self._activate_all()
        self.model.residual(self.values)
        predicted, _ = self.model.predicted()
        return np.where(np.isfinite(predicted), predicted, self.positions)

    @property
    def frozen(self) -> dict[str, Any]:
        """Options of fits that keep its weights, inflation, scales and positions: their evidences can be compared."""
        same = {"weights": self.weights, "inflation": self.inflation, "scales": self.priors.scales}
        return same | {"positions": self.positions}

    def without_readings(self) -> "Fit":
        """Its values and statistics alone: small, however many rows there are. It has no residual."""
        public = (name for name in dir(self.core) if not name.startswith("_"))
        found = {name: getattr(self.core, name) for name in public}
        core = SimpleNamespace(**{name: value for name, value in found.items() if not callable(value)})
        return replace(self, core=core, model=None, positions=None)

    def _activate_all(self) -> None:
        """Activates all rows but the excluded ones, with those that were not fitted."""
        solved = np.ones(len(self.weights), bool)
        solved[self.excluded] = False
        self.model.activate(solved.tolist())

    @cached_property
    def _report(self) -> tuple[Array, Array, Array, Array]:
        self._activate_all()
        compiled = isinstance(self.model, _core.Recording)
        return self.core.report(self.model if compiled else lambda x, wanted: self.model.residual(x, wanted)[:2])

    @cached_property
    def _of_used(self) -> tuple[Array, Array]:
        """`residual` (6 M,) and `jacobian_all` in the rows that were fitted; in others they may be missing."""
        if "_report" in self.__dict__:
            return self._report[:2]
        self.model.activate(self.used.tolist())
        return self.model.residual(self.values, True)[:2]

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
        """(M, 6) posterior mean of the tracker's smooth field error, a part of the residual."""
        return self._report[2].reshape(-1, 6)

    @property
    def expected_square(self) -> Array:
        """(M, 2) expected square of the error of position [m^2] and rotation [rad^2]: jitter, field error and posterior
        uncertainty of the parameters, one-sided ones included (see one_sided)."""
        wider = self.covariance - self.core.covariance
        if not wider.any():
            return self._report[3]
        jacobian = self.jacobian_all.reshape(len(self.weights), 2, 3, -1)
        return self._report[3] + np.einsum("mkai,ij,mkaj->mk", jacobian, wider, jacobian)

    @cached_property
    def nominal_residual(self) -> Array:
        """(M, 6) at the robot file's values, of the readings as they were taken."""
        self._activate_all()
        model = as_given(self.model)
        return model.residual(model.nominal())[0].reshape(-1, 6)

    @cached_property
    def p_value(self) -> float:
        """Probability of so large a chi-square where model and priors are right, and the stated jitter nearly is."""
        node, weight = np.polynomial.hermite_e.hermegauss(21)
        scale = np.exp(2 * settings.JITTER_KNOWN * node)
        tail = chdtrc(self.bulk_observations, (self.chi_square + self.shift_square) / scale)
        return float(weight @ tail / weight.sum())

    def rms_mm(self, rows: Mask | None = None) -> float:
        """RMS length of the position residual of some rows (M,), all by default."""
        return 1e3 * rms(self.residual[:, :3], rows)

    def nominal_rms_mm(self, rows: Mask | None = None) -> float:
        return 1e3 * rms(self.nominal_residual[:, :3], rows)

    def expected_mm(self, rows: Mask | None = None) -> float:
        """RMS position error to be expected of a right model: see `expected_square`."""
        return 1e3 * self._expected(0, rows)

    def expected_deg(self) -> float:
        """RMS rotation error to be expected of a right model."""
        return float(np.rad2deg(self._expected(1)))

    def _expected(self, kind: int, rows: Mask | None = None) -> float:
        known = np.isfinite(self.residual[:, 3 * kind]) & (True if rows is None else rows)
        return rms(np.sqrt(self.expected_square[:, [kind]]), known)

    def apply(self, robot: Robot) -> Robot:
        """A copy of the robot with the fitted values."""
        return parameters.applied(robot, self.names, self.values)

    def whiten(self, columns: ArrayLike) -> Array:
        """Columns (M, 6) or (M, 6, k) with the noise of the fit made independent and of unit variance, (K, k), of the K
        numbers that were fitted."""
        columns = np.asarray(columns, dtype=float)
        return self.core.whiten(columns.reshape(6 * len(columns), -1))[self.fitted_numbers]

    def whitened(self) -> tuple[Array, Array]:
        """Whitened residual (K,) and its derivative (K, n) by the parameters; the prior is not in it."""
        residual, jacobian = self._of_used
        both = self.whiten(np.column_stack([residual, jacobian]).reshape(len(self.weights), 6, -1))
        return both[:, 0], both[:, 1:]

    def derivative_where_used(self, name: str) -> Array:
        """Derivative (M, 6) of `residual` by one parameter in the rows that were fitted; 0 in others."""
        derivative = np.nan_to_num(self._of_used[1][:, self.names.index(name)].reshape(-1, 6))
        return np.where(self.used[:, None], derivative, 0.0)

    @cached_property
    def fitted_numbers(self) -> Integers:
        """Which (K,) of the 6 M numbers of `residual` were fitted."""
        return np.flatnonzero(np.repeat(self.weights > 0, 3, axis=1))


def rms(vectors: Array, rows: Mask | None = None) -> float:
    """RMS length of vectors (M, k) in some rows (M,), all by default; NaN does not count."""
    square = np.sum(vectors**2, axis=1)
    known = np.isfinite(square) & (True if rows is None else rows)
    return float(np.sqrt(square[known].mean())) if known.any() else nan
