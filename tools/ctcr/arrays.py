"""Types of arrays in signatures, whose docstrings say their shapes, and a choice of rows."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "ArrayLike", "Integers", "Mask", "evenly"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]  # indices, labels, numbers of runs and rows


def evenly(count: int, most: int) -> Integers:
    """Indices of at most `most` of `count` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))
