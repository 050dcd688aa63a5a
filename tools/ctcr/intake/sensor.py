"""The sensor's pose by a log: of one marker, in the tracker frame or in the frame of another marker."""

import numpy as np

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake import fields, poses, units
from ctcr.intake.bodies import EULER, GRID, POSITION, QUATERNION, SEQUENCE, TRANSLATION
from ctcr.intake.columns import Columns, angle_unit, length_unit
from ctcr.intake.motion import row_ranges
from ctcr.intake.poses import Pose
from ctcr.table.measurements import never_turns

MATRIX = "matrix"  # the unit of positions in matrices is kept under this name


def of(columns: Columns) -> Pose | None:
    """The pose in every row, NaN where it was not seen; None where the log holds no positions."""
    choices = columns.choices
    pose = _marker(columns, "")
    if pose is None:
        columns.notes.append("no columns of positions: the table can be predicted, not compared")
        return None
    if any(role.startswith("ref_") for role in columns.mapping.used):
        reference = _marker(columns, "ref_")
        if reference is None or reference.quaternion is None:
            text = "its position and orientation are both needed"
            raise InputError(Problem(text, str(columns.log.path), field="--relative-to"))
        pose = poses.seen_from(reference, pose)
    if pose.quaternion is not None and never_turns(pose.quaternion):
        columns.notes.append("the rotation of the sensor never changes: it is left out")
        pose.quaternion = None
    if choices.mirror:
        pose = poses.mirrored(pose, choices.mirror)
    if not np.isfinite(pose.position).any():
        columns.notes.append("no row has a pose")
    return pose


def _marker(columns: Columns, prefix: str) -> Pose | None:
    """The pose of one marker, NaN where it was not seen."""
    position, rotation = _matrix(columns, prefix)
    is_whole = position is not None
    if position is None:
        if not columns.has(prefix + "x"):
            return None
        position = columns.si("position", [prefix + axis for axis in POSITION], length_unit)
    pose = Pose(position, _quaternion(columns, prefix, rotation))
    hidden = poses.unseen(pose)
    if columns.has(prefix + "seen"):
        used = columns.mapping.used[prefix + "seen"]
        seen = fields.seen(columns.log, used.column)
        if seen.any():
            hidden |= ~seen
        else:
            columns.notes.append(f"{used.name} has no word for seen: it is not used")
    if hidden.any():
        who = "the reference" if prefix else "the sensor"
        columns.notes.append(f"{who} was not seen in {row_ranges(columns.log.rows[hidden])}: the pose is left empty")
    pose.hide(hidden)
    rotation_alone, whole = columns.choices.invert_quaternion, columns.choices.invert_pose
    if pose.quaternion is not None and (rotation_alone or whole):
        turned = poses.inverse(pose)
        return turned if is_whole or whole else Pose(position=pose.position, quaternion=turned.quaternion)
    return pose


def _matrix(columns: Columns, prefix: str) -> tuple[Array | None, Array | None]:
    """Positions (M, 3) [m] and rotation matrices (M, 3, 3) of matrices; None for what they lack."""
    count = len(columns.log)
    if all(columns.has(prefix + role) for role in SEQUENCE[:12]) and not columns.has(f"{prefix}m16"):
        return _matrix_of_three_rows(columns, prefix)
    if columns.has(f"{prefix}m1") and columns.has(f"{prefix}m16"):
        values = np.column_stack([columns.values(prefix + role) for role in SEQUENCE]).reshape(count, 4, 4)
        last_row, last_column = (np.nanmax(np.abs(part), initial=0.0) for part in (values[:, 3, :3], values[:, :3, 3]))
        by_columns = last_row > 0 and last_column == 0
        values = np.swapaxes(values, 1, 2) if by_columns else values
        columns.notes.append(f"matrices are read by {'columns' if by_columns else 'rows'}: their last row is 0 0 0 1")
        return _scaled(columns, values[:, :3, 3]), values[:, :3, :3]
    if not all(columns.has(prefix + role) for role in GRID):
        return None, None
    rotation = np.column_stack([columns.values(prefix + role) for role in GRID]).reshape(count, 3, 3)
    if columns.has(prefix + "x") or not columns.has(prefix + "m14"):
        return None, rotation
    return _scaled(columns, np.column_stack([columns.values(prefix + role) for role in TRANSLATION])), rotation


def _matrix_of_three_rows(columns: Columns, prefix: str) -> tuple[Array, Array]:
    """Positions and rotations of 3 x 4 matrices, read by rows or by columns: the one that gives rotations."""
    values = np.column_stack([columns.values(prefix + role) for role in SEQUENCE[:12]])
    by_rows, by_columns = values.reshape(-1, 3, 4), np.swapaxes(values.reshape(-1, 4, 3), 1, 2)
    error = [np.nan_to_num(poses.off_rotation(one[:, :, :3])).sum() for one in (by_rows, by_columns)]
    columns.notes.append(f"matrices are read by {'rows' if error[0] <= error[1] else 'columns'}, as rotations are")
    matrices = by_rows if error[0] <= error[1] else by_columns
    return _scaled(columns, matrices[:, :, 3]), matrices[:, :, :3]


def _scaled(columns: Columns, position: Array) -> Array:
    asked = columns.choices.units.get("position")
    guess = length_unit(float(np.nanmax(np.abs(position), initial=0.0)))
    unit = units.parsed(asked, "length", "--unit position") if asked else guess
    columns.units[MATRIX] = unit, "option" if asked else "values"
    return position * unit.size


def _quaternion(columns: Columns, prefix: str, rotation: Array | None) -> Array | None:
    """Rotations (M, 4) of what the log holds; None for none."""
    rows = columns.log.rows
    if rotation is not None:
        name = columns.name(prefix + ("m11" if columns.has(prefix + "m11") else "m1"))
        return poses.from_matrices(rotation, rows, name, columns.faults)
    if columns.has(prefix + "qw"):
        values = np.column_stack([columns.values(prefix + role) for role in QUATERNION])
        if columns.choices.quaternion == "xyzw":
            values = np.roll(values, 1, axis=1)
        if columns.mapping.guessed_order:
            columns.notes.append("quaternions are numbered from 0: taken as w, x, y, z (else --quaternion xyzw)")
        return poses.from_quaternions(values, rows, columns.name(prefix + "qw"), columns.faults)
    if not columns.has(prefix + "rx"):
        return None
    sequence = columns.choices.euler or columns.log.euler
    angles = columns.si("euler", [prefix + role for role in EULER], angle_unit)
    if sequence is None:
        names = ",".join(columns.mapping.used[prefix + role].name for role in EULER)
        text = (
            "Euler angles need their sequence: --euler ZYX for R = Rz Ry Rx (roll, pitch, yaw of robotics), --euler XYZ"
            " for R = Rx Ry Rz; a rotation vector (axis times angle) is --euler vector"
        )
        columns.faults.add(1, columns.name(prefix + "rx"), f"{text}; or --ignore {names}")
        return None
    axes = sequence if sequence.isupper() else sequence[::-1]
    if sequence != "vector":
        columns.notes.append(f"Euler angles: R = {' '.join('R' + axis.lower() for axis in axes)}")
    return poses.from_euler(angles, sequence)
