"""Runs as sessions: the frames and homes of runs that fit their readings best, together with the calibration."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask, evenly
from ctcr.fit import joint
from ctcr.model import parameters, user_recording
from ctcr.model.sessions import home_names
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements
from ctcr.table.sessions import Sessions


def as_sessions(robot: Robot, readings: Measurements, *, homes: bool = False) -> Measurements:
    """The readings without the frame, and with `homes` the homes, that each run has of its own, at the calibration that
    fits best with these.

    Raises NoFit where none is possible.
    """
    sessions, at = Sessions.alike(robot, readings, homes), robot

    def aligned(steps: int) -> Sessions:
        found = sessions
        for _ in range(steps):
            recorded = user_recording.recording_of(at, found.taken_out(readings))
            found = found.moved(recorded.moves(np.empty(0)))
        return found

    sessions = aligned(settings.SESSION_ALIGNMENTS)  # at the robot file's values: within a fit they act linearly
    at = joint.fit(robot, sessions.taken_out(readings), rows=rows_of_runs(readings)).apply(robot)
    sessions = aligned(2)
    return sessions.taken_out(readings)


def rows_of_runs(readings: Measurements) -> Mask:
    """SESSION_ROWS measured rows (M,) of a long table, equally many of each run."""
    runs, chosen = np.unique(readings.run[readings.measured]), np.zeros(len(readings), bool)
    for run in runs:
        rows = np.flatnonzero(readings.measured & (readings.run == run))
        chosen[rows[evenly(len(rows), max(settings.SESSION_ROWS // len(runs), 1))]] = True
    return chosen


def placed(robot: Robot, sessions: Sessions | None) -> Robot:
    """The robot with the frame, and the homes, of the typical run."""
    if sessions is None:
        return robot
    shift, turn, homes = sessions.typical
    names = [f"tracker.{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"]
    values = [*(robot.tracker.position + shift), *turn]
    if homes is not None:
        own = home_names(robot.n_tubes)
        names, values = [*names, *own], [*values, *(parameters.values(robot, own) + homes)]
    return parameters.applied(robot, names, values)
