"""How much two readings of the same thing differ: the noise floor, and the difference between directions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ctcr.compare.visits import OPPOSITE, SAME, Revisits, Stops

Array = NDArray[np.float64]
FEWEST_PAIRS = 5  # below this many same-direction revisits the floor is taken from elsewhere
FEWEST_DWELLS = 3
BLOCKS = 12
NOTABLE = 1.5  # visits that differ by less than this many times the stated jitter are no news


@dataclass(frozen=True)
class NoiseFloor:
    """Scatter of one reading. Axis values are standard deviations per axis, rms is the 3-D length."""

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
    uncertainty_mm: float  # standard error from blocks of the path
    maximum_mm: float
    typical_rms_mm: float  # RMS that the median of the pairs implies: what a few outliers do not sway
    outliers: int  # pairs that differ more than noise of the tracker's scatter does once in 10^5
    floor_mm: float  # half the RMS: no model without history can be better
    p_against_same: float  # that they differ no more than same-direction visits; NaN with too few of those
    p_against_quiet: float  # that they differ no more than NOTABLE times the stated jitter or the scatter at rest
    quiet_rms_mm: float  # difference of two visits that this jitter or scatter gives
    same_rms_mm: float  # difference of same-direction visits, NaN without
    miss_mm: float  # usual joint distance between the matched visits
    along_share: float  # share of the squared difference along the tip's motion, NaN if unknown
    delay_s: float  # readings late by this much would explain most of it; NaN without a time axis
    delay_uncertainty_s: float
    rms_without_delay_mm: float  # what is left of the RMS once that delay is taken out
    maximum_without_delay_mm: float


def noise_floor(stops: Stops, revisits: Revisits, stated_mm: float) -> NoiseFloor:
    """Scatter of one reading from same-direction revisits inside a run, else from rests, else as stated."""
    pairs = revisits.select((revisits.kind == SAME) & ~revisits.between_runs)
    resting = np.isfinite(stops.dwell_variance)
    freedom = (stops.size[resting] - 1).sum()
    rest_square = np.sum(stops.dwell_variance[resting] * (stops.size[resting] - 1))
    rest_axis = float(np.sqrt(rest_square / freedom)) if freedom else np.nan
    if len(pairs) >= FEWEST_PAIRS:
        variance = np.sum(pairs.difference**2, axis=1) / pairs.noise_factor / 3
        axis = float(np.sqrt(variance.mean()))
        spread = block_error(variance, blocks_of(stops.run[pairs.later]))
        source, uncertainty = "revisits", spread / (2 * axis) if axis > 0 else np.nan
    elif resting.sum() >= 1 and freedom >= 10:
        source, axis, uncertainty = "rest", rest_axis, rest_axis / np.sqrt(6 * freedom)
    else:
        source, axis, uncertainty = "stated", stated_mm * 1e-3, np.nan
    return NoiseFloor(
        source,
        axis * 1e3,
        float(uncertainty) * 1e3,
        axis * np.sqrt(3) * 1e3,
        len(pairs),
        int(resting.sum()),
        rest_axis * 1e3,
        float(stated_mm),
    )


def direction_difference(
    stops: Stops, revisits: Revisits, floor: NoiseFloor, tip_step: Array, tip_velocity: Array
) -> DirectionDifference | None:
    """DirectionDifference of the opposite visits inside a run, or None when there are none.

    tip_step, tip_velocity (S, 3): predicted tip motion into each visit [m] and velocity there [m/s], tracker
    frame, NaN where unknown.
    Two tests by order, which a few outliers do not sway: against visits from the same direction, which share
    everything but the direction; and against the tracker's own scatter, since a pose that depends on history
    differs between same-direction visits as well.
    """
    inside = revisits.select(~revisits.between_runs)
    opposite, same = inside.select(inside.kind == OPPOSITE), inside.select(inside.kind == SAME)
    if len(opposite) == 0:
        return None
    square, same_square = (np.sum(pairs.difference**2, axis=1) for pairs in (opposite, same))
    blocks, same_blocks = blocks_of(stops.run[opposite.later]), blocks_of(stops.run[same.later])
    scaled, reference = square / opposite.noise_factor, same_square / same.noise_factor
    if len(opposite) > 20 * BLOCKS:  # a dense stream, whose neighbours are no independent witnesses
        scaled, reference = _block_quartiles(scaled, blocks), _block_quartiles(reference, same_blocks)
    known = [axis for axis in (floor.axis_mm, floor.rest_axis_mm, floor.stated_axis_mm) if np.isfinite(axis)]
    quiet = min(known, default=np.nan) * 1e-3
    p_same = np.nan
    if len(same) >= FEWEST_PAIRS:
        p_same = stats.mannwhitneyu(scaled, reference, alternative="greater").pvalue
    p_quiet = _beyond(square / opposite.noise_factor, NOTABLE * quiet, blocks) if np.isfinite(quiet) else np.nan
    rms = float(np.sqrt(square.mean()))
    motion = tip_step[opposite.later]
    length = np.linalg.norm(motion, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.sum(opposite.difference * motion, axis=1) / length
    known = np.isfinite(along)
    share = float(np.sum(along[known] ** 2) / np.sum(square[known])) if known.any() else np.nan
    delay, delay_error, left_rms, left_maximum = _delay(opposite, blocks, tip_velocity)
    return DirectionDifference(
        pairs=len(opposite),
        rms_mm=rms * 1e3,
        uncertainty_mm=block_error(square, blocks) / (2 * max(rms, 1e-12)) * 1e3,
        maximum_mm=float(np.sqrt(square.max())) * 1e3,
        typical_rms_mm=float(np.sqrt(np.median(square) * 3 / stats.chi2.median(3))) * 1e3,
        outliers=int(np.sum(square / opposite.noise_factor > stats.chi2.isf(1e-5, 3) * quiet**2)),
        floor_mm=rms / 2 * 1e3,
        p_against_same=float(p_same),
        p_against_quiet=float(p_quiet),
        quiet_rms_mm=float(quiet * np.sqrt(6)) * 1e3,
        same_rms_mm=_rms_mm(same_square),
        miss_mm=float(np.median(opposite.miss)) * 1e3,
        along_share=share,
        delay_s=delay,
        delay_uncertainty_s=delay_error,
        rms_without_delay_mm=left_rms,
        maximum_without_delay_mm=left_maximum,
    )


def _delay(opposite: Revisits, blocks: NDArray, velocity: Array) -> tuple[float, float, float, float]:
    """Delay [s] of readings behind joints, its standard error, and RMS and maximum [mm] of what it leaves.

    A reading late by tau errs by -tau times the tip velocity, so two passes differ by -tau times the difference
    of their velocities; tau is its least-squares value over the pairs.
    """
    weight = opposite.weight[:, None]
    end = np.minimum(opposite.earlier + (opposite.weight > 0), len(velocity) - 1)
    passing = (1 - weight) * velocity[opposite.earlier] + weight * velocity[end]
    contrast = velocity[opposite.later] - passing
    known = np.isfinite(contrast).all(axis=1)
    energy = np.sum(contrast[known] ** 2)
    if known.sum() < FEWEST_PAIRS or energy == 0:
        return (np.nan,) * 4
    contrast, difference = contrast[known], opposite.difference[known]
    delay = -np.sum(contrast * difference) / energy
    left = difference + delay * contrast
    score = np.bincount(blocks[known], np.sum(contrast * left, axis=1))
    length = np.linalg.norm(left, axis=1) * 1e3
    return (
        float(delay),
        float(np.sqrt(np.sum(score**2)) / energy),
        float(np.sqrt(np.mean(length**2))),
        float(length.max()),
    )


def blocks_of(run: NDArray) -> NDArray:
    """Blocks that may be treated as independent: runs if there are six or more, else stretches of the path."""
    names, label = np.unique(run, return_inverse=True)
    if len(names) >= 6:
        return label
    return np.arange(len(run)) * BLOCKS // max(len(run), 1)


def block_error(values: Array, blocks: NDArray) -> float:
    """Standard error of the mean of (P,) values whose blocks are independent of one another."""
    count = np.bincount(blocks)
    total = np.bincount(blocks, values)[count > 0]
    count = count[count > 0]
    if len(count) < 2:
        return float("nan")
    excess = total - values.mean() * count
    return float(np.sqrt(len(count) / (len(count) - 1) * np.sum(excess**2)) / len(values))


def _rms_mm(square: Array) -> float:
    return float(np.sqrt(square.mean())) * 1e3 if len(square) else float("nan")


def _block_quartiles(values: Array, blocks: NDArray) -> Array:
    return np.array([np.percentile(values[blocks == block], 75) for block in np.unique(blocks)])


def _beyond(square: Array, axis: float, blocks: NDArray) -> float:
    """p-value that no more than a quarter of (P,) squared 3-D distances lie beyond the upper quartile of noise.

    axis: the noise of one reading per axis. The share beyond is judged by its scatter from block to block.
    """
    beyond = (square > stats.chi2.ppf(0.75, 3) * axis**2).astype(float)
    error = max(np.nan_to_num(block_error(beyond, blocks)), np.sqrt(0.25 * 0.75 / len(beyond)))
    return float(stats.norm.sf((beyond.mean() - 0.25) / error))
