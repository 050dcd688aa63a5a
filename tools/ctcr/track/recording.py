"""Runs on the bench as files: the measurements, and beside them reference and results of the controller, row by row.

Also as MCAP, the container that viewers of robot data read: each row at its time, in JSON.
"""

import json
from pathlib import Path

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.fault import needed
from ctcr.bench.record.folder import ABOUT, COPIES, TABLE, Folder, about_of
from ctcr.frames import tracker_to_base
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.show.output import atomic_writer
from ctcr.table import measurements
from ctcr.table.csv_table import read_columns
from ctcr.table.measurements import column_names, group_columns
from ctcr.track.result import Run, beside_obstacle
from ctcr.track.scenario import TASKS, Scenario

CONTROL = "control.csv"
JOINTS, MEASUREMENTS, REFERENCE = "/joints", "/measurements", "/reference"  # channels of MCAP
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
    """The entries of the finished runs."""
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


# ---- MCAP


def write_mcap(folder: str | Path, target: str | Path) -> dict[str, int]:
    """Writes the recording of a folder; the number of messages on each channel.

    A message holds the columns of its channel under their names, which carry the units; null was not measured. Times
    are those of the day. The files that the recording was made with are attached. Raises InputError where the folder
    holds no recording, or the package mcap is missing.
    """
    writer_of = needed("mcap", "mcap.writer", "export").Writer
    folder = Path(folder)
    start, counts = about_of(folder)["started_unix_s"], {}
    with atomic_writer(target, binary=True) as file:
        writer = writer_of(file)
        writer.start(profile="", library="ctcr")
        for channel, (columns, rows) in _channels(folder).items():
            counts[channel] = _write(writer, channel, columns, rows, start)
        for name in (ABOUT, *COPIES.values()):
            if (folder / name).exists():
                kind = "application/json" if name.endswith(".json") else "text/plain"
                stamp = _ns(start)
                writer.add_attachment(stamp, stamp, name, kind, (folder / name).read_bytes())
        writer.finish()
    return counts


def _channels(folder: Path) -> dict[str, tuple[list[str], Array]]:
    """Columns and rows of each channel; the first column is t_s."""
    n = robot_file.load(folder / COPIES["robot"]).n_tubes
    names, groups = column_names(n), group_columns(n)
    table = read_columns(folder / TABLE, names)
    kept = {
        JOINTS: [name for group in ("t", "run", "beta", "alpha") for name in groups[group]],
        MEASUREMENTS: [name for group in ("t", "run", "force", "position", "quaternion") for name in groups[group]],
    }
    found = {channel: (columns, table[:, [names.index(name) for name in columns]]) for channel, columns in kept.items()}
    if (folder / CONTROL).exists():
        found[REFERENCE] = list(COLUMNS), read_columns(folder / CONTROL, COLUMNS)
    return found


def _write(writer, topic: str, columns: list[str], rows: Array, start: float) -> int:
    schema = {
        "type": "object",
        "required": columns,
        "properties": {name: {"type": ["number", "null"]} for name in columns},
    }
    described = writer.register_schema(f"ctcr{topic}", "jsonschema", json.dumps(schema).encode())
    channel = writer.register_channel(topic, "json", described)
    for number, row in enumerate(rows):
        message = {name: None if value != value else value for name, value in zip(columns, row.tolist(), strict=True)}
        time = _ns(start + row[0])
        writer.add_message(channel, time, json.dumps(message).encode(), time, number)
    return len(rows)


def _ns(seconds: float) -> int:
    return round(1e9 * seconds)
