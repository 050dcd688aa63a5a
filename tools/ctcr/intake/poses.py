"""Poses of markers from what logs hold: quaternions in any order, Euler angles, matrices; missing ones found."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import frames
from ctcr.arrays import Array, Integers, Mask
from ctcr.frames import QUATERNION_SLACK
from ctcr.table.csv_table import Faults

ORTHOGONAL_SLACK = 0.02  # of R R^T - 1, in such logs


@dataclass
class Pose:
    """Of one marker in the tracker frame: position (M, 3) [m], quaternion (M, 4) w first; None: not in the log."""

    position: Array
    quaternion: Array | None

    def hide(self, unseen: Mask) -> None:
        self.position = np.where(unseen[:, None], np.nan, self.position)
        if self.quaternion is not None:
            self.quaternion = np.where(unseen[:, None], np.nan, self.quaternion)


def from_quaternions(columns: Array, rows: Integers, name: str, faults: Faults) -> Array:
    """Unit quaternions (M, 4), w first, of rounded ones; one number four times, such as 0, counts as missing."""
    norm = np.linalg.norm(columns, axis=1)
    off = np.isfinite(norm) & (np.abs(norm - 1) > QUATERNION_SLACK)
    norm = np.where(off & (columns == columns[:, :1]).all(axis=1), 0.0, norm)
    off &= norm > 0
    faults.where(
        off, rows, name, "norm", lambda i: f"quaternion of norm {norm[i]:.4g}: must be 1. Are these its columns?"
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(norm[:, None] > 0, columns / norm[:, None], np.nan)


def from_euler(angles: Array, sequence: str) -> Array:
    """Quaternions (M, 4) of angles (M, 3) [rad] about x, y, z, in the sequence of scipy: ZYX moving, zyx fixed axes;
    of rotation vectors where that is "vector". One number three times, other than 0, counts as missing."""
    known = np.isfinite(angles).all(axis=1) & ((angles != angles[:, :1]) | (angles == 0)).any(axis=1)
    made = np.full((len(angles), 4), np.nan)
    if known.any() and sequence == "vector":
        made[known] = np.roll(Rotation.from_rotvec(angles[known]).as_quat(), 1, axis=1)
    elif known.any():
        ordered = angles[:, ["xyz".index(axis) for axis in sequence.lower()]]
        made[known] = np.roll(Rotation.from_euler(sequence, ordered[known]).as_quat(), 1, axis=1)
    return made


def from_matrices(matrices: Array, rows: Integers, name: str, faults: Faults) -> Array:
    """Quaternions (M, 4) of rotation matrices (M, 3, 3), rounded ones too; all zeros count as missing."""
    known = np.isfinite(matrices).all(axis=(1, 2)) & (np.abs(matrices).max(axis=(1, 2)) > 0)
    tested = np.where(known[:, None, None], matrices, np.eye(3))
    error = off_rotation(tested)
    off = error > ORTHOGONAL_SLACK
    mirrored = ~off & (np.linalg.det(tested) < 0)
    faults.where(off, rows, name, "orthogonal", lambda i: f"no rotation matrix: R R^T is off by {error[i]:.2g}")
    faults.where(mirrored, rows, name, "mirrored", lambda _: "a reflection, not a rotation")
    good = known & ~off & ~mirrored
    made = np.full((len(matrices), 4), np.nan)
    if good.any():
        made[good] = np.roll(Rotation.from_matrix(matrices[good]).as_quat(), 1, axis=1)
    return made


def off_rotation(matrices: Array) -> Array:
    """How far matrices (M, 3, 3) are from rotations or reflections (M,): the largest entry of R R^T - 1."""
    return np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max(axis=(1, 2))


def unseen(pose: Pose) -> Mask:
    """Rows (M,) in which the tracker saw nothing. The position is missing, or its three numbers are equal and there is
    no rotation: programs write 0 or -1 for missing."""
    missing = ~np.isfinite(pose.position).all(axis=1)
    word = (pose.position == pose.position[:, :1]).all(axis=1)
    if pose.quaternion is None:
        return missing | word
    turned = np.isfinite(pose.quaternion).all(axis=1) & (np.abs(pose.quaternion[:, 0]) < 1)
    return missing | (word & ~turned)


def inverse(pose: Pose) -> Pose:
    """The pose of the tracker in the frame of the marker."""
    return Pose(*frames.inverse_pose(pose.position, pose.quaternion))


def seen_from(reference: Pose, pose: Pose) -> Pose:
    """A pose in the frame of the marker `reference`, both given in the tracker frame."""
    away = pose.position - reference.position
    back = frames.conjugate(reference.quaternion)
    rotation = frames.matrix_from_quaternion(back)
    turned = None if pose.quaternion is None else frames.product(back, pose.quaternion)
    return Pose(np.einsum("mij,mj->mi", rotation, away), turned)


def mirrored(pose: Pose, axis: str) -> Pose:
    """The pose of a left-handed frame in the right-handed one whose `axis` points the other way."""
    signs = np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    turned = None if pose.quaternion is None else pose.quaternion * np.concatenate([[1.0], -signs])
    return Pose(pose.position * signs, turned)
