"""The pose of the sensor in the frame of the tip: estimated, then fitted, where the robot file does not know it."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array, evenly
from ctcr.frames import matrix_from_quaternion, matrix_from_rotation_vector, nearest_rotation, points_to_base
from ctcr.model import parameters
from ctcr.model.model import Prediction
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show.wording import numbers
from ctcr.table.measurements import Measurements

ROTATION = "tracker.sensor_rotation."


def placed(robot: Robot, measurements: Measurements, tips: Prediction | None = None) -> tuple[Robot, list[str]]:
    """The robot with a pose of the sensor where its file does not know it, and a notice.

    It is the one that fits the readings best where the tracker frame is that of the file. The rotation stays unknown
    where the readings have none in common, as of a sensor that does not measure its roll.
    tips    those of all rows, base frame, where they are predicted already
    """
    tracker = robot.tracker
    if tracker.sensor_position_mm is not None and tracker.sensor_rotation_known:
        return robot, []
    if tips is None:
        measurements, tips = _predicted(robot, measurements)
    turn, pose, width, said = matrix_from_quaternion(tips.quaternion), {}, {}, []
    read = tips.solved & measurements.oriented
    if not tracker.sensor_rotation_known and read.any():
        seen = tracker.rotation.T @ matrix_from_quaternion(measurements.quaternions[read])
        vector = _rotation(robot, np.swapaxes(turn[read], 1, 2) @ seen)
        if vector is not None:
            pose["sensor_rotation_vector_rad"] = vector.tolist()
            width["sensor_rotation_deg"] = float(np.degrees(parameters.ANYWHERE["rotation"]))
            said.append(f"the rotation vector {numbers(vector, 3)} rad")
    if tracker.sensor_position_mm is None and np.isfinite(measurements.positions).all(axis=1).any():
        pose["sensor_position_mm"] = (1e3 * position(robot, measurements, tips)).tolist()
        width["sensor_position_mm"] = 1e3 * parameters.ANYWHERE["position"]
        said.insert(0, f"the position {numbers(pose['sensor_position_mm'], 2)} mm")
    if not pose:
        return robot, []
    stated = robot.uncertainty.model_dump()
    new: dict[str, Any] = {
        "tracker": tracker.model_copy(update=pose),
        "uncertainty": robot.uncertainty.model_copy(
            update={key: value for key, value in width.items() if stated[key] is None}
        ),
    }
    text = f"the sensor's pose is unknown: in the tip's frame, {' and '.join(said)} fit the readings best"
    return robot.model_copy(update=new), [text]


def usable(robot: Robot, measurements: Measurements) -> tuple[Robot, Measurements, list[str]]:
    """The robot as `placed`, the usable readings, and notices on both."""
    robot, said = placed(robot, measurements)
    if robot.tracker.sensor_rotation_known or not measurements.oriented.any():
        return robot, measurements, said
    notice = "the sensor's rotation is unknown and differs from reading to reading: orientations are not used"
    return robot, replace(measurements, quaternion=None), [*said, notice]


def trusted(robot: Robot, measurements: Measurements) -> tuple[Robot, Measurements, list[str]]:
    """As `usable`, without orientations where of the sensor's rotation the roll alone is uncertain.

    Such a sensor may be tilted too, which would be taken for an effect of the robot.
    """
    uncertain, notices = {name for name in parameters.of_sensor(robot) if name.startswith(ROTATION)}, []
    if len(uncertain) in (1, 2) and measurements.oriented.any():
        measurements = replace(measurements, quaternion=None)
        notices = [
            "the sensor's roll is unknown: orientations are not used (write sensor_rotation_vector_rad once it is "
            "known, or leave it null and uncertainty.sensor_rotation_deg out, so that its tilt is found too)"
        ]
    robot, measurements, said = usable(robot, measurements)
    return robot, measurements, [*notices, *said]


def with_pose(free: str | Iterable[str], robot: Robot) -> list[str]:
    """The parameters that names stand for (`parameters.expand`), and what is uncertain of the sensor's pose."""
    names, more = parameters.expand(free, robot), parameters.of_sensor(robot)
    return parameters.expand([*names, *more], robot) if more else names


def _predicted(robot: Robot, measurements: Measurements) -> tuple[Measurements, Prediction]:
    """Readings spread over the table, and their tips."""
    few = measurements.rows(evenly(len(measurements), settings.SENSOR_ROWS))
    return few, standard_tips(robot, few)


def _rotation(robot: Robot, turns: Array) -> Array | None:
    """Rotation vector of the sensor of those (K, 3, 3) that the readings ask for, about uncertain axes alone; None
    where they do not agree."""
    uncertain = [ROTATION + axis in parameters.of_sensor(robot) for axis in "xyz"]
    vector = Rotation.from_matrix(nearest_rotation(turns.mean(axis=0))).as_rotvec() * uncertain
    cosine = (np.einsum("kij,ij->k", turns, matrix_from_rotation_vector(vector)) - 1) / 2
    return vector if cosine.mean() > settings.ONE_ROTATION else None


def position(robot: Robot, measurements: Measurements, tips: Prediction | None = None) -> Array:
    """The sensor's position (3,) [m] in the frame of the tip that fits the readings best, whatever the file states.

    The tracker frame may shift within its stated uncertainty. A component that the readings do not determine, as no tip
    turns about another axis, stays near 0. `tips` as of `placed`.
    """
    if tips is None:
        measurements, tips = _predicted(robot, measurements)
    read = tips.solved & np.isfinite(measurements.positions).all(axis=1)
    turns = matrix_from_quaternion(tips.quaternion[read])
    beside = points_to_base(robot.tracker, measurements.positions[read]) - tips.position[read]
    frame = 1e-3 * max(robot.uncertainty.of("tracker_frame_mm", axis) for axis in range(3))
    left = np.concatenate([turns, np.broadcast_to(np.eye(3), turns.shape)], axis=2).reshape(-1, 6)
    prior = np.diag([frame / parameters.ANYWHERE["position"]] * 3 + [1.0] * 3)
    return np.linalg.lstsq(np.vstack([left, prior]), np.append(beside, np.zeros(6)), rcond=None)[0][:3]
