"""Rotations obey the laws of rotations; the tracker frame is T_ref."""

from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import frames
from scipy.spatial.transform import Rotation

RNG = np.random.default_rng(4)
VECTORS = np.concatenate([np.zeros((1, 3)), 1e-9 * RNG.normal(size=(20, 3)), RNG.normal(size=(200, 3))])


def test_matrices():
    """Matrices of rotation vectors agree with scipy."""
    expected = Rotation.from_rotvec(VECTORS).as_matrix()
    np.testing.assert_allclose(frames.matrix_from_rotation_vector(VECTORS), expected, atol=1e-14)


def test_quaternions():
    """Quaternions are unit and compose as matrices do."""
    first = frames.quaternion_from_rotation_vector(VECTORS)
    second = first[::-1]
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), 1, atol=1e-14)
    together = frames.matrix_from_quaternion(frames.product(first, second))
    one_by_one = frames.matrix_from_quaternion(first) @ frames.matrix_from_quaternion(second)
    np.testing.assert_allclose(together, one_by_one, atol=1e-14)
    nothing = frames.product(first, frames.conjugate(first))
    np.testing.assert_allclose(nothing, np.tile([1.0, 0, 0, 0], (len(first), 1)), atol=1e-14)


def test_angle():
    """The angle is the length of the rotation vector, for q and -q."""
    short = VECTORS[np.linalg.norm(VECTORS, axis=1) < np.pi]
    base = frames.quaternion_from_rotation_vector(RNG.normal(size=(len(short), 3)))
    turned = frames.product(base, frames.quaternion_from_rotation_vector(short))
    for sign in (1, -1):
        angle = frames.angle_between(base, sign * turned)
        np.testing.assert_allclose(angle, np.linalg.norm(short, axis=1), atol=1e-14)


def test_tracker_frame():
    """base_to_tracker applies T_ref and T_tip_sensor, and tracker_to_base inverts it."""
    vector, offset, beside, turn = RNG.normal(size=(4, 3))
    rotation, mount = Rotation.from_rotvec(vector), Rotation.from_rotvec(turn)
    tracker = SimpleNamespace(
        rotation=rotation.as_matrix(),
        position=offset,
        rotation_vector_rad=vector,
        sensor_position=beside,
        sensor_rotation_vector=turn,
    )
    position, orientation = RNG.normal(size=(50, 3)), Rotation.from_rotvec(RNG.normal(size=(50, 3)))
    quaternion = orientation.as_quat(scalar_first=True)
    moved, turned = frames.base_to_tracker(tracker, position, quaternion)
    np.testing.assert_allclose(moved, rotation.apply(position + orientation.apply(beside)) + offset, atol=1e-14)
    expected = (rotation * orientation * mount).as_quat(scalar_first=True)
    assert frames.angle_between(turned, expected) == pytest.approx(0, abs=1e-14)
