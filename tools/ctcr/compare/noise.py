"""Scatter of one reading, by which readings repeat, and hysteresis: errors that depend on the direction of approach."""

from dataclasses import dataclass

import numpy as np
import scipy  # not scipy.stats, which takes half a second: scipy loads it when it is asked for
from scipy.special import chdtri, ndtr

from ctcr import settings
from ctcr.arrays import Array, Integers, robust_rms
from ctcr.compare.crossvalidation import block_error, group_quantiles, segments
from ctcr.compare.visits import OPPOSITE, SAME, Revisits, Stops


@dataclass(frozen=True)
class SensorJitter:
    """The scatter of one reading. Axis values are standard deviations per axis, rms is the 3-D length."""

    source: str  # "revisits", "rest" or "stated"
    axis_mm: float
    uncertainty_mm: float  # standard error of axis_mm, NaN when stated
    rms_mm: float
    pairs: int  # same-direction revisits inside a run
    dwells: int  # rests with three rows or more
    rest_axis_mm: float  # scatter inside the rests, NaN without
    stated_axis_mm: float  # the tracker's jitter in the robot file, NaN if not stated


@dataclass(frozen=True)
class DirectionDifference:
    """Difference of the errors between visits of the same joints from opposite directions [mm]."""

    pairs: int
    rms_mm: float
    uncertainty_mm: float  # standard error from independent blocks of the path
    maximum_mm: float
    typical_rms_mm: float  # RMS that the median of the pairs implies: a few outliers do not move it
    outliers: int  # pairs that differ more than noise of the tracker's scatter does once in 10^5
    moved: dict[str, int]  # pairs by what moved into the later visit: rotation, translation, both
    floor_mm: float  # half the RMS: no model without history can be better
    p_against_same: float  # that they differ no more than same-direction visits; NaN with too few of those
    p_against_quiet: float  # that they differ no more than NOTABLE times the stated jitter or the scatter at rest
    quiet_rms_mm: float  # difference of two visits that this jitter or scatter gives
    same_rms_mm: float  # difference of same-direction visits, NaN without
    miss_mm: float  # usual joint distance between the matched visits
    along_share: float  # fraction of the squared difference along the tip's motion, NaN if unknown
    delay_s: float  # least-squares delay of the readings behind the joints; NaN without a time axis
    delay_uncertainty_s: float
    rms_without_delay_mm: float  # RMS of the residual once that delay is removed
    maximum_without_delay_mm: float


def sensor_jitter(stops: Stops, revisits: Revisits, stated_mm: float) -> SensorJitter:
    """Scatter of one reading from same-direction revisits inside a run, else from rests, else as stated."""
    pairs = revisits.inside(SAME)
    resting = np.isfinite(stops.dwell_variance)
    freedom = stops.size[resting] - 1
    rest_square = np.sum(stops.dwell_variance[resting] * freedom)
    rest_axis = float(np.sqrt(rest_square / freedom.sum())) if resting.any() else np.nan
    if len(pairs) >= settings.FEWEST_PAIRS:
        variance = pairs.square / pairs.noise_factor / 3
        source, axis = "revisits", float(np.sqrt(variance.mean()))
        error = block_error(variance, segments(stops.run[pairs.later])) / (2 * axis) if axis > 0 else np.nan
    elif freedom.sum() >= settings.FEWEST_FREEDOM:
        source, axis, error = "rest", rest_axis, rest_axis / np.sqrt(6 * freedom.sum())
    else:
        source, axis, error = "stated", stated_mm * 1e-3, np.nan
    return SensorJitter(
        source=source,
        axis_mm=axis * 1e3,
        uncertainty_mm=float(error) * 1e3,
        rms_mm=axis * np.sqrt(3) * 1e3,
        pairs=len(pairs),
        dwells=int(resting.sum()),
        rest_axis_mm=rest_axis * 1e3,
        stated_axis_mm=float(stated_mm),
    )


