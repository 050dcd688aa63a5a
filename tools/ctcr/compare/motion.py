"""Directions and speeds along the joint path: between rows all joints move in straight lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask


@dataclass(frozen=True)
class Motion:
    """Motion at each of M rows; joints are ordered beta_1..N, alpha_1..N."""

    scaled: Array  # (M, 2N) joints as lengths [m]: beta, and alpha times the tip's lever arm
    direction: NDArray[np.int8]  # (M, 2N) sign of the last motion, kept at rest; 0 before a joint first moves
    rate: Array  # (M, 2N) joint speed since the previous row [m/s, rad/s]; NaN where unknown

    def rows(self, keep: Mask) -> "Motion":
        """The same motion at some of the rows only."""
        return Motion(self.scaled[keep], self.direction[keep], self.rate[keep])


def follow(t: Array, run: Integers, beta: Array, alpha: Array, lever: float) -> Motion:
    """Motion along a joint path of at least one row.

    t (M,) [s, NaN allowed], run (M,), beta (M, N) [m], alpha (M, N) [rad]; lever [m] turns a base rotation
    into a length that is comparable with a translation (the tip's typical distance from the axis).
    """
    joints = np.hstack([beta, alpha])
    rate, direction = np.full(joints.shape, np.nan), np.zeros(joints.shape, np.int8)
    linked = run[1:] == run[:-1]
    elapsed = np.where(linked & (np.diff(t) > 0), np.diff(t), np.nan)
    rate[1:] = np.diff(joints, axis=0) / elapsed[:, None]
    band = settings.REVERSAL * np.ptp(joints, axis=0)
    for rows in np.split(np.arange(len(run)), np.flatnonzero(~linked) + 1):
        for column in range(joints.shape[1]):
            direction[rows, column] = _directions(joints[rows, column].tolist(), band[column])
    return Motion(np.hstack([beta, alpha * lever]), direction, rate)


def _directions(path: list[float], band: float) -> list[int]:
    """Sign of the last motion at every point of a path; a reversal counts once it exceeds the band."""
    low = high = path[0]
    sign, signs = 0, []
    for value in path:
        low, high = min(low, value), max(high, value)
        if sign >= 0 and value < high - band:
            sign, low = -1, value
        elif sign <= 0 and value > low + band:
            sign, high = 1, value
        signs.append(sign)
    return signs
