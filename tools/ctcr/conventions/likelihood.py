"""How likely the residual of a hypothesis is, where the model is not perfect: one likelihood for all hypotheses.

What a model misses changes smoothly in joint space, and along the way of the joints where it depends on their history:
it is a Gaussian process, in each run for itself, beside white noise. Any size of either is as probable as another.
Thousands of rows that err alike count as few.
"""

import numpy as np
from scipy.special import logsumexp

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.table.measurements import Measurements

PARTS = np.r_[0.0, np.logspace(-4, 0.5, 19)]  # of the RMS residual that are tried for either size


class Likelihood:
    """The log density of residuals of K readings."""

    def __init__(self, readings: Measurements, rows: Mask | None = None):
        """`rows` (K,) that count, all by default."""
        self._blocks, joints = [], readings.joint_space
        way = np.cumsum(np.linalg.norm(np.diff(joints, axis=0, prepend=joints[:1]), axis=1))[:, None]
        for run in np.unique(readings.run):
            mine = np.flatnonzero((readings.run == run) & (True if rows is None else rows))
            squares = (np.sum((at[mine, None] - at[mine]) ** 2, axis=2) for at in (joints, way))
            kernel = sum(0.5 * np.exp(-0.5 * square / settings.CONVENTION_LENGTH**2) for square in squares)
            self._blocks.append((mine, *np.linalg.eigh(kernel)))
        self._smooth = np.concatenate([np.maximum(block[1], 0.0) for block in self._blocks])

    def __call__(self, residual: Array, jitter: float) -> float:
        """Of residuals (K, 3) [m], where the tracker's jitter has this standard deviation of an axis [m]."""
        along = np.concatenate([axes.T @ residual[mine] for mine, _, axes in self._blocks])
        square, size = np.sum(along**2, axis=1), np.sqrt(np.mean(along**2))
        smooth, white = np.meshgrid((size * PARTS) ** 2, (size * PARTS) ** 2 + jitter**2)
        variance = smooth.reshape(-1, 1) * self._smooth + white.reshape(-1, 1)
        density = -0.5 * np.sum(3 * np.log(2 * np.pi * variance) + square / variance, axis=1)
        return float(logsumexp(density) - 2 * np.log(len(PARTS)))
