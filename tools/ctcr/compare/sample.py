"""The readings that can be compared, with their errors: measured minus predicted.

Errors are position vectors in the tracker frame [m] and the same vectors in the base frame; the predicted
pose comes from the model in the base frame and is carried over by T_ref (x_tracker = T_ref x_base).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.motion import Motion, follow
from ctcr.frames import base_to_tracker, conjugate, matrix_from_quaternion, product

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """K comparable readings in measured order; lengths in m, angles in rad, time in s (NaN when absent)."""

    row: NDArray[np.int64]  # (K,) line in the measurement file
    t: Array  # (K,)
    run: NDArray[np.int64]  # (K,)
    beta: Array  # (K, N)
    alpha: Array  # (K, N)
    force: Array  # (K, 3) base frame [N]
    measured: Array  # (K, 3) tracker frame
    predicted: Array  # (K, 3) tracker frame
    base_position: Array  # (K, 3) predicted tip, base frame
    tip_rotation: Array  # (K, 3, 3) predicted sensor orientation, base frame
    tip_velocity: Array  # (K, 3) predicted, base frame [m/s]; NaN where unknown
    tip_step: Array  # (K, 3) predicted tip motion since the previous row, base frame
    error: Array  # (K, 3) tracker frame
    base_error: Array  # (K, 3) base frame
    rotation: Array  # (3, 3) R_tracker_base
    rotation_error: Array | None  # (K, 3) rotation vector in the tracker frame, NaN rows if not measured
    roll_known: bool
    deployed: Array  # (K,) arc length of the sensor's tip in front of the plate
    tube_lengths: Array  # (N,)
    lever: float  # typical distance of the tip from the insertion axis [m]
    motion: Motion
    not_measured: NDArray[np.int64]  # file lines
    not_solved: NDArray[np.int64]  # file lines


def take_sample(robot, measurements, prediction) -> Sample:
    """Pair every reading with its prediction and leave out what was not measured or not solved.

    Motion is read from all rows, also the ones left out, since they too are part of the joint path.
    """
    rotation = np.asarray(robot.tracker.rotation)
    sensor = robot.tracker.sensor_on_tube - 1
    lengths = np.array([tube.length for tube in robot.tubes])

    base_position = np.asarray(prediction.position, float)
    measured = np.full_like(base_position, np.nan) if measurements.position is None else measurements.position
    measured_row = np.isfinite(measured).all(axis=1)
    solved_row = (np.asarray(prediction.status) == 0) & np.isfinite(base_position).all(axis=1)
    keep = measured_row & solved_row

    lever = np.sqrt(np.mean(np.sum(base_position[solved_row, :2] ** 2, axis=1))) if solved_row.any() else 0.0
    lever = max(float(lever), 1e-3)
    motion = follow(measurements.t, measurements.run, measurements.beta, measurements.alpha, lever)

    predicted, orientation = base_to_tracker(robot.tracker, base_position, prediction.quaternion)
    error = measured - predicted
    roll_known = robot.tracker.roll_known
    rotation_error = None
    if measurements.quaternion is not None:
        rotation_error = _rotation_error(measurements.quaternion[keep], orientation[keep], roll_known)
    velocity, step = _tip_motion(base_position, measurements.t, measurements.run, solved_row)
    return Sample(
        row=np.asarray(measurements.row)[keep],
        t=np.asarray(measurements.t, float)[keep],
        run=np.asarray(measurements.run)[keep],
        beta=np.asarray(measurements.beta)[keep],
        alpha=np.asarray(measurements.alpha)[keep],
        force=np.asarray(measurements.force)[keep],
        measured=measured[keep],
        predicted=predicted[keep],
        base_position=base_position[keep],
        tip_rotation=matrix_from_quaternion(prediction.quaternion[keep]),
        tip_velocity=velocity[keep],
        tip_step=step[keep],
        error=error[keep],
        base_error=error[keep] @ rotation,
        rotation=rotation,
        rotation_error=rotation_error,
        roll_known=roll_known,
        deployed=(lengths + measurements.beta)[keep, sensor],
        tube_lengths=lengths,
        lever=lever,
        motion=motion.rows(keep),
        not_measured=np.setdiff1d(measurements.row[~measured_row], measurements.row[measured_row]),
        not_solved=np.asarray(measurements.row)[measured_row & ~solved_row],
    )


def _rotation_error(measured: Array, predicted: Array, roll_known: bool) -> Array:
    """Rotation vector (K, 3) that turns the predicted orientation into the measured one, tracker frame.

    With the sensor's roll unknown only the turn between the two tip tangents (z axes) is taken.
    """
    if roll_known:
        turn = product(measured, conjugate(predicted))
        turn = turn * np.where(turn[:, :1] < 0, -1.0, 1.0)
        axis, cosine = turn[:, 1:], turn[:, 0]
        sine = np.linalg.norm(axis, axis=1)
        angle = 2 * np.arctan2(sine, cosine)
    else:
        p, m = matrix_from_quaternion(predicted)[..., 2], matrix_from_quaternion(measured)[..., 2]
        axis = np.cross(p, m)
        sine = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(sine, np.sum(p * m, axis=1))
    return axis * (angle / np.maximum(sine, 1e-300))[:, None]


def _tip_motion(position: Array, t: Array, run: Array, solved: Array) -> tuple[Array, Array]:
    """Predicted tip velocity (M, 3) [m/s] and step from the previous row (M, 3) [m], base frame.

    The velocity is the central difference inside a run, one-sided at its ends; NaN without time stamps.
    """
    count = len(position)
    step = np.full((count, 3), np.nan)
    velocity = np.full((count, 3), np.nan)
    if count < 2:
        return velocity, step
    linked = (run[1:] == run[:-1]) & solved[1:] & solved[:-1]
    step[1:][linked] = (position[1:] - position[:-1])[linked]
    previous = np.concatenate([[0], np.where(linked, np.arange(count - 1), np.arange(1, count))])
    following = np.concatenate([np.where(linked, np.arange(1, count), np.arange(count - 1)), [count - 1]])
    elapsed = np.asarray(t, float)[following] - np.asarray(t, float)[previous]
    moving = elapsed > 0  # False for NaN
    velocity[moving] = (position[following] - position[previous])[moving] / elapsed[moving, None]
    return velocity, step
