"""Runs as sessions: the frames and homes of runs that fit their readings best, together with the calibration."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask, evenly
from ctcr.fit import joint
from ctcr.model import effect_model, parameters, user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements
from ctcr.table.sessions import Sessions


def as_sessions(robot: Robot, readings: Measurements, *, homes: bool = False) -> Measurements:
    """The readings with each run's own frame taken out, and with `homes` its own homes too, at the calibration that
    fits best with them.

    Raises NoFit where no fit is possible.
    """
    part, rows = part_of_runs(robot, some_runs(readings))
    # At the robot file's values first: within a fit, the remaining changes of the frames act linearly.
    sessions = _aligned(robot, part, Sessions.alike(robot, part, homes), settings.SESSION_ALIGNMENTS)
    fit = joint.fit(robot, sessions.taken_out(part), parameters.uncertain(robot), rows=rows, tolerance=settings.COARSE)
    return sessions_at(fit.apply(robot), readings, homes=homes)


def sessions_at(robot: Robot, readings: Measurements, *, homes: bool = False) -> Measurements:
    """Like as_sessions(), at the values of this robot. A few rows of each run bring its frame near, and one step with
    all rows makes it exact: solving all rows of a long table is by far the most expensive step."""
    part, _ = part_of_runs(robot, readings)
    sessions = _aligned(robot, part, Sessions.alike(robot, readings, homes), settings.SESSION_ALIGNMENTS)
    return _aligned(robot, readings, sessions, 1).taken_out(readings)


def _aligned(robot: Robot, readings: Measurements, sessions: Sessions, steps: int) -> Sessions:
    """The sessions after Gauss-Newton steps towards those that fit the readings best."""
    for _ in range(steps):
        recorded = user_recording.recording_of(robot, sessions.taken_out(readings))
        sessions = sessions.moved(recorded.moves(np.empty(0)))
    return sessions


def some_runs(readings: Measurements) -> Measurements:
    """The table, or of very many runs some, evenly spread, with all their rows."""
    runs = np.unique(readings.run[readings.measured])
    if len(runs) <= settings.CONVENTION_MOST_RUNS:
        return readings
    return readings.rows(np.isin(readings.run, runs[evenly(len(runs), settings.CONVENTION_MOST_RUNS)]))


def part_of_runs(robot: Robot, readings: Measurements) -> tuple[Measurements, Mask]:
    """A table of some rows of each run, which is cheap, as `some_rows` gives it."""
    measured, chosen = np.flatnonzero(readings.measured), np.zeros(len(readings), bool)
    order = measured[np.argsort(readings.run[measured], kind="stable")]
    runs = np.split(order, np.flatnonzero(np.diff(readings.run[order])) + 1)
    each = settings.SESSION_ROWS // min(len(runs), settings.CONVENTION_MOST_RUNS)
    for rows in runs:
        chosen[rows[evenly(len(rows), each)]] = True
    return some_rows(robot, readings, chosen)


def some_rows(robot: Robot, readings: Measurements, chosen: Mask) -> tuple[Measurements, Mask]:
    """A table of the chosen rows (M,) alone, and all its rows; the whole one and those rows, where its other rows are
    part of the path that effects of the robot remember."""
    if effect_model.of_the_path(robot):
        return readings, chosen
    return readings.rows(chosen), np.ones(np.sum(chosen), bool)


def placed(robot: Robot, sessions: Sessions | None) -> Robot:
    """The robot with the frame, and the homes, of the typical run."""
    if sessions is None:
        return robot
    shift, turn, homes = sessions.typical
    names = parameters.expand("tracker.frame", robot)
    values = [*(robot.tracker.position + shift), *turn]
    if homes is not None:
        own = parameters.expand("homes", robot)
        names, values = [*names, *own], [*values, *(parameters.values(robot, own) + homes)]
    return parameters.applied(robot, names, values)
