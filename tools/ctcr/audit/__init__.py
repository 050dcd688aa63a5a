"""Checks of a table before any fit: spikes, missing motion, a sensor of unknown pose."""

from ctcr.audit import missing_motion, sensor_pose, spikes
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def prepared(robot: Robot, measurements: Measurements) -> tuple[Robot, Measurements, list[str]]:
    """The robot with a pose of its sensor; the table without spikes and unusable orientations, with the motion that it
    left out; notices on the changes."""
    robot, measurements, notices = sensor_pose.trusted(robot, measurements)
    for step in (spikes.left_out, missing_motion.completed):
        measurements, more = step(robot, measurements)
        notices += more
    return robot, measurements, notices
