"""Outliers: isolated ones, which a tracker makes by chance, and clusters, where something acts at those joints."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import bdtrc

from ctcr import settings
from ctcr.arrays import Integers, Mask
from ctcr.audit import snaps
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def outliers(fit: Any, admitted: float = 1.0, *, rotation: bool = False) -> Mask:
    """Rows (M,) whose error of position, or of rotation, is much larger than uncertain parameters and the noise,
    `admitted` times as large as stated, let expect."""
    square = np.sum(fit.residual[:, 3 * rotation : 3 + 3 * rotation] ** 2, axis=1)
    return np.isfinite(square) & (square > (settings.SURPRISE * admitted) ** 2 * fit.expected_square[:, int(rotation)])


def beyond_noise(fit: Any, *, rotation: bool = False) -> Mask:
    """Outliers (M,) under the stated noise, or under the inflated noise of the fit."""
    return outliers(fit, max(1.0, fit.inflation[int(rotation)]), rotation=rotation)


def isolated(measurements: Measurements, fit: Any, rows: Mask) -> Mask:
    """Outliers among `rows` (M,) whose neighbours, in time within the run and in joints and load, are none: errors of
    the tracker, or snaps to another equilibrium that no other reading shows. None where a tracker does not make so
    many."""
    read = np.flatnonzero(np.isfinite(fit.residual[:, :3]).all(axis=1))
    found = np.zeros(len(measurements), bool)
    if len(read) < 2:
        return found
    far = beyond_noise(fit)[read]
    beside = np.zeros(len(read), bool)
    same = np.diff(measurements.run[read]) == 0
    beside[1:] |= same & far[:-1]
    beside[:-1] |= same & far[1:]
    found[read] = rows[read] & far & ~beside & ~far[_nearest(measurements, read)]
    return np.zeros_like(found) if _beyond_a_tracker(np.sum(found), np.sum(rows[read])) else found


def unexplained_runs(measurements: Measurements, fit: Any) -> list[int]:
    """Runs, fitted or held out, of which most readings are outliers: no tracker makes those."""
    read = np.isfinite(fit.residual[:, :3]).all(axis=1)
    runs, index = np.unique(measurements.run[read], return_inverse=True)
    shares = [np.bincount(index, beyond_noise(fit, rotation=r)[read]) / np.bincount(index) for r in (False, True)]
    return runs[np.max(shares, axis=0) > settings.MOST_OF_A_RUN].tolist()


def messages(robot: Robot, measurements: Measurements, fit: Any, isolated: Mask) -> list[str]:
    """One for each isolated outlier of a fit to a robot, without the full stop: whether it is a snap."""
    fitted, said = fit.apply(robot), []
    for k in np.flatnonzero(isolated):
        far = np.linalg.norm(fit.residual[k, :3])
        text = f"The reading in row {measurements.row[k]} is {1e3 * far:.2g} mm off, and its neighbours are not: "
        others = np.linalg.norm(snaps.other_tips(fitted, measurements, k) - measurements.position[k], axis=1)
        expected = settings.SURPRISE * fit.inflation[0] * np.sqrt(fit.expected_square[k, 0])
        if len(others) and others.min() < max(expected, settings.SNAP_ERROR * far):
            text += f"a snap: another stable equilibrium of the robot is {1e3 * others.min():.2g} mm from it"
        elif len(others):
            text += f"an outlier of the tracker: the nearest other equilibrium is {1e3 * others.min():.2g} mm from it"
        else:
            text += "an outlier of the tracker, as the robot has no other stable equilibrium there"
        said.append(text + ". The errors are without it")
    return said


def down_weighted(fit: Any) -> Mask:
    """Fitted rows (M,) that count for little."""
    return (fit.weights[:, 0] > 0) & (fit.weights[:, 0] < settings.OUTLIER_WEIGHT)


def are_many(fit: Any) -> bool:
    """Whether a tracker does not make so many outliers as a fit has down-weighted."""
    return _beyond_a_tracker(np.sum(down_weighted(fit)), np.sum(fit.weights[:, 0] > 0))


def hide_an_effect(measurements: Measurements, fit: Any) -> bool:
    """Whether an effect that acts on few readings may have made the outliers of a fit: a tracker does not make so many,
    or they agree with their neighbours."""
    return are_many(fit) or bool(clustered(measurements, fit).any())


def clustered(measurements: Measurements, fit: Any) -> Mask:
    """Fitted rows (M,) that are outliers like the reading nearest in joints and load: their errors point in the same
    direction, or are equal but for noise. None where the outliers of a tracker may agree so often by chance.

    An outlier here is a reading that the fit down-weights. A reading with the error that the model has everywhere is
    none.
    """
    fitted = fit.weights[:, 0] > 0
    far, error = down_weighted(fit) & outliers(fit, fit.inflation[0]), fit.residual[:, :3]
    read = np.flatnonzero(fitted & np.isfinite(error).all(axis=1))
    found = np.zeros(len(measurements), bool)
    if not far[read].any() or len(read) < 2:
        return found
    neighbour = read[_nearest(measurements, read)]
    both, fraction = far[read] & far[neighbour], np.mean(far[read])
    size, size_there = (np.linalg.norm(error[rows], axis=1) for rows in (read, neighbour))
    alike = both & (np.sum(error[read] * error[neighbour], axis=1) > settings.CLUSTER_COSINE * size * size_there)
    in_direction = settings.CLUSTER_CHANCE * fraction
    if np.sum(alike) >= settings.CLUSTER_ROWS and _beyond_chance(alike.sum(), far.sum(), in_direction):
        found[read] |= alike
    expected = fit.expected_square[:, 0]
    noise = settings.SURPRISE * fit.inflation[0] * np.sqrt(expected[read] + expected[neighbour])
    equal = both & (np.linalg.norm(error[read] - error[neighbour], axis=1) < noise)
    by_chance = np.mean((noise[far[read]] / size[far[read]]) ** 3)  # ratio of the volumes of two balls
    if equal.any() and _beyond_chance((equal.sum() + 1) // 2, far.sum(), by_chance * fraction):  # two may be one pair
        found[read] |= equal
    return found


def _nearest(measurements: Measurements, read: Integers) -> Integers:
    """Index, among the rows `read`, of the one nearest to each in joints and load."""
    place = measurements.load_space[read]
    near = cKDTree(place).query(place, k=2)[1]
    return np.where(near[:, 0] == np.arange(len(read)), near[:, 1], near[:, 0])


def _beyond_a_tracker(seen: int, of: int) -> bool:
    return _beyond_chance(seen, of, settings.TRACKER_OUTLIERS)


def _beyond_chance(seen: int, of: int, chance: float) -> bool:
    """Whether so many of these, each with this probability, are no chance."""
    return bool(bdtrc(seen - 1, of, min(chance, 1.0)) < settings.OUTLIER_SIGNIFICANCE)
