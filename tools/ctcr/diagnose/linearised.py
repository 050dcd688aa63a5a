"""Bayesian linear algebra at a fit: evidence and values of further parameters by the derivatives there.

Residuals and derivatives are whitened, parameters counted in units of their prior standard deviation.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve

from ctcr.arrays import Array


@dataclass(frozen=True)
class Gain:
    """The linearised improvement of a fit by further parameters."""

    log_evidence: float  # over the fit without them
    values: Array  # (k,) over their neutral values
    calibration: Array  # (n,) change of the fitted parameters that goes with them
    signal: Array  # (K,) change of the residual that calibration cannot imitate
    columns: Array  # (K, k) derivatives that calibration cannot imitate
    removed: float  # chi-square of residual and prior

    @property
    def at_neutral(self) -> "Gain":
        """Of the same parameters where none may leave its neutral value: what they cost."""
        none = {name: np.zeros_like(getattr(self, name)) for name in ("values", "calibration", "signal")}
        return replace(self, log_evidence=self.log_evidence - 0.5 * self.removed, removed=0.0, **none)


def laplace(information: Array, gradient: Array) -> tuple[Array, Array]:
    """Log evidence (...) of adding k parameters, and their most probable values (..., k).

    information (..., k, k) that the readings hold on them beside calibration; gradient (..., k) of half the chi-square.
    """
    S = information + np.eye(information.shape[-1])
    S = 0.5 * (S + np.swapaxes(S, -1, -2))
    eta = -np.linalg.solve(S, gradient[..., None])[..., 0]
    return -0.5 * np.sum(gradient * eta, axis=-1) - 0.5 * np.linalg.slogdet(S)[1], eta


class Linear:
    """Residual (K,) and its derivatives (K, n) by the n fitted parameters."""

    def __init__(self, residual: Array, jacobian: Array) -> None:
        self.residual, self.jacobian = residual, jacobian
        self.cholesky = np.linalg.cholesky(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))

    def imitation(self, columns: Array) -> Array:
        """The change (n, k) of the fitted parameters that imitates columns (K, k) best, given their priors."""
        return self.imitation_by(self.jacobian.T @ columns)

    def imitation_by(self, overlap: Array) -> Array:
        """The same for columns whose product jacobian.T @ columns is `overlap` (n, k)."""
        return cho_solve((self.cholesky, True), overlap, check_finite=False)

    def covariance(self) -> Array:
        """Posterior covariance (n, n) of the fitted parameters."""
        return self.imitation_by(np.eye(len(self.cholesky)))

    def gain(self, columns: Array) -> Gain:
        """Of parameters with derivatives `columns` (K, k): exact where the model is linear in them."""
        imitation = self.imitation(columns)
        left = columns - self.jacobian @ imitation
        gradient = columns.T @ self.residual
        log_evidence, eta = laplace(columns.T @ left, gradient)
        return Gain(float(log_evidence), eta, -imitation @ eta, left @ eta, left, -float(gradient @ eta))
