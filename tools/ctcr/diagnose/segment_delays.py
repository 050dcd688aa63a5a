"""A delay that is not constant: time segments whose readings are later or earlier than the fitted delay says.

A tracker answers with its latest frame, so that for a while readings may be later by one frame. The residual then
follows the motion, and hysteresis imitates it. Each segment gets a lag of its own with a normal prior, correlated
between segments that are close in time; everything is linear in the lags at a fit.
"""

from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.linearised import Gain, Linear, laplace
from ctcr.effects import catalogue
from ctcr.fit import folds
from ctcr.fit.joint import Fit, likeliest_field
from ctcr.table.measurements import Measurements

CORRECTED = (
    "Errors with the effects found are corrected for that: held-out readings count as late as the readings "
    "before and after them."
)


@dataclass(frozen=True)
class SegmentLags:
    """How much later than the fitted delay each segment is, linearised at a fit."""

    delay: int  # index of the fitted delay
    plain: Linear  # with one delay
    columns: Array  # (K, segments) whitened derivatives by independent lags, from which those of the segments follow
    gain: Gain  # of these
    lag: Array  # (M,) [s] of each row's segment, also in rows that were not fitted
    segment: Integers  # (M,) of each row

    @property
    def log_evidence(self) -> float:
        """Over one delay for all."""
        return self.gain.log_evidence

    @property
    def linear(self) -> Linear:
        """With a lag of each segment."""
        plain, gain = self.plain, self.gain
        residual = plain.residual + self.columns @ gain.values + plain.jacobian @ gain.calibration
        return Linear(residual, np.hstack([plain.jacobian, self.columns]))


def linearised(engine: Engine, fit: Fit) -> Linear:
    """The linear model at a fit, with a lag of each segment where the data ask for it."""
    lags = segment_lags(engine, fit)
    return engine.linear(fit) if lags is None or lags.log_evidence <= 0 else lags.linear


def log_evidence(engine: Engine, fit: Fit) -> float:
    """Of a fit whose segments may have lags of their own."""
    lags = segment_lags(engine, fit)
    return fit.log_evidence + (0.0 if lags is None else max(0.0, lags.log_evidence))


def widened(engine: Engine, fit: Fit) -> Fit:
    """The fit with the standard deviations that lags of segments call for."""
    lags, n = segment_lags(engine, fit), len(fit.names)
    if lags is None or lags.log_evidence <= 0:
        return fit
    more = lags.linear.covariance()[:n, :n] - lags.plain.covariance()
    covariance = fit.covariance + fit.priors.factor @ more @ fit.priors.factor.T
    sd = np.sqrt(np.diag(covariance))
    return replace(fit, covariance=covariance, sd=sd, ratio=sd / fit.prior_sd)


def corrected(engine: Engine, fit: Fit) -> tuple[Fit, list[str]]:
    """The linearised fit to readings that are as late as their segment, and how the lags differ.

    Rows that were not fitted are as late as those before and after them. The fit itself and no message where lags are
    not sure, or leave most of the unexplained chi-square: then the rest may be what causes them.
    """
    lags = segment_lags(engine, fit)
    if lags is None or lags.log_evidence < settings.DECISIVE:
        return fit, []
    more = lags.lag[:, None] * np.nan_to_num(fit.jacobian_all[:, lags.delay].reshape(-1, 6))
    noise = likeliest_field(engine.linear_fit(fit, more=more, noise=engine.noise))
    there = engine.linear_fit(fit, more=more, noise=noise)
    if _unexplained(engine, there) > settings.LAGS_LEAVE * _unexplained(engine, fit):
        return fit, []
    # Once more with its weights: then rows that were not fitted have a residual, too.
    seen = engine.linear_fit(fit, more=more, noise=noise, **there.frozen)
    return seen, [_message(engine, fit, lags)]


def _unexplained(engine: Engine, fit: Fit) -> float:
    """Chi-square beyond what the noise as stated explains."""
    stated = engine.as_stated(fit)
    return max(stated.chi_square + stated.shift_square - stated.bulk_observations, 0.0)


def _message(engine: Engine, fit: Fit, lags: SegmentLags) -> str:
    fitted = np.unique(lags.segment[engine.fitted])
    each = np.array([lags.lag[lags.segment == k][0] for k in fitted])
    text = f"between time segments it varies by {1e3 * each.std():.2g} ms (standard deviation)"
    rate = engine.robot.tracker.rate_Hz
    early, late = fit.values[lags.delay] + np.quantile(each, [0.1, 0.9])
    if rate and abs((late - early) * rate - 1) < settings.ONE_FRAME:
        text += f", {1e3 * early:.2g} to {1e3 * late:.2g} ms, about one frame of the tracker ({1e3 / rate:.3g} ms)"
    return (
        f"The delay is not constant: {text}. Where the tracker and the computer have clocks of their own, no model "
        "predicts that; a robot file holds one delay."
    )


def segment_lags(engine: Engine, fit: Fit) -> SegmentLags | None:
    """None for a fit without a delay."""
    time = engine.measurements.t
    known = catalogue.parameter_of(engine.robot.n_tubes)
    delays = [i for i, name in enumerate(fit.names) if name in known and known[name].quantity == "lag"]
    if not delays or not fit.values[delays[0]] or not np.ptp(time) > 0:
        return None
    (delay,) = delays
    plain, segment = engine.linear(fit), segments(engine.measurements)
    each = np.arange(segment.max() + 1)
    columns, derivative = np.empty((len(plain.residual), len(each))), fit.derivative_where_used(fit.names[delay])
    for some in np.array_split(each, max(1, len(each) // settings.SEGMENTS_AT_ONCE)):
        columns[:, some] = fit.whiten(derivative[:, :, None] * (segment[:, None] == some)[:, None, :])
    middle = np.array([time[segment == k].mean() for k in each])
    apart, spread = np.abs(middle[:, None] - middle), settings.LAG_SPREAD * abs(fit.values[delay])
    crossed, gradient = plain.jacobian.T @ columns, columns.T @ plain.residual
    information = columns.T @ columns - crossed.T @ plain.imitation(columns)
    roots = []
    for part in settings.LAG_CORRELATION:
        alike = np.exp(-apart / (part * np.ptp(time))) if part else np.eye(len(each))
        roots.append(spread * np.linalg.cholesky(alike + 1e-9 * np.eye(len(each))))
    root = max(roots, key=lambda root: laplace(root.T @ information @ root, root.T @ gradient)[0])
    columns = columns @ root
    gain = plain.gain(columns)
    return SegmentLags(delay, plain, columns, gain, (root @ gain.values)[segment], segment)


def segments(measurements: Measurements) -> Integers:
    """The time segment of each row (M,), numbered from 0."""
    group = folds.groups(measurements)
    segment, count = np.zeros(len(group), np.int64), 0
    for k in np.unique(group):
        rows = np.flatnonzero(group == k)
        parts = min(settings.MOST_SEGMENTS // (group.max() + 1), len(rows) // settings.SEGMENT_ROWS)
        parts = min(max(parts, settings.SEGMENTS), len(rows))
        segment[rows] = count + np.arange(len(rows)) * parts // len(rows)
        count += parts
    return segment if count <= settings.MOST_SEGMENTS else segment * settings.MOST_SEGMENTS // count
