"""Values that the readings bound on one side only.

Where the curve of a tube just reaches the plate in some readings, a longer curve changes nothing and a shorter one
much: chi-square has a kink there. Its curvature on the steep side, which the covariance of a fit follows, says nothing
of the flat one; and on the flat side no slope leads back to where the curve shows.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINKED = ".curved_length"
WIDTH = 2.0  # standard deviations at which the sides are judged
WIDEN = 1.5  # steps of the search along a side, and how much wider than expected a flat one is
UNSEEN = 0.99  # posterior over prior sd from which the readings say nothing of a length
BETTER = 0.5  # log evidence by which a fit from beyond a flat side must be better


def widened(fit: Any) -> Any:
    """The fit (`ctcr.fit.joint.Fit`) with the deviations that its flat sides call for, and a warning where they do."""
    if not hasattr(fit.predict, "residual"):  # of a linear model, which has no kinks
        return fit
    chi_square = _chi_square(fit)
    least, warnings = chi_square(fit.values), []
    covariance = fit.covariance.copy()
    for i, name in enumerate(fit.names):
        sd = np.sqrt(covariance[i, i])
        if not name.endswith(KINKED) or not 0 < sd < 0.5 * fit.prior_sd[i]:
            continue
        # Alone: on the flat side nothing else need follow.
        ways = np.outer([1.0, -1.0], np.eye(len(fit.values))[i])
        most = min(fit.prior_sd[i], abs(fit.values[i]))
        widths = [_width(lambda t, way=way: chi_square(fit.values + t * way) - least, sd, most) for way in ways]
        if max(widths) <= WIDEN * sd:
            continue
        side = "longer" if widths[0] > widths[1] else "shorter"
        warnings.append(f"{name} is bounded on one side only: the readings hardly tell how much {side} it is")
        covariance[i, i] = max(widths) ** 2
    if not warnings:
        return fit
    sd = np.sqrt(np.diag(covariance))
    ratio = np.where(np.isfinite(fit.prior_sd), sd / fit.prior_sd, fit.ratio)
    return replace(fit, covariance=covariance, sd=sd, ratio=ratio, warnings=[*fit.warnings, *warnings])


def crossed(fit: Any, refit: Callable[[Array, Any], Any]) -> Any:
    """The fit, or the better one to which a curve leads that is shorter by its prior deviation, so that it may show.

    refit(start (n,), like): from there, at the weights and inflation of the fit `like`; None: as that fit was made.
    """
    for i, name in enumerate(fit.names):
        if name.endswith(KINKED) and fit.ratio[i] > UNSEEN:
            there = refit(fit.values - fit.prior_sd * np.eye(len(fit.values))[i], fit)
            if there.log_evidence > fit.log_evidence + BETTER:
                fit = refit(there.values, None)
    return fit


def _chi_square(fit: Any):
    """Of readings and prior, as a function of the values; inf where the model fails."""

    def chi_square(values: Array) -> float:
        residual = np.asarray(fit.predict.residual(values)[0]).reshape(-1, 6)
        if np.isnan(residual[fit.used]).all(axis=1).any():
            return np.inf
        shift = (values - fit.prior_mean) / fit.prior_sd
        return float(np.sum(fit.whiten(residual) ** 2) + np.sum(shift[np.isfinite(fit.prior_sd)] ** 2))

    return chi_square


def _width(rise, sd: float, most: float) -> float:
    """Half of how far a value may go to one side until chi-square rises by WIDTH^2; `sd` where both sides are alike."""
    here, there, target = 0.0, WIDTH * sd, WIDTH**2
    low, high = 0.0, rise(there)
    while high < target and there < WIDTH * most:
        here, low, there = there, high, min(WIDEN * there, WIDTH * most)
        high = rise(there)
    if high <= target:
        return there / WIDTH
    return (here + (there - here) * (target - low) / (high - low)) / WIDTH if np.isfinite(high) else here / WIDTH
