"""How wrong a model is: `ctcr.compare`, and the command of that name."""

import numpy as np

from ctcr.api.reviewed import reviewed, without_false_poses
from ctcr.arguments import checked
from ctcr.audit import copies, missing_motion, sensor_pose, snaps
from ctcr.compare import analysis
from ctcr.compare.analysis import Comparison
from ctcr.conventions import Review
from ctcr.diagnose import sessions
from ctcr.errors import InputError
from ctcr.fit.floors import floors
from ctcr.model.table_poses import predict
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.show.wording import sentence
from ctcr.table.measurements import Measurements, check_of


@checked
def compare(robot: Robot, table: Measurements, *, steps: int = 4) -> Comparison:
    """Compares predicted poses with measured ones: the size of the error beside the noise, and what it depends on.

    steps    factor on the integration steps: more are slower and more accurate
    First tests whether the table or the robot file follows another convention; where they cannot be compared as they
    are, corrected ones are. Raises InputError where no row can be compared.
    """
    check_of(robot, table)
    files = [*robot.files, *table.files]
    table, copied = copies.left_out(table)
    found = reviewed(robot, table)
    readings, corrected = table, []
    prediction = None if table.refusal else predict(robot.standard, readings, steps=steps)
    if prediction is None or (found.wrong and not np.isfinite(prediction.position).any()):
        robot, readings = found.robot, found.readings
        corrected = ["table and robot file cannot be compared as they are: all that follows is of corrected ones"]
        prediction = predict(robot.standard, readings, steps=steps)
    readings, excluded = without_false_poses(robot, readings, found, prediction.position)
    robot, placed = sensor_pose.placed(robot, readings)
    own, floor = _fitted(robot, readings, found)
    added: list[str] = []
    if robot.effects:  # their state may depend on motions that the table leaves out
        readings, added = missing_motion.completed(robot, readings)
        prediction = predict(robot, readings, steps=steps)
    notices = [*table.doubts, *map(sentence, (*copied, *corrected, *placed)), *excluded, *map(sentence, added)]
    snapped: list[int] = [] if found.wrong else readings.row[snaps.snapped(robot, readings, prediction)].tolist()
    known = {"notices": notices, "floors": floor, "files": files, "snapped": snapped, "unexplained": found.unexplained}
    try:
        return analysis.compare(robot, readings, prediction, conventions=found.findings, sessions=own, **known)
    except InputError as error:  # nothing is left to compare: the robot file may say why
        raise InputError([*error.problems, *robot_file.warnings(robot)]) from None


def _fitted(robot: Robot, readings: Measurements, found: Review) -> tuple[list[str], dict[str, float]]:
    """Results of a fit to the readings: sentences on frames and homes of single runs, and the floors of the error."""
    said: list[str] = []
    if not found.wrong:
        readings, said = sessions.of_runs(robot, readings)
    return said, floors(robot, readings).as_dict()
