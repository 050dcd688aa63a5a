"""Errors that are the same everywhere or all through a run: a shift, a turned frame, runs that are off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.spatial import cKDTree

from ctcr.compare.blocks import FEWEST_RUNS
from ctcr.compare.crossvalidation import Folds, chance, unexplained
from ctcr.compare.noise import FEWEST_PAIRS
from ctcr.compare.sample import Sample
from ctcr.compare.visits import Revisits

Array = NDArray[np.float64]
GROSS_TURN_DEG = 10.0  # a frame wrong by more is fitted before anything else is looked at
GROSS_SHARE = 0.3  # of the squared error left after the shift that such a turn must explain
OUTLYING = 5.0  # a run may be off beyond this many robust standard deviations ...
BEYOND_MOTION = 2.0  # ... and is, if its error differs from that of near joints by this many times their distance


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
        """Part of the squared error left by the shift that the turn explains, held out."""
        return 1 - (self.rms_after_mm / self.rms_before_mm) ** 2 if self.rms_before_mm > 0 else 0.0

    @property
    def gross(self) -> bool:
        """Whether the frame is wrong beyond what small corrections describe."""
        return self.turn_deg > GROSS_TURN_DEG and self.share > GROSS_SHARE


@dataclass(frozen=True)
class RunOffsets:
    """Whether the same joints give other errors in another run."""

    pairs_between: int
    pairs_within: int
    rms_between_mm: float
    rms_within_mm: float
    p_value: float  # NaN when too few joints were visited in two runs
    share: float  # of the squared error explained by one vector a run, in sample
    outlying: tuple[int, ...]  # runs far from the others, though others came near their joints
    outlying_mm: float  # their usual distance from the others
    found: bool  # the runs do not share one frame and homing


def find_shift(error: Array, folds: Folds) -> Shift:
    """Constant error of (K, 3) vectors [m], judged on blocks left out; sign flips of blocks give chance."""
    gains = float(np.sum(error**2)) - unexplained(np.ones((len(error), 1)), error, folds)
    mean = error.mean(axis=0) * 1e3
    total = max(float(np.sum(error**2)), 1e-300)
    return Shift(tuple(mean), float(np.linalg.norm(mean)), float(gains[0]) / total, chance(gains[0], gains[1:]))


def rigid_motion(source: Array, target: Array) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) that carry source (K, 3) to target (K, 3) best.

    Least squares by singular values (Kabsch 1976), never a reflection.
    """
    a, b = source.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((target - b).T @ (source - a))
    turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0]) @ right
    return turn, b - turn @ a


def find_turn(predicted: Array, measured: Array, folds: Folds) -> FrameTurn:
    """FrameTurn of predicted (K, 3) onto measured (K, 3) [m], judged on blocks left out."""
    before = after = 0.0
    for block in range(folds.count):
        out = folds.label == block
        turn, shift = rigid_motion(predicted[~out], measured[~out])
        after += np.sum((measured[out] - predicted[out] @ turn.T - shift) ** 2)
        mean = (measured[~out] - predicted[~out]).mean(axis=0)
        before += np.sum((measured[out] - predicted[out] - mean) ** 2)
    turn, _ = rigid_motion(predicted, measured)
    spin = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    sine = np.linalg.norm(spin)
    angle = np.degrees(np.arctan2(sine, (np.trace(turn) - 1) / 2))
    axis = spin / sine if sine > 0 else np.array([0.0, 0.0, 1.0])
    count = len(predicted)
    return FrameTurn(
        float(angle), tuple(axis), float(np.sqrt(before / count)) * 1e3, float(np.sqrt(after / count)) * 1e3
    )


def find_run_offsets(sample: Sample, revisits: Revisits, level: float) -> RunOffsets:
    """Compare visits of the same joints in different runs with visits inside one run.

    Offsets count as found when these visits differ more at that level, or when some runs lie far from the others.
    """
    square = np.sum(revisits.difference**2, axis=1)
    between, within = square[revisits.between_runs], square[~revisits.between_runs]
    p_value = np.nan
    if len(between) >= FEWEST_PAIRS and len(within) >= FEWEST_PAIRS:
        p_value = float(stats.mannwhitneyu(between, within, alternative="greater").pvalue)
    names, label = np.unique(sample.run, return_inverse=True)
    means = np.stack([np.bincount(label, column) / np.bincount(label) for column in sample.error.T], axis=1)
    around = sample.error - sample.error.mean(axis=0)
    share = 1 - np.sum((sample.error - means[label]) ** 2) / max(np.sum(around**2), 1e-300)
    distance = np.linalg.norm(means - np.median(means, axis=0), axis=1)
    far = _far_runs(sample, label, distance) if len(names) >= FEWEST_RUNS else np.zeros(len(names), bool)
    return RunOffsets(
        len(between),
        len(within),
        _rms_mm(between),
        _rms_mm(within),
        p_value,
        float(share),
        tuple(int(name) for name in names[far]),
        float(np.median(distance[far])) * 1e3 if far.any() else 0.0,
        bool(p_value <= level or far.any()),
    )


def _far_runs(sample: Sample, label: NDArray, distance: Array) -> NDArray[np.bool_]:
    """Runs whose mean error is an outlier that their joints cannot explain.

    Runs visit different joints, so their errors may differ. But between two readings the error hardly changes by
    more than the tip moves: a change far beyond the joint distance to the nearest reading of another run is the run's.
    """
    # the usual length of a 3-D Gaussian vector is 1.54 standard deviations
    far = distance > OUTLYING * np.sqrt(3) * max(np.median(distance) / 1.54, 1e-12)
    near = ~far[label]
    tree = cKDTree(sample.motion.scaled[near])
    for run in np.flatnonzero(far):
        mine = np.flatnonzero(label == run)[:: max(1, int(np.sum(label == run)) // 500)]
        gap, index = tree.query(sample.motion.scaled[mine])
        change = np.linalg.norm(sample.error[mine] - sample.error[near][index], axis=1)
        far[run] = np.median(change) > BEYOND_MOTION * np.median(gap)
    return far


def _rms_mm(square: Array) -> float:
    return float(np.sqrt(square.mean())) * 1e3 if len(square) else float("nan")
