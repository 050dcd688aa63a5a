"""Values that the readings bound on one side only.

Where the curve of a tube just reaches the plate in some readings, a longer curve changes nothing and a shorter one
much: chi-square has a kink there. The covariance of a fit follows the curvature of chi-square on the steep side, which
says nothing of the flat one; and on the flat side the gradient does not lead back to where the curve shows.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.fit.result import Fit
from ctcr.model.protocol import LinearModel


def widened(fit: Fit) -> Fit:
    """The fit with the standard deviations that its flat sides call for, and a warning where they do."""
    if isinstance(fit.model, LinearModel):  # it has no kinks
        return fit
    chi_square = _chi_square(fit)
    least, warnings = chi_square(fit.values), []
    covariance = fit.covariance.copy()
    for i, name in enumerate(fit.names):
        sd = np.sqrt(covariance[i, i])
        if not name.endswith(settings.KINKED) or not 0 < sd < 0.5 * fit.prior_sd[i]:
            continue
        # Alone: on the flat side nothing else need follow.
        ways = np.outer([1.0, -1.0], np.eye(len(fit.values))[i])
        most = min(fit.prior_sd[i], abs(fit.values[i]))
        widths = [_width(lambda t, way=way: chi_square(fit.values + t * way) - least, sd, most) for way in ways]
        if max(widths) <= settings.ONE_SIDED_WIDEN * sd:
            continue
        side = "longer" if widths[0] > widths[1] else "shorter"
        warnings.append(f"{name} is bounded on one side only: the readings hardly determine how much {side} it is")
        covariance[i, i] = max(widths) ** 2
    if not warnings:
        return fit
    sd = np.sqrt(np.diag(covariance))
    ratio = np.where(np.isfinite(fit.prior_sd), sd / fit.prior_sd, fit.ratio)
    return replace(fit, covariance=covariance, sd=sd, ratio=ratio, warnings=[*fit.warnings, *warnings])


def restarted(fit: Fit, refit: Callable[[Array, Fit | None], Fit]) -> Fit:
    """The fit, or the better one beyond a kink: restarted with a curve shorter by its prior sd, so that it may show.

    refit(start (n,), like): from there, at the weights and inflation of the fit `like`; None: as that fit was made.
    """
    for i, name in enumerate(fit.names):
        if name.endswith(settings.KINKED) and fit.ratio[i] > settings.ONE_SIDED_UNSEEN:
            there = refit(fit.values - fit.prior_sd * np.eye(len(fit.values))[i], fit)
            if there.log_evidence > fit.log_evidence + settings.COARSE:
                fit = refit(there.values, None)
    return fit


def _chi_square(fit: Fit) -> Callable[[Array], float]:
    """Of readings and prior, as a function of the values; inf where the model fails."""
    precision = fit.priors.precision

    def chi_square(values: Array) -> float:
        residual = fit.model.residual(values)[0].reshape(-1, 6)
        if np.isnan(residual[fit.used]).all(axis=1).any():
            return np.inf
        shift = values - fit.prior_mean
        return float(np.sum(fit.whiten(residual) ** 2) + shift @ precision @ shift)

    return chi_square


def _width(rise: Callable[[float], float], sd: float, most: float) -> float:
    """How far a value may go to one side until chi-square rises by width^2, over that width: `sd` of a parabola."""
    width = settings.ONE_SIDED_WIDTH
    here, there, target = 0.0, width * sd, width**2
    low, high = 0.0, rise(there)
    while high < target and there < width * most:
        here, low, there = there, high, min(settings.ONE_SIDED_WIDEN * there, width * most)
        high = rise(there)
    if high <= target:
        return there / width
    return (here + (there - here) * (target - low) / (high - low)) / width if np.isfinite(high) else here / width
