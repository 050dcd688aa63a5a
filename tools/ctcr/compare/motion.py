"""Directions of motion along the joint path: between rows all joints move in straight lines."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A joint that comes back by less than this share of its whole range has not reversed (encoder noise, dither).
REVERSAL_SHARE = 2e-4


@dataclass(frozen=True)
class Motion:
    """Motion at each of M rows; joints are ordered beta_1..N, alpha_1..N."""

    scaled: Array  # (M, 2N) joints as lengths [m]: beta, and alpha times the tip's lever arm
    direction: NDArray[np.int8]  # (M, 2N) sign of the last motion, kept at rest; 0 before a joint first moves
    rate: Array  # (M, 2N) joint speed since the previous row [m/s, rad/s]; NaN where unknown
    step: Array  # (M,) length of the scaled joint step from the previous row [m]; NaN at the start of a run

    def rows(self, keep: NDArray) -> "Motion":
        """The same motion at some of the rows only."""
        return Motion(**{field.name: getattr(self, field.name)[keep] for field in fields(self)})


def follow(t: Array, run: NDArray, beta: Array, alpha: Array, lever: float) -> Motion:
    """Directions, speeds and step lengths of a joint path.

    t (M,) [s, NaN allowed], run (M,), beta (M, N) [m], alpha (M, N) [rad]; lever [m] turns a base rotation
    into a length that is comparable with a translation (the tip's typical distance from the axis).
    """
    joints = np.hstack([beta, alpha])
    count, width = joints.shape
    scaled = np.hstack([beta, alpha * lever])
    rate, step = np.full((count, width), np.nan), np.full(count, np.nan)
    direction = np.zeros((count, width), np.int8)
    if count == 0:
        return Motion(scaled, direction, rate, step)
    linked = run[1:] == run[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        elapsed = np.where(np.diff(t) > 0, np.diff(t), np.nan)
        rate[1:] = np.where(linked[:, None], np.diff(joints, axis=0) / elapsed[:, None], np.nan)
    step[1:] = np.where(linked, np.linalg.norm(np.diff(scaled, axis=0), axis=1), np.nan)
    starts = np.flatnonzero(np.concatenate([[True], ~linked]))
    for column in range(width):
        band = REVERSAL_SHARE * np.ptp(joints[:, column])
        for start, stop in zip(starts, [*starts[1:], count], strict=True):
            direction[start:stop, column] = _directions(joints[start:stop, column].tolist(), band)
    return Motion(scaled, direction, rate, step)


def _directions(path: list[float], band: float) -> list[int]:
    """Sign of the last motion at every point of a path; a reversal counts once it exceeds the band."""
    low = high = path[0]
    sign, signs = 0, []
    for value in path:
        if value > high:
            high = value
        if value < low:
            low = value
        if sign >= 0 and value < high - band:
            sign, low = -1, value
        elif sign <= 0 and value > low + band:
            sign, high = 1, value
        signs.append(sign)
    return signs
