"""A delay that is not constant: readings that are later or earlier than the fitted delay says, alone or for a while.

Time stamps scatter, and a tracker answers with its latest frame, so that for a while readings may be later by one
frame. The residual then follows the motion, and hysteresis imitates it. Each reading and each segment of time gets a
lag of its own with a normal prior, correlated between segments that are close in time. Everything is linear in the lags
at a fit; where the data ask for lags, they are noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.linearised import Gain, Linear, laplace
from ctcr.effects import catalogue
from ctcr.fit import folds
from ctcr.fit.joint import Fit, as_stated, with_likeliest_field
from ctcr.table.measurements import Measurements

CORRECTED = (
    "Errors with the effects found are corrected for that: held-out readings count as late as the readings "
    "before and after them."
)


@dataclass(frozen=True)
class Lags:
    """How much later than the fitted delay readings are, linearised at a fit."""

    delay: int  # index of the fitted delay
    scattered: Linear  # with a lag of each reading
    scatter: tuple[float, float]  # log evidence that these gain over one delay for all, chi-square that they remove
    columns: Array  # (K, segments) whitened derivatives by independent lags, from which those of the segments follow
    gain: Gain  # of these, over lags of single readings
    lag: Array  # (M,) [s] of each row's segment, also in rows that were not fitted
    segment: Integers  # (M,) of each row

    @property
    def explained(self) -> tuple[float, float]:
        """Log evidence that lags gain, and chi-square of residual and prior that they remove."""
        evidence, removed = self.scatter
        wanted = self.gain.log_evidence > 0
        return (evidence + self.gain.log_evidence, removed + self.gain.removed) if wanted else self.scatter

    @property
    def linear(self) -> Linear:
        """With the lags that the data ask for."""
        scattered, gain = self.scattered, self.gain
        if gain.log_evidence <= 0:
            return scattered
        residual = scattered.residual + self.columns @ gain.values + scattered.jacobian @ gain.calibration
        return Linear(residual, np.hstack([scattered.jacobian, self.columns]))


def linearised(engine: Engine, fit: Fit) -> Linear:
    """The linear model at a fit, with lags where the data ask for them."""
    lags = lags_of(engine, fit)
    return engine.linear(fit) if lags is None else lags.linear


def explained(engine: Engine, fit: Fit) -> tuple[float, float]:
    """Log evidence that lags gain, and chi-square of residual and prior that they remove; zeros where the data do not
    ask for them."""
    lags = lags_of(engine, fit)
    return (0.0, 0.0) if lags is None else lags.explained


def widened(engine: Engine, fit: Fit) -> Fit:
    """The fit with the standard deviations that lags call for."""
    lags, n = lags_of(engine, fit), len(fit.names)
    if lags is None or lags.explained[0] <= 0:
        return fit
    more = lags.linear.covariance()[:n, :n] - engine.linear(fit).covariance()
    covariance = fit.covariance + fit.priors.factor @ more @ fit.priors.factor.T
    sd = np.sqrt(np.diag(covariance))
    return replace(fit, covariance=covariance, sd=sd, ratio=sd / fit.prior_sd)


def corrected(engine: Engine, fit: Fit) -> tuple[Fit, list[str]]:
    """The linearised fit to readings that are as late as their segment, and how the lags differ.

    Rows that were not fitted are as late as those before and after them. The fit itself and no message where lags are
    not sure, or leave most of the unexplained chi-square: then the rest may be what causes them.
    """
    lags = lags_of(engine, fit)
    if lags is None or lags.gain.log_evidence < settings.DECISIVE:
        return fit, []
    more = lags.lag[:, None] * np.nan_to_num(fit.jacobian_all[:, lags.delay].reshape(-1, 6))
    noise = with_likeliest_field(engine.linear_fit(fit, more=more, noise=engine.noise)).noise
    there = engine.linear_fit(fit, more=more, noise=noise)
    if _unexplained(there) > settings.LAGS_LEAVE * _unexplained(fit):
        return fit, []
    # Once more with its weights: then rows that were not fitted have a residual, too.
    seen = engine.linear_fit(fit, more=more, noise=noise, **there.frozen)
    return seen, [_message(engine, fit, lags)]


def _unexplained(fit: Fit) -> float:
    """Chi-square beyond what the noise as stated explains."""
    stated = as_stated(fit)
    return max(stated.chi_square + stated.shift_square - stated.bulk_observations, 0.0)


def _message(engine: Engine, fit: Fit, lags: Lags) -> str:
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


def lags_of(engine: Engine, fit: Fit) -> Lags | None:
    """None for a fit without a delay."""
    time = engine.measurements.t
    known = catalogue.parameter_of(engine.robot.n_tubes)
    delays = [i for i, name in enumerate(fit.names) if name in known and known[name].quantity == "lag"]
    if not delays or not fit.values[delays[0]] or not np.ptp(time) > 0:
        return None
    (delay,) = delays
    derivative, spread = fit.derivative_where_used(fit.names[delay]), settings.LAG_SPREAD * abs(fit.values[delay])
    plain, segment = engine.linear(fit), segments(engine.measurements)
    each = np.arange(segment.max() + 1)
    columns = np.empty((len(plain.residual), len(each)))
    for some in np.array_split(each, max(1, len(each) // settings.SEGMENTS_AT_ONCE)):
        columns[:, some] = fit.whiten(derivative[:, :, None] * (segment[:, None] == some)[:, None, :])
    roots = [spread * root for root in _correlations(time, segment)]

    def with_scatter(part: float) -> Lags:
        scatter = Scatter(fit, part * spread * derivative)
        scattered, gained = scatter.beside(plain)
        late = scatter.whiten(columns)
        gradient = late.T @ scattered.residual
        crossed = scattered.jacobian.T @ late
        information = late.T @ late - crossed.T @ scattered.imitation_by(crossed)
        root = max(roots, key=lambda root: laplace(root.T @ information @ root, root.T @ gradient)[0])
        gain = scattered.gain(late @ root)
        return Lags(delay, scattered, gained, late @ root, gain, (root @ gain.values)[segment], segment)

    return max(map(with_scatter, settings.LAG_SCATTER), key=lambda lags: lags.explained[0])


def _correlations(time: Array, segment: Integers) -> Iterator[Array]:
    """Roots of the correlation matrices that lags of segments may have, by the times (M,) [s] of their rows."""
    middle = np.array([time[segment == k].mean() for k in range(segment.max() + 1)])
    apart, none = np.abs(middle[:, None] - middle), np.eye(len(middle))
    for part in settings.LAG_CORRELATION:
        alike = np.exp(-apart / (part * np.ptp(time))) if part else none
        yield np.linalg.cholesky(alike + 1e-9 * none)


class Scatter:
    """Noise of independent lags of single readings. The smooth field error is left out: it cannot follow what changes
    from one reading to the next."""

    def __init__(self, fit: Fit, late: Array) -> None:
        """late (M, 6): change of the residual by one standard deviation of the lag."""
        numbers = fit.fitted_numbers
        jitter = fit.inflation * [fit.noise.position_jitter, fit.noise.rotation_jitter]
        self._late = (late * np.repeat(np.sqrt(fit.weights) / jitter, 3, axis=1)).ravel()[numbers]
        self._first, self._row = np.unique(numbers // 6, return_index=True, return_inverse=True)[1:]
        self._variance = self._sums(self._late**2)

    def _sums(self, of_numbers: Array) -> Array:
        """Sum of each row's numbers (K, ...)."""
        return np.add.reduceat(of_numbers, self._first)

    def whiten(self, columns: Array) -> Array:
        """Columns (K, k) that are whitened without these lags, whitened with them too."""
        along = self._sums(self._late[:, None] * columns)
        shrink = 1 / (1 + self._variance + np.sqrt(1 + self._variance))
        return columns - self._late[:, None] * (shrink[:, None] * along)[self._row]

    def beside(self, plain: Linear) -> tuple[Linear, tuple[float, float]]:
        """The linear model with these lags, at its optimum; log evidence that they gain, chi-square that they
        remove."""
        shift = -plain.jacobian.T @ plain.residual  # from the priors, in their standard deviations, at the optimum
        both = self.whiten(np.column_stack([plain.residual, plain.jacobian]))
        there = Linear(both[:, 0], both[:, 1:])
        moved = -there.imitation_by(there.jacobian.T @ there.residual + shift)
        there.residual = there.residual + there.jacobian @ moved
        before, after = (of.residual @ of.residual + at @ at for of, at in ((plain, shift), (there, shift + moved)))
        posterior = 2 * np.log(np.diag(there.cholesky) / np.diag(plain.cholesky)).sum()
        evidence = 0.5 * (before - after - posterior - np.log1p(self._variance).sum())
        return there, (float(evidence), float(before - after))


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
