"""Runs as sessions: the frames and homes of runs that fit their readings best, together with the calibration."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask, evenly
from ctcr.errors import InputError
from ctcr.fit import joint
from ctcr.model import effect_model, parameters, user_recording
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
    at = joint.fit(robot, sessions.taken_out(readings), uncertain(robot), rows=rows_of_runs(readings)).apply(robot)
    sessions = aligned(2)
    return sessions.taken_out(readings)


def uncertain(robot: Robot) -> list[str]:
    """The standard parameters that the robot file does not know exactly."""
    found = []
    for name in parameters.expand("standard", robot):
        try:
            parameters.priors(robot, [name])
        except InputError:
            continue
        found.append(name)
    return found


def some_runs(readings: Measurements) -> Measurements:
    """The table, or of very many runs some, evenly spread, with all their rows."""
    runs = np.unique(readings.run[readings.measured])
    if len(runs) <= settings.CONVENTION_MOST_RUNS:
        return readings
    return readings.rows(np.isin(readings.run, runs[evenly(len(runs), settings.CONVENTION_MOST_RUNS)]))


def rows_of_runs(readings: Measurements) -> Mask:
    """SESSION_ROWS measured rows (M,) of a long table, of the runs alike."""
    measured, chosen = np.flatnonzero(readings.measured), np.zeros(len(readings), bool)
    order = measured[np.argsort(readings.run[measured], kind="stable")]
    each = np.split(order, np.flatnonzero(np.diff(readings.run[order])) + 1)
    for rows in each:
        chosen[rows[evenly(len(rows), max(settings.SESSION_ROWS // len(each), 1))]] = True
    return chosen


def part_of_runs(robot: Robot, readings: Measurements) -> tuple[Measurements, Mask]:
    """A table of `rows_of_runs` alone, which is cheap, all its rows chosen (M,); the whole one and those rows, where
    the robot has effects of the path."""
    readings = some_runs(readings)
    chosen = rows_of_runs(readings)
    if effect_model.of_the_path(robot):
        return readings, chosen
    return readings.rows(chosen), np.ones(np.sum(chosen), bool)


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