def direction_difference(
    stops: Stops, revisits: Revisits, floor: SensorJitter, tip_step: Array, tip_velocity: Array
) -> DirectionDifference | None:
    """DirectionDifference of the opposite visits inside a run, or None when there are none.

    tip_step, tip_velocity (S, 3): predicted tip motion into each visit [m] and velocity there [m/s], tracker
    frame, NaN where unknown.
    Two rank tests, which a few outliers do not sway, compare the difference with visits from the same direction, which
    share all but the direction, and with the tracker's own scatter: a pose that depends on history may differ between
    same-direction visits as well.
    """
    opposite, same = revisits.inside(OPPOSITE), revisits.inside(SAME)
    if len(opposite) == 0:
        return None
    blocks, same_blocks = segments(stops.run[opposite.later]), segments(stops.run[same.later])
    square = opposite.square
    scaled, reference = (pairs.square / pairs.noise_factor for pairs in (opposite, same))
    known = [axis for axis in (floor.axis_mm, floor.rest_axis_mm, floor.stated_axis_mm) if np.isfinite(axis)]
    quiet = min(known, default=np.nan) * 1e-3
    p_quiet = beyond(scaled, settings.NOTABLE * quiet, blocks) if known else np.nan
    outliers = int(np.sum(scaled > chdtri(3, settings.OUTLYING_PAIR) * quiet**2))
    if len(opposite) > settings.DENSE_STREAM * settings.PATH_SEGMENTS:  # neighbours are not independent
        scaled, reference = _block_quartiles(scaled, blocks), _block_quartiles(reference, same_blocks)
    p_same = np.nan
    if len(same) >= settings.FEWEST_PAIRS:
        p_same = p_larger(scaled, reference)
    rms = float(np.sqrt(square.mean()))
    motion = tip_step[opposite.later]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.sum(opposite.difference * motion, axis=1) / np.linalg.norm(motion, axis=1)
    moved = np.isfinite(along)
    delay, delay_error, left = _delay(opposite, blocks, tip_velocity)
    return DirectionDifference(
        pairs=len(opposite),
        rms_mm=rms * 1e3,
        uncertainty_mm=block_error(square, blocks) / (2 * max(rms, 1e-12)) * 1e3,
        maximum_mm=float(np.sqrt(square.max())) * 1e3,
        typical_rms_mm=robust_rms(np.sqrt(square), 3) * 1e3,
        outliers=outliers,
        moved=_moved(stops, opposite),
        floor_mm=rms / 2 * 1e3,
        p_against_same=float(p_same),
        p_against_quiet=float(p_quiet),
        quiet_rms_mm=float(quiet * np.sqrt(6)) * 1e3,
        same_rms_mm=rms_mm(same.square),
        miss_mm=float(np.median(opposite.miss)) * 1e3,
        along_share=float(np.sum(along[moved] ** 2) / np.sum(square[moved])) if moved.any() else np.nan,
        delay_s=delay,
        delay_uncertainty_s=delay_error,
        rms_without_delay_mm=rms_mm(left),
        maximum_without_delay_mm=float(np.sqrt(left.max())) * 1e3 if len(left) else np.nan,
    )


def _moved(stops: Stops, pairs: Revisits) -> dict[str, int]:
    """How many pairs come to the later visit by rotation alone, by translation alone, by both."""
    step = np.abs(stops.scaled[pairs.later] - stops.scaled[np.maximum(pairs.later - 1, 0)])
    translated, rotated = (part.max(axis=1) > settings.REST for part in np.split(step, 2, axis=1))
    return {
        "rotation": int(np.sum(rotated & ~translated)),
        "translation": int(np.sum(translated & ~rotated)),
        "both": int(np.sum(translated & rotated)),
    }


def _delay(opposite: Revisits, blocks: Integers, velocity: Array) -> tuple[float, float, Array]:
    """Delay [s] of readings behind joints, its standard error, and the squared differences [m^2] that it leaves.

    A reading late by tau errs by -tau times the tip velocity, so two passes differ by -tau times the difference
    of their velocities; tau is its least-squares value over the pairs.
    """
    weight = opposite.weight[:, None]
    passing = (1 - weight) * velocity[opposite.earlier] + weight * velocity[opposite.end]
    contrast = velocity[opposite.later] - passing
    known = np.isfinite(contrast).all(axis=1)
    contrast, difference = contrast[known], opposite.difference[known]
    energy = np.sum(contrast**2)
    if known.sum() < settings.FEWEST_PAIRS or energy == 0:
        return np.nan, np.nan, np.empty(0)
    delay = -np.sum(contrast * difference) / energy
    left = difference + delay * contrast
    score = np.bincount(blocks[known], np.sum(contrast * left, axis=1))
    return float(delay), float(np.sqrt(np.sum(score**2)) / energy), np.sum(left**2, axis=1)


def rms_mm(square: Array) -> float:
    """RMS [mm] of vectors by their squared lengths (P,) [m^2]; NaN without any."""
    return float(np.sqrt(square.mean())) * 1e3 if len(square) else float("nan")


def _block_quartiles(values: Array, blocks: Integers) -> Array:
    return group_quantiles(values, np.unique(blocks, return_inverse=True)[1], 0.75)


def p_larger(sample: Array, reference: Array) -> float:
    """P-value of the rank test that a sample (K,) is not larger than a reference (L,)."""
    return float(scipy.stats.mannwhitneyu(sample, reference, alternative="greater").pvalue)


def beyond(square: Array, axis: float, blocks: Integers) -> float:
    """p-value that no more than a quarter of P distances lie beyond the upper quartile of noise.

    square: the squared 3-D distances (P,) [m^2]; axis: standard deviation of the noise along one axis [m]; blocks (P,):
    the block of each. The fraction beyond is judged by its scatter from block to block.
    """
    beyond = (square > chdtri(3, 0.25) * axis**2).astype(float)
    error = max(np.nan_to_num(block_error(beyond, blocks)), np.sqrt(0.25 * 0.75 / len(beyond)))
    return float(ndtr((0.25 - beyond.mean()) / error))
