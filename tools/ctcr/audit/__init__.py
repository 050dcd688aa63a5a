"""Checks of a table before any fit: copies, spikes, missing motion, a sensor of unknown pose."""

from ctcr.audit import missing_motion, sensor_pose
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def prepared(robot: Robot, measurements: Measurements) -> tuple[Robot, Measurements, list[str]]:
    """The robot with a pose of its sensor; the table without unusable orientations, with the motion that it left out;
    notices on the changes."""
    robot, measurements, notices = sensor_pose.trusted(robot, measurements)
    measurements, more = missing_motion.completed(robot, measurements)
    return robot, measurements, [*notices, *more]
