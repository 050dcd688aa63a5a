"""Runs on the bench as files: the measurements, and beside them what the controller wanted and found, row by row."""

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.record.folder import TABLE, Folder
from ctcr.frames import tracker_to_base
from ctcr.robot.description import Robot
from ctcr.table import measurements
from ctcr.table.csv_table import read_columns
from ctcr.track.result import Run, beside_obstacle
from ctcr.track.scenario import TASKS, Scenario

Array = NDArray[np.float64]

CONTROL = "control.csv"
COLUMNS = (
    "t_s",
    "run",
    "path_s",
    "wanted_x_m",
    "wanted_y_m",
    "wanted_z_m",
    *(f"shortfall_{task.replace(' ', '_')}" for task in TASKS),
    "held_base_gaps",
    "held_tip_gaps",
    "held_travel",
    "held_speed",
    "model_fx_N",
    "model_fy_N",
    "model_fz_N",
    "stability",
)


def control_row(t: float, run: int, result, row: int) -> list[float | str]:
    """A row of COLUMNS: row `row` of a LoopResult, whose reading came at `t` [s]."""
    wanted = map(repr, result.wanted[row].tolist())  # exact: whether a row counts must not hang on rounding
    columns = (result.shortfall, result.held, result.force)
    return [t, run, result.time[row], *wanted, *(v for column in columns for v in column[row]), result.stability[row]]


def finished(folder: Folder) -> list[dict]:
    """What is noted of the runs that came to their end."""
    return [entry for entry in folder.about.get("runs", []) if entry["ended"] == "finished"]


def runs_of(folder: Folder, scenario: Scenario, robot: Robot, reading_age: float = 0.0) -> list[Run]:
    """The finished runs; tips are those measured, at the time when they were there: `reading_age` [s] before the
    reading.

    Raises InputError where a table is damaged.
    """
    table = measurements.load(folder.path / TABLE, robot.n_tubes)
    control = read_columns(folder.path / CONTROL, COLUMNS)
    t, measured, controlled = np.intersect1d(table.t, control[:, 0], return_indices=True)
    joints = np.hstack(robot.joints_of_table(table.beta[measured], table.alpha[measured]))
    tip, _ = tracker_to_base(robot.tracker, table.position[measured], table.quaternion[measured])
    control, number = control[controlled], table.run[measured]
    runs = []
    for entry in finished(folder):
        mine = number == entry["run"]
        there = tips_at(t[mine], t[mine] + reading_age, tip[mine])
        runs.append(_run(entry, scenario, joints[mine], there, control[mine]))
    return runs


def tips_at(t: Array, when: Array, tip: Array) -> Array:
    """The tip (K, 3) at the times `when` (K,), of tips (R, 3) at the times t (R,); beyond them the first or last."""
    return np.column_stack([np.interp(when, t, axis) for axis in tip.T])


def _run(entry: dict, scenario: Scenario, joints, tip, control) -> Run:
    path, wanted, shortfall, held, force, stability = np.split(control[:, 2:], _ENDS, axis=1)
    return Run(
        entry["mass_g"],
        entry["repetition"],
        entry["status"],
        entry["settled_m"],
        path[:, 0],
        joints,
        tip,
        wanted,
        shortfall,
        held.astype(np.int32),
        force,
        stability[:, 0],
        *beside_obstacle(scenario, tip, wanted),
    )


_ENDS = np.cumsum([1, 3, len(TASKS), 4, 3])
