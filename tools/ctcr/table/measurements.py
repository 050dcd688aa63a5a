"""The table of measurements, measurements.csv: one row per reading, in the order measured, SI units.

Between rows all joints move in a straight line in joint space, so order and direction of motion are data.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ctcr.errors import InputError, Problem, did_you_mean
from ctcr.robot.units import Quantity
from ctcr.show.output import Progress
from ctcr.table.csv_table import SHOWN, Faults, NumberTable, open_table

JOINT_ORDER_SLACK_M = 1e-6  # rounding of recorded joints
UNIT_QUATERNION_SLACK = 1e-3
_MAX_RUN = 1e15  # whole numbers that a float holds exactly

Array = NDArray[np.float64]

QUANTITIES = {  # what lies outside the usual is in another unit, or garbage
    "beta": Quantity("m", usual=(1e-9, 5)),
    "alpha": Quantity("rad", usual=(1e-12, 1000)),
    "force": Quantity("N", usual=(1e-12, 1000)),
    "position": Quantity("m", usual=(1e-12, 20)),
}
_MAY_BE_EMPTY = ("t", "position", "quaternion")


@dataclass(frozen=True)
class Measurements:
    """M readings of a robot with N tubes. What was not measured is NaN, or None where its columns are absent."""

    t: Array  # (M,) [s]
    run: NDArray[np.int64]  # (M,) the path that the reading belongs to
    beta: Array  # (M, N) grasped points [m], <= 0
    alpha: Array  # (M, N) base angles [rad]
    force: Array  # (M, 3) known force at the tip [N], base frame; zero where the columns are absent
    position: Array | None  # (M, 3) sensor [m], tracker frame
    quaternion: Array | None  # (M, 4) sensor (w, x, y, z), unit, tracker frame
    row: NDArray[np.int64]  # (M,) row of the file; the header is row 1
    warnings: list[Problem] = field(default_factory=list)
    from_home: bool = True  # whether the robot came to the first row straight from home; else it was at rest there

    def __len__(self) -> int:
        return len(self.run)


def load(path: str | Path, n_tubes: int) -> Measurements:
    """Reads a table for a robot of `n_tubes` tubes. Raises InputError with row, column, value and unit."""
    table = open_table(path)
    groups = _groups(table, n_tubes)
    faults = Faults(str(path))
    data = {name: np.empty((table.n_rows, len(columns))) for name, columns in groups.items()}
    with Progress(f"reading {table.path.name}", table.end - table.start) as progress:
        for rows, numbers, size in table.blocks(faults):
            for name, columns in groups.items():
                data[name][rows - 2] = numbers[:, columns]
                _check(name, numbers[:, columns], rows, [table.columns[i] for i in columns], faults)
            progress.advance(size)
    faults.raise_any()
    return _measurements(data, table)


def column_names(n_tubes: int) -> list[str]:
    """All columns of the format, in its order."""
    return [name for names in group_columns(n_tubes).values() for name in names]


def group_columns(n_tubes: int) -> dict[str, tuple[str, ...]]:
    """Columns of the format, by what they hold."""
    numbers = range(1, n_tubes + 1)
    return {
        "t": ("t_s",),
        "run": ("run",),
        "beta": tuple(f"beta{i}_m" for i in numbers),
        "alpha": tuple(f"alpha{i}_rad" for i in numbers),
        "force": ("fx_N", "fy_N", "fz_N"),
        "position": ("x_m", "y_m", "z_m"),
        "quaternion": ("qw", "qx", "qy", "qz"),
    }


def _groups(table: NumberTable, n_tubes: int) -> dict[str, list[int]]:
    """Indices of the columns of each group that is present; raises InputError with all faults of the header."""
    expected = group_columns(n_tubes)
    faults = [*_unknown_columns(table.columns, expected, n_tubes)]
    meant = {near for _, _, near in faults}
    faults += [fault for fault in _missing_columns(table.columns, expected, n_tubes) if fault[0] not in meant]
    if faults:
        problems = [Problem(text, str(table.path), 1, column, line_name="row") for column, text, _ in faults]
        raise InputError(problems[:SHOWN], omitted=max(0, len(problems) - SHOWN))
    return {
        name: [table.columns.index(column) for column in columns]
        for name, columns in expected.items()
        if columns[0] in table.columns
    }


def _unknown_columns(present: tuple[str, ...], expected: dict[str, tuple[str, ...]], n_tubes: int):
    """(column, what is wrong, the column that was meant), for columns that are unknown or doubled."""
    known = [name for names in expected.values() for name in names]
    for column in dict.fromkeys(present):
        joint = re.match(r"(?:beta|alpha)([0-9]+)_", column)
        near = did_you_mean(column, [name for name in known if name not in present])
        if column in known:
            if present.count(column) > 1:
                yield column, "this column is there more than once", None
        elif joint and int(joint[1][:9]) > n_tubes:
            yield column, f"unknown column: the robot has {n_tubes} tubes", None
        elif near and near.partition("_")[0] == column.partition("_")[0]:
            yield column, f"unknown column: did you mean {near}? Columns are in SI units", near
        else:
            yield column or "(no name)", "unknown column" + (f": did you mean {near}?" if near else ""), near


def _missing_columns(present: tuple[str, ...], expected: dict[str, tuple[str, ...]], n_tubes: int):
    for name, columns in expected.items():
        absent = [column for column in columns if column not in present]
        if name in ("beta", "alpha"):
            yield from ((column, f"this column is missing: the robot has {n_tubes} tubes", None) for column in absent)
        elif len(absent) < len(columns):
            text = f"this column is missing: {', '.join(columns)} come together"
            yield from ((column, text, None) for column in absent)


def _check(name: str, block: Array, rows: NDArray[np.int64], columns: list[str], faults: Faults) -> None:
    """Faults in the values (rows, columns) of one group."""
    quantity = QUANTITIES.get(name)
    needs = f": needs a number in {quantity.unit}" if quantity else ""
    for column, values in zip(columns, block.T, strict=True):
        if name not in _MAY_BE_EMPTY:
            faults.where(np.isnan(values), rows, column, "empty", lambda _: f"is empty{needs}")
        faults.where(np.isinf(values), rows, column, "finite", lambda _: f"is not finite{needs}")
        if quantity:
            strange = np.isfinite(values) & (np.abs(values) > quantity.usual[1])
            faults.where(strange, rows, column, "unit", lambda i, v=values: quantity.doubt(v[i]))
    if name == "run":
        number = block[:, 0]
        broken = np.isfinite(number) & ((number != np.round(number)) | (np.abs(number) > _MAX_RUN))
        faults.where(broken, rows, "run", "whole", lambda i: f"{number[i]:g} is not a whole number")
    if name == "beta":
        _check_joint_order(block, rows, columns, faults)
    if name in ("position", "quaternion"):
        partly = np.isnan(block).any(1) & ~np.isnan(block).all(1)
        span = f"{columns[0]}..{columns[-1]}"
        faults.where(partly, rows, span, "partly", lambda _: "some fields are empty: fill in all or none")
    if name == "quaternion":
        with np.errstate(over="ignore"):
            norm = np.linalg.norm(block, axis=1)
        bad = np.isfinite(block).all(1) & (np.abs(norm - 1) > UNIT_QUATERNION_SLACK)
        faults.where(bad, rows, span, "norm", lambda i: f"quaternion of norm {norm[i]:.4g}: must be 1")


def _check_joint_order(beta: Array, rows: NDArray[np.int64], columns: list[str], faults: Faults) -> None:
    usual = (np.abs(beta) <= QUANTITIES["beta"].usual[1]).all(1)  # else the unit is the fault
    in_front = usual & (beta[:, -1] > JOINT_ORDER_SLACK_M)
    faults.where(in_front, rows, columns[-1], "sign", lambda i: f"{beta[i, -1]:g} m: must be <= 0 m, behind the plate")
    for inner, outer in pairwise(range(len(columns))):
        crossed = usual & (beta[:, inner] > beta[:, outer] + JOINT_ORDER_SLACK_M)

        def say(i: int, inner: int = inner, outer: int = outer) -> str:
            return f"joints out of order: {beta[i, inner]:g} m > {columns[outer]} = {beta[i, outer]:g} m"

        faults.where(crossed, rows, columns[inner], "order", say)


def _measurements(data: dict[str, Array], table: NumberTable) -> Measurements:
    n = table.n_rows
    t = data["t"][:, 0] if "t" in data else np.full(n, np.nan)
    run = data["run"][:, 0].astype(np.int64) if "run" in data else np.zeros(n, np.int64)
    quaternion = data.get("quaternion")
    if quaternion is not None:
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return Measurements(
        t=t,
        run=run,
        beta=data["beta"],
        alpha=data["alpha"],
        force=data["force"] if "force" in data else np.zeros((n, 3)),
        position=data.get("position"),
        quaternion=quaternion,
        row=np.arange(2, n + 2),
        warnings=list(_warnings(t, run, str(table.path))),
    )


def _warnings(t: Array, run: NDArray[np.int64], file: str) -> Iterator[Problem]:
    same_run = run[1:] == run[:-1]
    late = np.flatnonzero(same_run & (t[1:] <= t[:-1]))
    if len(late):
        text = f"{t[late[0] + 1]:g} s does not come after {t[late[0]]:g} s ({len(late)} such rows)"
        yield Problem(text, file, int(late[0]) + 3, "t_s", line_name="row")
    starts = run[np.flatnonzero(np.concatenate([[True], ~same_run]))]
    if len(np.unique(starts)) < len(starts):
        yield Problem("a run goes on after another one: its rows must stand together", file, field="run")
