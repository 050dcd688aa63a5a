"""The readings that can be compared, with their errors (measured minus predicted) and the motion of joints and tip.

The model predicts poses of the tip in the base frame; T_ref and T_tip_sensor make them readings in the tracker frame.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import _core, settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.frames import base_to_tracker, conjugate, matrix_from_quaternion, product
from ctcr.model.model import status_text
from ctcr.robot.description import Robot
from ctcr.show.wording import counted, join


@dataclass(frozen=True)
class Motion:
    """Motion at each of M rows; joints are ordered beta_1..N, alpha_1..N."""

    scaled: Array  # (M, 2N) joints as lengths [m]: beta, and alpha times the tip's lever arm
    direction: NDArray[np.int8]  # (M, 2N) sign of the last motion, kept at rest; 0 before a joint first moves
    rate: Array  # (M, 2N) joint speed since the previous row [m/s, rad/s]; NaN where unknown

    def rows(self, keep: Mask) -> "Motion":
        """The same motion at some of the rows only."""
        return Motion(self.scaled[keep], self.direction[keep], self.rate[keep])


@dataclass(frozen=True)
class Sample:
    """K comparable readings in measured order; lengths in m, angles in rad, time in s (NaN when absent)."""

    robot: Robot  # as its file describes it
    row: Integers  # (K,) line in the measurement file
    t: Array  # (K,)
    run: Integers  # (K,)
    beta: Array  # (K, N)
    alpha: Array  # (K, N)
    force: Array  # (K, 3) base frame [N]
    measured: Array  # (K, 3) tracker frame
    predicted: Array  # (K, 3) tracker frame
    base_position: Array  # (K, 3) predicted tip, base frame
    tip_rotation: Array  # (K, 3, 3) predicted sensor orientation, base frame
    tip_velocity: Array  # (K, 3) predicted, base frame [m/s]; NaN where unknown
    tip_step: Array  # (K, 3) predicted tip motion since the previous row, base frame
    rotation: Array  # (3, 3) R_tracker_base
    rotation_error: Array | None  # (K, 3) rotation vector in the tracker frame, NaN rows if not measured
    deployed: Array  # (K,) arc length of the sensor's tip in front of the plate
    lever: float  # typical distance of the tip from the insertion axis [m]
    motion: Motion
    not_measured: Integers  # file lines
    not_solved: Integers  # file lines
    why: list[str]  # the model has no solution there, in words

    @property
    def error(self) -> Array:
        """Position error (K, 3), tracker frame."""
        return self.measured - self.predicted

    @property
    def base_error(self) -> Array:
        """Position error (K, 3), base frame."""
        return self.error @ self.rotation

    @property
    def unsolved(self) -> list[str]:
        """How many readings the errors are not of, as the model has no solution there, and what may be wrong."""
        if not self.why:
            return []
        kinds, every = Counter(self.why), len(self.why) + len(self.row)
        reasons = join([f"{why}: {count}" for why, count in kinds.items()])
        said = [f"The model has no solution for {len(self.why)} of {counted(every, 'reading')} ({reasons})."]
        if _core.status_text(_core.Status.joints_out_of_order) in kinds:
            said.append("Where joints are out of order, length_mm of a tube, its home, or its betas may be wrong.")
        return said


def take_sample(robot: Robot, measurements, prediction) -> Sample:
    """Pair every reading with its prediction and leave out readings that were not measured or not solved.

    Motion is read from all rows, also the ones left out, since they too are part of the joint path.
    """
    m, tracker = measurements, robot.tracker
    position = np.asarray(prediction.position, float)
    known = np.isfinite(m.positions).all(axis=1)
    status = np.asarray(prediction.status)
    solved = (status == 0) & np.isfinite(position).all(axis=1)
    keep = known & solved
    lever = np.sqrt(np.mean(np.sum(position[solved, :2] ** 2, axis=1))) if solved.any() else 0.0
    lever = max(float(lever), 1e-3)
    predicted, orientation = base_to_tracker(tracker, position, prediction.quaternion)
    rotation_error = None
    if m.quaternion is not None:
        rotation_error = _rotation_error(m.quaternion[keep], orientation[keep], tracker.sensor_rotation_known)
    velocity, step = _tip_motion(position, m.t, m.run, solved)
    arrays = {name: np.asarray(getattr(m, name)) for name in ("row", "t", "run", "beta", "alpha", "force")}
    arrays |= {"measured": m.positions, "predicted": predicted, "base_position": position}
    arrays |= {"tip_velocity": velocity, "tip_step": step}
    arrays["deployed"] = (robot.lengths + m.beta)[:, tracker.sensor_on_tube - 1]
    return Sample(
        robot,
        **{name: values[keep] for name, values in arrays.items()},
        tip_rotation=matrix_from_quaternion(prediction.quaternion[keep]),
        rotation=np.asarray(tracker.rotation),
        rotation_error=rotation_error,
        lever=lever,
        motion=follow(m.t, m.run, m.beta, m.alpha, lever).rows(keep),
        not_measured=np.setdiff1d(m.row[~known], m.row[known]),
        not_solved=np.asarray(m.row)[known & ~solved],
        why=[status_text(code) for code in status[known & ~solved].tolist()],
    )


def _rotation_error(measured: Array, predicted: Array, known: bool) -> Array:
    """Rotation vector (K, 3) from the predicted to the measured orientation, tracker frame.

    With the sensor's rotation unknown it is the smallest rotation between the two tip tangents (z axes).
    """
    if known:
        turn = product(measured, conjugate(predicted))
        turn *= np.where(turn[:, :1] < 0, -1.0, 1.0)
    else:
        p, m = matrix_from_quaternion(predicted)[..., 2], matrix_from_quaternion(measured)[..., 2]
        turn = np.column_stack([1 + np.sum(p * m, axis=1), np.cross(p, m)])  # its length does not matter
    sine = np.linalg.norm(turn[:, 1:], axis=1)
    angle = 2 * np.arctan2(sine, turn[:, 0])
    return turn[:, 1:] * (angle / np.maximum(sine, 1e-300))[:, None]


def _tip_motion(position: Array, t: Array, run: Array, solved: Array) -> tuple[Array, Array]:
    """Predicted tip velocity (M, 3) [m/s] and step from the previous row (M, 3) [m], base frame.

    The velocity is the central difference inside a run, one-sided at its ends; NaN without time stamps.
    """
    step, velocity = np.full(position.shape, np.nan), np.full(position.shape, np.nan)
    linked = (run[1:] == run[:-1]) & solved[1:] & solved[:-1]
    step[1:][linked] = np.diff(position, axis=0)[linked]
    here = np.arange(len(position))
    previous, following = here - np.append(False, linked), here + np.append(linked, False)
    elapsed = np.asarray(t, float)[following] - np.asarray(t, float)[previous]
    moving = elapsed > 0  # False for NaN
    velocity[moving] = (position[following] - position[previous])[moving] / elapsed[moving, None]
    return velocity, step


def follow(t: Array, run: Integers, beta: Array, alpha: Array, lever: float) -> Motion:
    """Motion along a joint path of at least one row.

    t (M,) [s, NaN allowed], run (M,), beta (M, N) [m], alpha (M, N) [rad]; lever [m] turns a base rotation
    into a length that is comparable with a translation (the tip's typical distance from the axis).
    """
    joints = np.hstack([beta, alpha])
    rate, direction = np.full(joints.shape, np.nan), np.zeros(joints.shape, np.int8)
    linked = run[1:] == run[:-1]
    elapsed = np.where(linked & (np.diff(t) > 0), np.diff(t), np.nan)
    rate[1:] = np.diff(joints, axis=0) / elapsed[:, None]
    band = settings.REVERSAL * np.ptp(joints, axis=0)
    for rows in np.split(np.arange(len(run)), np.flatnonzero(~linked) + 1):
        for column in range(joints.shape[1]):
            direction[rows, column] = _directions(joints[rows, column].tolist(), band[column])
    return Motion(np.hstack([beta, alpha * lever]), direction, rate)


def _directions(path: list[float], band: float) -> list[int]:
    """Sign of the last motion at every point of a path; a reversal counts once it exceeds the band."""
    low = high = path[0]
    sign, signs = 0, []
    for value in path:
        if value < low:
            low = value
        elif value > high:
            high = value
        if sign >= 0 and value < high - band:
            sign, low = -1, value
        elif sign <= 0 and value > low + band:
            sign, high = 1, value
        signs.append(sign)
    return signs
