"""What becomes of a table of readings before effects are fitted to it."""

from ctcr.audit import missing_motion, sensor_roll, spikes
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def prepared(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table without what says nothing of the robot, with the motion that it leaves out, and what to say of both."""
    said = []
    for step in (sensor_roll.positions_alone, spikes.left_out, missing_motion.completed):
        measurements, notices = step(robot, measurements)
        said += notices
    return measurements, said
