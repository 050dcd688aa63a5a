"""What a joint fit found."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from ctcr.model import parameters
from ctcr.robot.description import Robot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


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
    admitted_chi_square: float  # under the noise as the fit had to admit it
    shift_square: float
    observations: int
    bulk_observations: float  # without outliers: degrees of freedom of chi_square + shift_square
    effective_parameters: float
    reduced_chi_square: float
    log_evidence: float  # Laplace, under this fit's weights and inflation; NaN where a prior is infinite
    inflation: Array  # (2,) factor on the jitter of positions and rotations that the fit had to admit; 1: none
    weights: Array  # (M, 2) 1 plain, less for outliers, 0 not fitted
    excluded: list[int]  # rows that the model cannot solve
    converged: bool
    status: str
    warnings: list[str]
    starts: list[Any]  # .cost, .distance from the result in posterior sd, .converged
    noise: Any  # _core.Noise
    iterations: int
    evaluations: int
    seconds: float
    core: Any  # the compiled fit
    predict: Any  # what was fitted

    @property
    def used(self) -> Mask:
        """Rows that were fitted (M,)."""
        return (self.weights > 0).any(axis=1)

    def without_readings(self) -> "Fit":
        """Its values and what is known of them alone: small, however many rows there are. It has no residual."""
        return replace(self, core=None, predict=None)

    def at_rest(self) -> "Fit":
        """Itself without what it can compute again of its readings."""
        return replace(self)

    @property
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

    @cached_property
    def _of_used(self) -> tuple[Array, Array]:
        """`residual` (6 M,) and `jacobian_all` in the rows that were fitted; in others they may be missing."""
        if "_report" in self.__dict__ or not hasattr(self.predict, "residual"):
            return self._report[:2]
        self.predict.activate(self.used.tolist())
        residual, slopes, _ = self.predict.residual(self.values, True)
        return residual, slopes

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
        """(M, 2) of position [m^2] and rotation [rad^2]: noise and what the parameters leave open, also to a side that
        the readings do not bound (see open_side)."""
        wider = self.covariance - self.core.covariance
        if not wider.any():
            return self._report[3]
        slopes = self.jacobian_all.reshape(len(self.weights), 2, 3, -1)
        return self._report[3] + np.einsum("mkai,ij,mkaj->mk", slopes, wider, slopes)

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
        return float(chi2.sf(self.chi_square + self.shift_square, self.bulk_observations))

    def rms_mm(self, rows: Mask | None = None) -> float:
        """RMS length of the position residual of some rows, all by default."""
        return 1e3 * rms(self.residual[:, :3], rows)

    def rms_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(rms(self.residual[:, 3:], rows)))

    def nominal_rms_mm(self, rows: Mask | None = None) -> float:
        return 1e3 * rms(self.nominal_residual[:, :3], rows)

    def nominal_rms_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(rms(self.nominal_residual[:, 3:], rows)))

    def floor_mm(self, rows: Mask | None = None) -> float:
        """RMS position residual that noise alone would leave, the uncertainty of the parameters included."""
        return 1e3 * self._floor(0, rows)

    def floor_deg(self, rows: Mask | None = None) -> float:
        return float(np.rad2deg(self._floor(1, rows)))

    def apply(self, robot: Robot) -> Robot:
        """A copy of the robot with the fitted values."""
        return parameters.applied(robot, self.names, self.values)

    def whiten(self, columns: ArrayLike) -> Array:
        """Columns (M, 6) or (M, 6, k) with the noise of the fit made independent and of unit variance, (K, k), of the K
        numbers that were fitted."""
        columns = np.asarray(columns, dtype=float)
        return self.core.whiten(columns.reshape(6 * len(columns), -1))[self._fitted_numbers]

    def whitened(self) -> tuple[Array, Array]:
        """Whitened residual (K,) and its derivative (K, n) by the parameters; the prior is not in it."""
        residual, slopes = self._of_used
        both = self.whiten(np.column_stack([residual, slopes]).reshape(len(self.weights), 6, -1))
        return both[:, 0], both[:, 1:]

    def slope_where_used(self, name: str) -> Array:
        """Derivative (M, 6) of `residual` by one parameter in the rows that were fitted; 0 in others."""
        slope = np.nan_to_num(self._of_used[1][:, self.names.index(name)].reshape(-1, 6))
        return np.where(self.used[:, None], slope, 0.0)

    @cached_property
    def _fitted_numbers(self) -> NDArray[np.int64]:
        return np.flatnonzero(np.repeat(self.weights > 0, 3, axis=1))

    def _floor(self, kind: int, rows: Mask | None) -> float:
        known = np.isfinite(self.residual[:, 3 * kind]) & (True if rows is None else rows)
        return float(np.sqrt(self.expected_square[known, kind].mean())) if known.any() else nan


def rms(residual: Array, rows: Mask | None) -> float:
    square = np.sum(residual**2, axis=1)
    known = np.isfinite(square) & (True if rows is None else rows)
    return float(np.sqrt(square[known].mean())) if known.any() else nan
