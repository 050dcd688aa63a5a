"""Rotations as quaternions (w, x, y, z) and rotation vectors, and the tracker frame. Arrays of any leading shape."""

import numpy as np
from numpy.typing import ArrayLike

from ctcr.arrays import Array

# What trackers and their logs hold where nothing was seen, or that is no pose
BEYOND = 1e20  # a number beyond it, such as NDI's -3.697314e28, stands for a missing one
QUATERNION_SLACK = 0.02  # of the norm, in two or three digits


def quaternion_from_rotation_vector(rotation_vector: ArrayLike) -> Array:
    """Unit quaternion (..., 4) of a rotation vector (..., 3) [rad]; w >= 0 up to half a turn."""
    vector = np.asarray(rotation_vector, dtype=float)
    half = np.linalg.norm(vector, axis=-1, keepdims=True) / 2
    # np.sinc(x) = sin(pi x) / (pi x) is smooth through zero
    return np.concatenate([np.cos(half), vector * np.sinc(half / np.pi) / 2], axis=-1)


def matrix_from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of a unit quaternion (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_from_rotation_vector(rotation_vector: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of a rotation vector (..., 3) [rad]."""
    return matrix_from_quaternion(quaternion_from_rotation_vector(rotation_vector))


def conjugate(quaternion: ArrayLike) -> Array:
    """The inverse rotation of a unit quaternion (..., 4)."""
    return np.asarray(quaternion, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def product(first: ArrayLike, second: ArrayLike) -> Array:
    """Quaternion of the matrix product first * second, each (..., 4)."""
    a, b = np.broadcast_arrays(np.asarray(first, dtype=float), np.asarray(second, dtype=float))
    scalar = a[..., 0] * b[..., 0] - np.sum(a[..., 1:] * b[..., 1:], axis=-1)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar[..., None], vector], axis=-1)


def angle_between(first: ArrayLike, second: ArrayLike) -> Array:
    """Angle [rad], 0 to pi, of the rotation between unit quaternions (..., 4); q and -q are the same rotation."""
    difference = product(conjugate(first), second)
    return 2 * np.arctan2(np.linalg.norm(difference[..., 1:], axis=-1), np.abs(difference[..., 0]))


def base_to_tracker(tracker, position: ArrayLike, quaternion: ArrayLike) -> tuple[Array, Array]:
    """Poses (..., 3), (..., 4) of the tip, base frame, as the sensor reads them: T_ref T_base_tip T_tip_sensor.

    `tracker` is the robot file's section, which holds T_ref and the pose of the sensor.
    """
    position, quaternion = of_sensor(tracker, position, quaternion)
    return points_to_tracker(tracker, position), product(_frame(tracker), quaternion)


def tracker_to_base(tracker, position: ArrayLike, quaternion: ArrayLike) -> tuple[Array, Array]:
    """The inverse of `base_to_tracker`."""
    turned = product(conjugate(_frame(tracker)), product(quaternion, conjugate(_mount(tracker))))
    return points_to_base(tracker, position) - rotated(turned, tracker.sensor_position), turned


def of_sensor(tracker, position: ArrayLike, quaternion: ArrayLike) -> tuple[Array, Array]:
    """Poses (..., 3), (..., 4) of the sensor where its tip has these, in the same frame."""
    return position + rotated(quaternion, tracker.sensor_position), product(quaternion, _mount(tracker))


def points_to_tracker(tracker, points: ArrayLike) -> Array:
    """Points (..., 3) of the base frame in the tracker frame."""
    return np.asarray(points, dtype=float) @ tracker.rotation.T + tracker.position


def points_to_base(tracker, points: ArrayLike) -> Array:
    """Points (..., 3) of the tracker frame in the base frame."""
    return (np.asarray(points, dtype=float) - tracker.position) @ tracker.rotation


def rotated(quaternion: ArrayLike, vector: ArrayLike) -> Array:
    """A vector (3,) turned by unit quaternions (..., 4)."""
    return matrix_from_quaternion(quaternion) @ np.asarray(vector, dtype=float)


def inverse_pose(position: Array, quaternion: Array) -> tuple[Array, Array]:
    """Inverses of poses (M, 3), (M, 4): the frame in which they are given, as seen from each of them."""
    back = conjugate(quaternion)
    return -np.einsum("mij,mj->mi", matrix_from_quaternion(back), position), back


def rigid_motion(source: Array, target: Array, weight: Array | None = None) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) that carry source (K, 3) to target (K, 3) with least squares (Kabsch 1976),
    of weights (K,).

    Points on a line, which leave a rotation undetermined, give one of the best, and never a reflection.
    """
    part = np.full((len(source), 1), 1 / len(source)) if weight is None else weight[:, None] / weight.sum()
    a, b = np.sum(part * source, axis=0), np.sum(part * target, axis=0)
    rotation = nearest_rotation((part * (target - b)).T @ (source - a))
    return rotation, b - rotation @ a


def nearest_rotation(matrix: Array) -> Array:
    """The rotation (3, 3) nearest to a matrix, such as the mean of rotations."""
    left, _, right = np.linalg.svd(matrix)
    return left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0]) @ right


def _frame(tracker) -> Array:
    return quaternion_from_rotation_vector(tracker.rotation_vector_rad)


def _mount(tracker) -> Array:
    return quaternion_from_rotation_vector(tracker.sensor_rotation_vector)
