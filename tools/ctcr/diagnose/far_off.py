"""Readings that are far off: by chance, as a tracker's outliers are, or because something acts just there."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import binom

from ctcr.diagnose.engine import OUTLIER
from ctcr.table.joint_space import loaded_places
from ctcr.table.measurements import Measurements

Mask = NDArray[np.bool_]

SURPRISE = 3.0  # times its expected size, from which an error says that a reading is far off
ALIKE = 0.5  # cosine between the errors of neighbours from which they are off the same way,
BY_CHANCE = 0.25  # ... and how often it is that by chance
DOUBT = 1e-3  # significance of saying that it is no chance
FEWEST = 4  # readings that say so
GLITCHES = 0.03  # share of readings that may be off alone: of more, the model is to blame


def far_off(fit: Any, admitted: float = 1.0) -> Mask:
    """Rows (M,) whose position is much farther from the prediction than open parameters and the noise, so many times
    as large as stated, let expect."""
    square = np.sum(fit.residual[:, :3] ** 2, axis=1)
    return np.isfinite(square) & (square > (SURPRISE * admitted) ** 2 * fit.expected_square[:, 0])


def alone(measurements: Measurements, fit: Any, rows: Mask) -> Mask:
    """Those of `rows` (M,) that are far off though the readings next to them are not, in time within their run and in
    joints and load: outliers of the tracker, or snaps to an equilibrium that nothing else shows. None where there are
    many of them."""
    read = np.flatnonzero(np.isfinite(fit.residual[:, :3]).all(axis=1))
    lonely = np.zeros(len(measurements), bool)
    if len(read) < 2:
        return lonely
    far = far_off(fit, max(1.0, fit.inflation[0]))[read]
    beside = np.zeros(len(read), bool)
    same = np.diff(measurements.run[read]) == 0
    beside[1:] |= same & far[:-1]
    beside[:-1] |= same & far[1:]
    lonely[read] = rows[read] & far & ~beside & ~far[_nearest(measurements, read)]
    return lonely if np.sum(lonely) <= GLITCHES * np.sum(rows[read]) else np.zeros_like(lonely)


def in_words(measurements: Measurements, fit: Any, glitches: Mask) -> list[str]:
    """What is to be said of readings that are off alone, without the full stop."""
    return [
        f"Reading {measurements.row[k]} is {1e3 * np.linalg.norm(fit.residual[k, :3]):.2g} mm off, and those next to "
        "it are not: an outlier of the tracker, or a snap to another equilibrium. It does not count in the errors"
        for k in np.flatnonzero(glitches)
    ]


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
    neighbour = read[_nearest(measurements, read)]
    both, share = far[read] & far[neighbour], np.mean(far[read])
    size, size_there = (np.linalg.norm(error[rows], axis=1) for rows in (read, neighbour))
    alike = both & (np.sum(error[read] * error[neighbour], axis=1) > ALIKE * size * size_there)
    if np.sum(alike) >= FEWEST and _doubt(np.sum(alike), far, BY_CHANCE * share) < DOUBT:
        together[read] |= alike
    expected = fit.expected_square[:, 0]
    noise = SURPRISE * fit.inflation[0] * np.sqrt(expected[read] + expected[neighbour])
    equal = both & (np.linalg.norm(error[read] - error[neighbour], axis=1) < noise)
    by_chance = np.mean((noise[far[read]] / size[far[read]]) ** 3)  # share of a ball's volume
    if equal.any() and _doubt((np.sum(equal) + 1) // 2, far, by_chance * share) < DOUBT:  # two may be one pair
        together[read] |= equal
    return together


def _nearest(measurements: Measurements, read: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of some rows: which of them is nearest to each in joints and load."""
    place = loaded_places(measurements)[read]
    near = cKDTree(place).query(place, k=2)[1]
    return np.where(near[:, 0] == np.arange(len(read)), near[:, 1], near[:, 0])


def _doubt(seen: int, far: Mask, chance: float) -> float:
    """Probability that so many of those far off would be seen by chance."""
    return float(binom.sf(seen - 1, np.sum(far), min(chance, 1.0)))
