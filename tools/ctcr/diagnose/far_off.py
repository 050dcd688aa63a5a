"""Readings that are far off: by chance, as a tracker's outliers are, or because something acts just there."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import binom

from ctcr.diagnose.engine import OUTLIER
from ctcr.joint_space import loaded_places
from ctcr.measurements import Measurements

Mask = NDArray[np.bool_]

SURPRISE = 3.0  # times its expected size, from which an error says that a reading is far off
ALIKE = 0.5  # cosine between the errors of neighbours from which they are off the same way,
BY_CHANCE = 0.25  # ... and how often it is that by chance
DOUBT = 1e-3  # significance of saying that it is no chance
FEWEST = 4  # readings that say so


def far_off(fit: Any, admitted: float = 1.0) -> Mask:
    """Rows (M,) whose position is much farther from the prediction than open parameters and the noise, so many times
    as large as stated, let expect."""
    square = np.sum(fit.residual[:, :3] ** 2, axis=1)
    return np.isfinite(square) & (square > (SURPRISE * admitted) ** 2 * fit.expected_square[:, 0])


def come_together(measurements: Measurements, fit: Any) -> Mask:
    """Fitted rows (M,) that are far off the same way as the reading nearest to them in joints and load, or even by the
    same error but for noise; none where so many may be so by chance. Outliers strike a reading, not a place.

    Far off is what the fit takes for an outlier, and not for the error that its model has everywhere."""
    fitted = fit.weights[:, 0] > 0
    outlier = fitted & (fit.weights[:, 0] < OUTLIER)
    far, error = outlier & far_off(fit, fit.inflation[0]), fit.residual[:, :3]
    read = np.flatnonzero(fitted & np.isfinite(error).all(axis=1))
    together = np.zeros(len(measurements), bool)
    if not far[read].any() or len(read) < 2:
        return together
    place = loaded_places(measurements)[read]
    neighbour = read[cKDTree(place).query(place, k=2)[1]]
    neighbour = np.where(neighbour[:, 0] == read, neighbour[:, 1], neighbour[:, 0])
    both, share = far[read] & far[neighbour], np.mean(far[read])
    size, size_there = (np.linalg.norm(error[rows], axis=1) for rows in (read, neighbour))
    alike = both & (np.sum(error[read] * error[neighbour], axis=1) > ALIKE * size * size_there)
    if np.sum(alike) >= FEWEST and _doubt(np.sum(alike), far, BY_CHANCE * share) < DOUBT:
        together[read] |= alike
    expected = fit.expected_square[:, 0]
    noise = SURPRISE * fit.inflation[0] * np.sqrt(expected[read] + expected[neighbour])
    equal = both & (np.linalg.norm(error[read] - error[neighbour], axis=1) < noise)
    by_chance = np.mean((noise[far[read]] / size[far[read]]) ** 3)  # share of a ball's volume
    if (
        equal.any() and _doubt((np.sum(equal) + 1) // 2, far, by_chance * share) < DOUBT
    ):  # two may be one pair
        together[read] |= equal
    return together


def _doubt(seen: int, far: Mask, chance: float) -> float:
    """Probability that so many of those far off would be seen by chance."""
    return float(binom.sf(seen - 1, np.sum(far), min(chance, 1.0)))
