"""The rigid motion between predicted and measured points, in closed form, outliers down-weighted."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.frames import rigid_motion


def aligned(source: Array, target: Array) -> tuple[Array, Array, Array]:
    """Rotation (3, 3) and translation (3,) from source (K, 3) to target (K, 3), and the distances (K,) that they leave.

    Rows with NaN do not count; their distance is NaN.
    """
    known = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1)
    rotation, shift, distance = np.eye(3), np.zeros(3), np.full(len(source), np.nan)
    if known.sum() < 3:
        return rotation, shift, distance
    a, b, weight = source[known], target[known], np.ones(known.sum())
    for _ in range(settings.ALIGNMENT_ROUNDS):
        rotation, shift = rigid_motion(a, b, weight)
        distance[known] = np.linalg.norm(b - a @ rotation.T - shift, axis=1)
        usual = np.median(distance[known])
        if usual <= 0:
            break
        weight = 1 / (1 + (distance[known] / usual) ** 2)
    return rotation, shift, distance
