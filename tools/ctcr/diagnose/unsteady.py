"""A delay that is not always the same: stretches of readings that are late by more or by less than the fitted time.

A tracker answers with its last frame: readings may be late by one frame more for a while, and then no longer. What that
leaves follows the motion, so that hysteresis imitates it. Stretches that follow each other are often late alike.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose.engine import Engine, Gain, Linear, laplace
from ctcr.fit import folds
from ctcr.fit.joint import Fit

Array = NDArray[np.float64]

DELAY = "effects.delay.delay"
STRETCHES = 2  # of each run, at least: out and back
FEWEST = 12  # readings in each of more than these
MOST = 96  # stretches: of more runs several share one, as each is a column of all readings
AT_ONCE = 16  # of these columns are made at a time
SPREAD = 0.2  # standard deviation of a stretch's lag, over the delay
MEMORIES = (0.0, 1 / 16, 1 / 4)  # times, over that of all readings, for which lags stay alike: the likeliest of these
SURE = 5.0  # log evidence from which lags are followed, and told
LEFT = 0.5  # share that they may leave of what noise does not explain
ONE_FRAME = 0.3  # by how much lags may differ by more or less than a frame of the tracker, over it

FOLLOWED = (
    "Errors with the effects found allow for that: readings of runs that no fit saw count as late as those before and "
    "after them."
)


@dataclass(frozen=True)
class Lags:
    """How much later than the fitted delay each stretch is, by slopes at a fit."""

    plain: Linear  # with one delay
    columns: Array  # whitened slopes by independent lags (K, stretches) that give the lags of stretches
    gain: Gain  # of these
    lag: Array  # [s] of each row (M,), in rows that were not fitted too
    stretch: NDArray[np.int64]  # of each row (M,)

    @property
    def log_evidence(self) -> float:
        """Over a delay that is the same throughout."""
        return self.gain.log_evidence

    @property
    def linear(self) -> Linear:
        """With a lag of each stretch."""
        plain, gain = self.plain, self.gain
        residual = plain.residual + self.columns @ gain.values + plain.jacobian @ gain.calibration
        return Linear(residual, np.hstack([plain.jacobian, self.columns]))


def linear(engine: Engine, fit: Fit) -> Linear:
    """Of a fit, where the data ask for it with a lag of each stretch."""
    lags = lags_of(engine, fit)
    return engine.linear(fit) if lags is None or lags.log_evidence <= 0 else lags.linear


def evidence(engine: Engine, fit: Fit) -> float:
    """Log evidence of a fit whose stretches may have lags of their own."""
    lags = lags_of(engine, fit)
    return fit.log_evidence + (0.0 if lags is None else max(0.0, lags.log_evidence))


def widened(engine: Engine, fit: Fit) -> Fit:
    """The fit with the deviations of its values that lags of stretches call for."""
    lags, n = lags_of(engine, fit), len(fit.names)
    if lags is None or lags.log_evidence <= 0:
        return fit
    more = lags.linear.covariance()[:n, :n] - lags.plain.covariance()
    covariance = fit.covariance + more * np.outer(fit.prior_sd, fit.prior_sd)
    sd = np.sqrt(np.diag(covariance))
    return replace(fit, covariance=covariance, sd=sd, ratio=sd / fit.prior_sd)


def followed(engine: Engine, fit: Fit) -> tuple[Fit, list[str]]:
    """The fit by slopes to readings that are as late as their stretch, and how these differ: in rows that were not
    fitted, as late as those before and after them tell. The fit itself and nothing to say where lags are not sure, or
    not most of what noise leaves unexplained: then they may be due to the rest."""
    lags = lags_of(engine, fit)
    if lags is None or lags.log_evidence < SURE:
        return fit, []
    more = lags.lag[:, None] * _slope(fit)
    noise = engine.likeliest_noise(engine.linear_fit(fit, more=more, noise=engine.noise))
    there = engine.linear_fit(fit, more=more, noise=noise)
    if _beyond_noise(engine, there) > LEFT * _beyond_noise(engine, fit):
        return fit, []
    # Once more with its weights: rows that were not fitted have a residual, too.
    seen = engine.linear_fit(fit, more=more, noise=noise, weights=there.weights, inflation=there.inflation)
    return seen, [_in_words(engine, fit, lags)]


def _beyond_noise(engine: Engine, fit: Fit) -> float:
    """Chi-square that noise as stated does not explain."""
    stated = engine.as_stated(fit)
    return max(stated.chi_square + stated.shift_square - stated.bulk_observations, 0.0)


def _in_words(engine: Engine, fit: Fit, lags: Lags) -> str:
    """How the delay of a fit varies."""
    fitted = np.unique(lags.stretch[engine.fitted])
    each = np.array([lags.lag[lags.stretch == k][0] for k in fitted])
    told = f"from stretch to stretch it varies by {1e3 * each.std():.2g} ms (standard deviation)"
    rate = engine.robot.tracker.rate_Hz
    early, late = _delay(fit) + np.quantile(each, [0.1, 0.9])
    if rate and abs((late - early) * rate - 1) < ONE_FRAME:
        told += f", {1e3 * early:.2g} to {1e3 * late:.2g} ms, about one frame of the tracker ({1e3 / rate:.3g} ms)"
    return (
        f"The delay is not the same throughout: {told}. Where the tracker and the computer keep their own time, no "
        "model foretells that; a robot file holds one delay."
    )


def lags_of(engine: Engine, fit: Fit) -> Lags | None:
    """None of a fit without a delay."""
    time = engine.measurements.t
    if DELAY not in fit.names or not _delay(fit) or not np.ptp(time) > 0:
        return None
    plain, stretch = engine.linear(fit), _stretches(engine)
    each = np.arange(stretch.max() + 1)
    columns, slope = np.empty((len(plain.residual), len(each))), fit.slope_where_used(DELAY)
    for some in np.array_split(each, max(1, len(each) // AT_ONCE)):
        columns[:, some] = fit.whiten(slope[:, :, None] * (stretch[:, None] == some)[:, None, :])
    middle = np.array([time[stretch == k].mean() for k in each])
    apart, spread = np.abs(middle[:, None] - middle), SPREAD * abs(_delay(fit))
    crossed, gradient = plain.jacobian.T @ columns, columns.T @ plain.residual
    information = columns.T @ columns - crossed.T @ plain.imitation(columns)
    roots = []
    for memory in MEMORIES:
        alike = np.exp(-apart / (memory * np.ptp(time))) if memory else np.eye(len(each))
        roots.append(spread * np.linalg.cholesky(alike + 1e-9 * np.eye(len(each))))
    root = max(roots, key=lambda root: laplace(root.T @ information @ root, root.T @ gradient)[0])
    columns = columns @ root
    gain = plain.gain(columns)
    return Lags(plain, columns, gain, (root @ gain.values)[stretch], stretch)


def _slope(fit: Fit) -> Array:
    """Of the residual by the delay (M, 6)."""
    return np.nan_to_num(fit.jacobian_all[:, fit.names.index(DELAY)].reshape(-1, 6))


def _delay(fit: Fit) -> float:
    return float(fit.values[fit.names.index(DELAY)])


def _stretches(engine: Engine) -> NDArray[np.int64]:
    """The stretch of each row (M,), numbered from 0."""
    group = folds.groups(engine.measurements)
    stretch, count = np.zeros(len(group), np.int64), 0
    for k in np.unique(group):
        rows = np.flatnonzero(group == k)
        parts = min(MOST // (group.max() + 1), len(rows) // FEWEST)
        parts = min(max(parts, STRETCHES), len(rows))
        stretch[rows] = count + np.arange(len(rows)) * parts // len(rows)
        count += parts
    return stretch if count <= MOST else stretch * MOST // count
