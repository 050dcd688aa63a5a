"""Types of arrays in signatures, whose docstrings say their shapes; a choice of rows; a robust size."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "ArrayLike", "Integers", "Mask", "evenly", "robust_rms", "scattered"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]  # indices, labels, numbers of runs and rows


def evenly(count: int, most: int) -> Integers:
    """Indices of at most `most` of `count` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def scattered(count: int, most: int) -> Integers:
    """Like `evenly`, one row of each of `most` parts; its place within the part follows the golden ratio, so that no
    period of the rows is in step with the choice."""
    if count <= most:
        return np.arange(count)
    part = np.arange(most)
    return np.unique(((part + part * 0.5 * (5**0.5 - 1) % 1) * count / most).astype(np.int64))


_MEDIAN_LENGTH = {1: 0.67449, 3: 1.53817}  # of vectors of so many standard normal components


def robust_rms(lengths: ArrayLike, axes: int) -> float:
    """RMS length of normal vectors of 1 or 3 axes by the median of their lengths (K,): few outliers hardly move it."""
    return float(np.median(lengths)) * axes**0.5 / _MEDIAN_LENGTH[axes]
