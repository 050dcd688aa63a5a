"""Runs on the bench as files: the measurements, and beside them reference and results of the controller, row by row."""

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.record.folder import TABLE, Folder
from ctcr.frames import tracker_to_base
from ctcr.robot.description import Robot
from ctcr.table import measurements
from ctcr.table.csv_table import read_columns
from ctcr.track.result import Run, beside_obstacle
from ctcr.track.scenario import TASKS, Scenario

CONTROL = "control.csv"
_GROUPS = (
    ("path_s",),
    ("wanted_x_m", "wanted_y_m", "wanted_z_m"),
    tuple(f"shortfall_{task.replace(' ', '_')}" for task in TASKS),
    ("held_base_gaps", "held_tip_gaps", "held_travel", "held_speed"),
    ("model_fx_N", "model_fy_N", "model_fz_N"),
    ("stability",),
)
COLUMNS = ("t_s", "run", *(column for group in _GROUPS for column in group))


def control_row(t: float, run: int, result, row: int) -> list[float | str]:
    """A row of COLUMNS: row `row` of a LoopResult, whose reading came at `t` [s]."""
    wanted = map(repr, result.wanted[row].tolist())  # exact: rounding must not decide whether a row counts
    columns = (result.shortfall, result.held, result.force)
    return [t, run, result.time[row], *wanted, *(v for column in columns for v in column[row]), result.stability[row]]


def finished(folder: Folder) -> list[dict]:
    """The entries of the runs that came to their end."""
    return [entry for entry in folder.about.get("runs", []) if entry["ended"] == "finished"]


def runs_of(folder: Folder, scenario: Scenario, robot: Robot, reading_age: float = 0.0) -> list[Run]:
    """The finished runs, with the measured tips moved to the time when they were there.

    `reading_age` [s]: how long before its reading a tip was there. Raises InputError where a table is damaged.
    """
    table = measurements.load(folder.path / TABLE, robot.n_tubes)
    control = read_columns(folder.path / CONTROL, COLUMNS)
    t, measured, controlled = np.intersect1d(table.t, control[:, 0], return_indices=True)
    joints = np.hstack(robot.joints_of_table(table.beta[measured], table.alpha[measured]))
    tip, _ = tracker_to_base(robot.tracker, table.position[measured], table.quaternion[measured])
    groups = np.split(control[controlled, 2:], np.cumsum([len(group) for group in _GROUPS])[:-1], axis=1)
    runs = []
    for entry in finished(folder):
        mine = table.run[measured] == entry["run"]
        path, wanted, shortfall, held, force, stability = (group[mine] for group in groups)
        there = tips_at(t[mine], t[mine] + reading_age, tip[mine])
        about = (entry[name] for name in ("mass_g", "repetition", "status", "settled_m"))
        found = (path[:, 0], joints[mine], there, wanted, shortfall, held.astype(np.int32), force, stability[:, 0])
        runs.append(Run(*about, *found, *beside_obstacle(scenario, there, wanted)))
    return runs


def tips_at(t: Array, when: Array, tip: Array) -> Array:
    """The tip (K, 3) at the times `when` (K,), of tips (R, 3) at the times t (R,); beyond them the first or last."""
    return np.column_stack([np.interp(when, t, axis) for axis in tip.T])
