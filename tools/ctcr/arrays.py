"""Types of arrays in signatures, whose docstrings say their shapes, and a choice of rows."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "ArrayLike", "Integers", "Mask", "evenly", "scattered"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]  # indices, labels, numbers of runs and rows


def evenly(count: int, most: int) -> Integers:
    """Indices of at most `most` of `count` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def scattered(count: int, most: int) -> Integers:
    """As `evenly`, but the place within each stretch follows the golden ratio, so that no period of the rows is in step
    with the choice."""
    if count <= most:
        return np.arange(count)
    stretch = np.arange(most)
    return np.unique(((stretch + stretch * 0.5 * (5**0.5 - 1) % 1) * count / most).astype(np.int64))
