"""Errors that are constant over the table or over a run: a shift, a turned tracker frame, offsets of runs."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask, robust_rms
from ctcr.compare.crossvalidation import Folds, Regression, chance, group_means, segments
from ctcr.compare.noise import SensorJitter, beyond, p_larger, rms_mm
from ctcr.compare.sample import Sample
from ctcr.compare.visits import SAME, Revisits, Stops
from ctcr.frames import rigid_motion


@dataclass(frozen=True)
class Shift:
    """A constant error vector."""

    vector_mm: tuple[float, float, float]  # mean error, tracker frame
    size_mm: float
    share: float  # of the squared error, held out
    p_value: float


@dataclass(frozen=True)
class FrameTurn:
    """Best rigid motion of the predicted tips onto the measured ones, tracker frame."""

    turn_deg: float
    axis: tuple[float, float, float]
    rms_before_mm: float  # after the shift alone, held out
    rms_after_mm: float  # after shift and turn, held out

    @property
    def share(self) -> float:
        """Fraction of the squared error left by the shift that the turn explains, held out."""
        return 1 - (self.rms_after_mm / self.rms_before_mm) ** 2 if self.rms_before_mm > 0 else 0.0

    @property
    def gross(self) -> bool:
        """Whether the frame is wrong by more than small corrections describe."""
        return self.turn_deg > settings.GROSS_TURN_DEG and self.share > settings.GROSS_TURN_EXPLAINED


@dataclass(frozen=True)
class RunOffsets:
    """Whether the same joints give other errors in another run."""

    pairs_between: int
    pairs_within: int
    rms_between_mm: float
    rms_within_mm: float
    p_value: float  # NaN when too few joints were visited in two runs
    noise_mm: float  # difference of two visits by noise, with which they are compared where too few are inside a run
    share: float  # of the squared error explained by one vector a run, in sample
    outlying: tuple[int, ...]  # runs whose mean error is an outlier, though others came near their joints
    elsewhere: tuple[int, ...]  # runs whose mean error is an outlier too, near whose joints no other run came
    outlying_mm: float  # their usual distance from the others
    found: bool  # whether the runs do not share one frame and homing


def find_shift(error: Array, folds: Folds) -> Shift:
    """Constant error of (K, 3) vectors [m], judged on held-out blocks; sign flips of blocks give chance."""
    square = float(np.sum(error**2))
    gains = square - Regression(np.ones((len(error), 1)), folds).unexplained(error)
    mean = error.mean(axis=0) * 1e3
    share = float(gains[0]) / max(square, 1e-300)
    return Shift(tuple(mean), float(np.linalg.norm(mean)), share, chance(gains[0], gains[1:]))


def find_turn(predicted: Array, measured: Array, folds: Folds) -> FrameTurn:
    """FrameTurn of predicted (K, 3) onto measured (K, 3) [m], judged on held-out blocks."""
    before, after = np.empty(len(predicted)), np.empty(len(predicted))
    for block in range(folds.count):
        out = folds.label == block
        turn, shift = rigid_motion(predicted[~out], measured[~out])
        after[out] = np.sum((measured[out] - predicted[out] @ turn.T - shift) ** 2, axis=1)
        mean = (measured[~out] - predicted[~out]).mean(axis=0)
        before[out] = np.sum((measured[out] - predicted[out] - mean) ** 2, axis=1)
    vector = Rotation.from_matrix(rigid_motion(predicted, measured)[0]).as_rotvec()
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 0 else np.array([0.0, 0.0, 1.0])
    return FrameTurn(float(np.degrees(angle)), tuple(axis), rms_mm(before), rms_mm(after))


def find_run_offsets(sample: Sample, stops: Stops, revisits: Revisits, noise: SensorJitter) -> RunOffsets:
    """Compare visits of the same joints in different runs with visits inside one run, or where there are too few, those
    from the same direction with the noise.

    Offsets count as found when these visits differ more at LEVEL, or when some runs lie far from the others.
    """
    square, error = revisits.square, sample.error
    between, within = square[revisits.between_runs], square[~revisits.between_runs]
    p_value, alike = np.nan, revisits.select((revisits.kind == SAME) & revisits.between_runs)
    if min(len(between), len(within)) >= settings.FEWEST_PAIRS:
        p_value = p_larger(between, within)
    elif len(alike) >= settings.FEWEST_PAIRS and np.isfinite(noise.axis_mm):
        scaled, axis = alike.square / alike.noise_factor, settings.NOTABLE * 1e-3 * noise.axis_mm
        p_value = beyond(scaled, axis, segments(stops.run[alike.later]))
    names, label = np.unique(sample.run, return_inverse=True)
    means = group_means(error, label)
    around = np.sum((error - error.mean(axis=0)) ** 2)
    distance = np.linalg.norm(means - np.median(means, axis=0), axis=1)
    distant = distance > settings.OUTLYING_RUN * max(robust_rms(distance, 3), 1e-12)
    distant &= len(names) >= settings.FEWEST_BLOCKS
    far = _far_runs(sample, label, distant)
    return RunOffsets(
        pairs_between=len(between),
        pairs_within=len(within),
        rms_between_mm=rms_mm(between),
        rms_within_mm=rms_mm(within),
        p_value=p_value,
        noise_mm=float(np.sqrt(6) * noise.axis_mm),
        share=float(1 - np.sum((error - means[label]) ** 2) / max(around, 1e-300)),
        outlying=tuple(names[far].tolist()),
        elsewhere=tuple(names[distant & ~far].tolist()),
        outlying_mm=float(np.median(distance[far])) * 1e3 if far.any() else 0.0,
        found=bool(p_value <= settings.LEVEL or far.any()),
    )


def _far_runs(sample: Sample, label: Integers, distant: Mask) -> Mask:
    """The distant runs whose joints cannot explain why their mean error is an outlier.

    Runs visit different joints, so their errors may differ. But between two readings the error hardly changes by more
    than the tip moves: a change far beyond the joint distance to the nearest reading of another run belongs to the run.
    """
    far, near, error = distant.copy(), ~distant[label], sample.error
    tree = cKDTree(sample.motion.scaled[near])
    for run in np.flatnonzero(far):
        mine = np.flatnonzero(label == run)
        mine = mine[:: max(1, len(mine) // settings.PROBES)]
        gap, index = tree.query(sample.motion.scaled[mine])
        change = np.linalg.norm(error[mine] - error[near][index], axis=1)
        far[run] = np.median(change) > settings.BEYOND_MOTION * np.median(gap)
    return far
