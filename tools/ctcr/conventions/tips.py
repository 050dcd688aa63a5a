"""Predicted positions of the sensor by the standard model, and their errors."""

import numpy as np

from ctcr.arrays import Array
from ctcr.frames import of_sensor, points_to_tracker
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def predicted(robot: Robot, readings: Measurements) -> Array:
    """Positions (K, 3) [m], base frame; NaN where there is no solution."""
    found = standard_tips(robot, readings)
    return np.where(found.solved[:, None], of_sensor(robot.tracker, found.position, found.quaternion)[0], np.nan)


def errors(robot: Robot, readings: Measurements, positions: Array | None = None) -> Array:
    """Distance (K,) [m] of each reading from its prediction, or from these positions (K, 3), base frame."""
    positions = predicted(robot, readings) if positions is None else positions
    return np.linalg.norm(readings.position - points_to_tracker(robot.tracker, positions), axis=1)
