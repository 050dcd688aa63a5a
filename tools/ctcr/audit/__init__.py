"""Checks of a table before any fit: spikes, missing motion, an unknown sensor roll."""

from ctcr.audit import missing_motion, sensor_roll, spikes
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def prepared(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table without spikes and unusable orientations, with the motion that it left out; notices on the changes."""
    notices = []
    for step in (sensor_roll.positions_alone, spikes.left_out, missing_motion.completed):
        measurements, more = step(robot, measurements)
        notices += more
    return measurements, notices
