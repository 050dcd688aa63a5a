"""Sensors that are not the tip: bodies of markers, beside it and turned anyhow."""

import numpy as np
from ctcr.robot.description import Robot
from scipy.spatial.transform import Rotation


def mounted(robot: Robot, position_m, rotation: Rotation) -> Robot:
    """The robot with a sensor at a place (3,) in the frame of its tip, exactly known."""
    pose = {
        "sensor_position_mm": (1e3 * np.asarray(position_m, float)).tolist(),
        "sensor_rotation_vector_rad": rotation.as_rotvec().tolist(),
    }
    return robot.model_copy(update={"tracker": robot.tracker.model_copy(update=pose)})


def marked(robot: Robot, random: np.random.Generator) -> Robot:
    """The robot with a marker up to 5 cm beside its tip, turned anyhow."""
    way = random.normal(size=3)
    place = random.uniform(0.005, 0.05) * way / np.linalg.norm(way)
    return mounted(robot, place, Rotation.random(random_state=int(random.integers(2**31))))


def unknown(robot: Robot) -> Robot:
    """The robot as a file has it that does not know its sensor."""
    pose = {"sensor_position_mm": None, "sensor_rotation_vector_rad": None}
    return robot.model_copy(update={"tracker": robot.tracker.model_copy(update=pose)})


def misses(found: Robot, truth: Robot) -> np.ndarray:
    """Errors (6,) of a sensor's pose as the parameters count them: position [m], turn about the tip's axes [rad]."""
    turn = Rotation.from_rotvec(found.tracker.sensor_rotation_vector) * (
        Rotation.from_rotvec(truth.tracker.sensor_rotation_vector).inv()
    )
    return np.r_[found.tracker.sensor_position - truth.tracker.sensor_position, turn.as_rotvec()]
