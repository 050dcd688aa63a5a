"""The rigid motion between predicted and measured points, in closed form (Kabsch 1976), outliers down-weighted."""

import numpy as np

from ctcr.arrays import Array

ROUNDS = 3  # of weights: the motion is only a start


def aligned(source: Array, target: Array) -> tuple[Array, Array, Array]:
    """Rotation (3, 3) and translation (3,) from source (K, 3) to target (K, 3), and the distances (K,) that they leave.

    Rows with NaN do not count; their distance is NaN.
    """
    known = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1)
    weight = known.astype(float)
    rotation, shift, distance = np.eye(3), np.zeros(3), np.full(len(source), np.nan)
    if known.sum() < 3:
        return rotation, shift, distance
    a, b = np.where(known[:, None], source, 0.0), np.where(known[:, None], target, 0.0)
    for _ in range(ROUNDS):
        part = weight[:, None] / weight.sum()
        centre_a, centre_b = np.sum(part * a, axis=0), np.sum(part * b, axis=0)
        left, _, right = np.linalg.svd((part * (b - centre_b)).T @ (a - centre_a))
        rotation = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0]) @ right
        shift = centre_b - rotation @ centre_a
        distance = np.where(known, np.linalg.norm(b - a @ rotation.T - shift, axis=1), np.nan)
        usual = np.median(distance[known])
        if usual <= 0:
            break
        weight = known / (1 + np.nan_to_num(distance / usual) ** 2)
    return rotation, shift, distance
