"""A delay that is not always the same: stretches of readings that are late by more or by less than the fitted time.

A tracker answers with its last frame: readings may be late by one frame more for a while, and then no longer. What that
leaves follows the motion, so that hysteresis imitates it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose import split
from ctcr.diagnose.engine import Engine, Gain, Linear
from ctcr.identify import Fit
from ctcr.measurements import Measurements

Array = NDArray[np.float64]

DELAY = "effects.delay.delay"
STRETCHES = 2  # of each run: out and back
MOST = 48  # stretches: of more runs several share one, as each is a column of all readings
SPREAD = 0.2  # standard deviation of a stretch's lag, over the delay
TOLD = 5.0  # log evidence from which it is said


def linear(engine: Engine, fit: Fit) -> Linear:
    """Of a fit, where the data ask for it with a lag of each stretch."""
    plain, lags, gain = _stretched(engine, fit)
    if gain is None or gain.log_evidence <= 0:
        return plain
    residual = plain.residual + lags @ gain.values + plain.jacobian @ gain.calibration
    return Linear(residual, np.hstack([plain.jacobian, lags]))


def evidence(engine: Engine, fit: Fit) -> float:
    """Log evidence of a fit whose stretches may have lags of their own."""
    gain = _stretched(engine, fit)[2]
    return fit.log_evidence + (0.0 if gain is None else max(0.0, gain.log_evidence))


def widened(engine: Engine, fit: Fit) -> Fit:
    """The fit with the deviations of its values that lags of stretches call for."""
    plain, stretched = engine.linear(fit), linear(engine, fit)
    n = len(fit.names)
    if stretched.jacobian.shape[1] == n:
        return fit
    more = stretched.covariance()[:n, :n] - plain.covariance()
    covariance = fit.covariance + more * np.outer(fit.prior_sd, fit.prior_sd)
    sd = np.sqrt(np.diag(covariance))
    return replace(fit, covariance=covariance, sd=sd, ratio=sd / fit.prior_sd)


def in_words(engine: Engine, fit: Fit) -> list[str]:
    """How the delay varies; nothing where it does not, or there is none."""
    gain = _stretched(engine, fit)[2]
    if gain is None or gain.log_evidence < TOLD:
        return []
    spread = 1e3 * SPREAD * abs(_delay(fit)) * float(np.sqrt(np.mean(gain.values**2)))
    return [
        f"The delay is not the same throughout: between the halves of runs it varies by {spread:.2g} ms (standard "
        "deviation). Where the tracker and the computer keep their own time, no model foretells that."
    ]


def _stretched(engine: Engine, fit: Fit) -> tuple[Linear, Array, Gain | None]:
    """The fit's slopes, those of a lag of each stretch (K, stretches) in units of its prior, and what these bring."""
    plain = engine.linear(fit)
    if DELAY not in fit.names or not _delay(fit):
        return plain, np.empty((len(plain.residual), 0)), None
    slope = np.nan_to_num(fit.jacobian_all[:, fit.names.index(DELAY)].reshape(-1, 6))
    stretch = _stretches(engine.measurements)
    each = np.arange(stretch.max() + 1)
    lags = fit.whiten(SPREAD * _delay(fit) * slope[:, :, None] * (stretch[:, None] == each)[:, None, :])
    return plain, lags, plain.gain(lags)


def _delay(fit: Fit) -> float:
    return float(fit.values[fit.names.index(DELAY)])


def _stretches(measurements: Measurements) -> NDArray[np.int64]:
    """The stretch of each row (M,), numbered from 0."""
    group = split.groups(measurements)
    stretch = np.zeros(len(group), np.int64)
    for k in np.unique(group):
        rows = np.flatnonzero(group == k)
        stretch[rows] = STRETCHES * k + np.arange(len(rows)) * STRETCHES // len(rows)
    count = int(stretch.max()) + 1
    return stretch if count <= MOST else stretch * MOST // count
