"""The table of measurements, measurements.csv: one row per reading, in the order measured, SI units.

Between rows all joints move in a straight line in joint space, so order and direction of motion are data.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Union

import numpy as np

from ctcr import settings
from ctcr.arguments import checked
from ctcr.arrays import Array, Integers, Mask
from ctcr.errors import InputError, Problem, did_you_mean
from ctcr.robot.description import MAX_TUBES, Robot
from ctcr.robot.units import LARGEST, Quantity
from ctcr.show.output import Progress
from ctcr.show.result import Glance, Shown, frame
from ctcr.show.wording import counted, listed
from ctcr.table.csv_table import SHOWN, Faults, NumberTable, open_table
from ctcr.table.frame_table import FrameTable
from ctcr.table.sessions import Sessions

if TYPE_CHECKING:
    from pandas import DataFrame

Source = Union[str, PathLike[str], "DataFrame"]  # of a table

JOINT_ORDER_SLACK_M = 1e-6  # rounding of recorded joints
UNIT_QUATERNION_SLACK = 1e-3
_MAX_RUN = 1e15  # whole numbers that a float holds exactly


QUANTITIES = {  # values outside the usual range are in another unit, or garbage
    "beta": Quantity("m", usual=(1e-9, 5)),
    "alpha": Quantity("rad", usual=(1e-12, 1000)),
    "force": Quantity("N", usual=(1e-12, 1000)),
    "position": Quantity("m", usual=(1e-12, 20)),
}
Table = NumberTable | FrameTable
_MAY_BE_EMPTY = ("t", "position", "quaternion")


@dataclass(frozen=True, repr=False)
class Measurements(Shown):
    """M readings of a robot with N tubes. Values that were not measured are NaN, or None where columns are absent."""

    t: Array  # (M,) [s]
    run: Integers  # (M,) the path that the reading belongs to
    beta: Array  # (M, N) grasped points [m], <= 0
    alpha: Array  # (M, N) base angles [rad]
    force: Array  # (M, 3) known force at the tip [N], base frame; zero where the columns are absent
    position: Array | None  # (M, 3) sensor [m], tracker frame
    quaternion: Array | None  # (M, 4) sensor (w, x, y, z), unit, tracker frame
    row: Integers  # (M,) row of the file; the header is row 1
    warnings: list[Problem] = field(default_factory=list)
    sessions: Sessions | None = None  # what was taken out of each run; None: nothing, the runs are one session
    from_home: bool = True  # whether the robot came to the first row straight from home; else it was at rest there
    file: str = ""  # that it was read from; empty: a DataFrame, or made by a program
    refusal: InputError | None = None  # why it cannot be used as it is: only another convention makes it possible
    about: Array | None = None  # (3,) `centre` [m] of the whole table, where these are some of its rows

    COLUMNS: ClassVar = ("t", "run", "beta", "alpha", "force", "position", "quaternion", "row")  # one value a row

    @classmethod
    def of_joints(cls, beta: Array, alpha: Array, **others: Any) -> "Measurements":
        """Rows of these joints (M, N) [m], [rad], numbered as in a file. Unless `others` state it, they have no poses
        and no loads, belong to one run and are a second apart."""
        rows = np.arange(len(beta))
        nothing = {"t": rows.astype(float), "run": np.zeros_like(rows), "force": np.zeros((len(rows), 3))}
        return cls(**nothing | {"position": None, "quaternion": None} | others, beta=beta, alpha=alpha, row=rows + 2)

    def __len__(self) -> int:
        return len(self.run)

    @checked
    def rows(self, chosen: Mask | Integers | slice) -> "Measurements":
        """The readings of some rows."""
        kept = {name: getattr(self, name) for name in self.COLUMNS}
        return replace(self, **{name: old if old is None else old[chosen] for name, old in kept.items()})

    @property
    def positions(self) -> Array:
        """The positions (M, 3), NaN also where their columns are absent."""
        return np.full((len(self), 3), np.nan) if self.position is None else self.position

    @property
    def quaternions(self) -> Array:
        """The quaternions (M, 4), NaN also where their columns are absent."""
        return np.full((len(self), 4), np.nan) if self.quaternion is None else self.quaternion

    @property
    def oriented(self) -> Mask:
        """Whether the orientation was measured (M,)."""
        return np.isfinite(self.quaternions).all(axis=1)

    @property
    def measured(self) -> Mask:
        """Whether a position or an orientation was measured (M,)."""
        return np.isfinite(self.positions).all(axis=1) | self.oriented

    @property
    def centre(self) -> Array:
        """Mean position (3,) [m] of the whole table; 0 without any."""
        if self.about is not None:
            return self.about
        measured = self.positions[np.isfinite(self.positions).all(axis=1)]
        return measured.mean(axis=0) if len(measured) else np.zeros(3)

    @property
    def clock(self) -> Array:
        """Times (M,) [s], or the numbers of the rows where times are missing."""
        return self.t if np.isfinite(self.t).all() else self.row.astype(float)

    def without_poses(self, rows: Mask) -> "Measurements":
        """A copy without the poses of these rows (M,), which are no readings."""
        poses = {"position": self.position, "quaternion": self.quaternion}
        kept = {name: np.where(rows[:, None], np.nan, old) for name, old in poses.items() if old is not None}
        return replace(self, **kept)

    @property
    def n_tubes(self) -> int:
        return self.beta.shape[1]

    def to_frame(self) -> "DataFrame":
        """The table as a DataFrame with the columns of the format, SI units: `read` takes it back."""
        columns = {}
        for name, names in group_columns(self.n_tubes).items():
            values = getattr(self, name)
            if values is not None:
                columns |= dict(zip(names, values.reshape(len(self), -1).T, strict=True))
        return frame(columns)

    @property
    def doubts(self) -> list[str]:
        """Its warnings as sentences, which every result made from it repeats."""
        return [f"{warning}." for warning in self.warnings]

    @property
    def source(self) -> str:
        """Where it comes from, in words."""
        return self.file or "a table"

    @property
    def files(self) -> list[str]:
        """The file that the table was read from, for a ledger; none where it was not."""
        return [self.file] if self.file else []

    def glance(self) -> Glance:
        runs = len(np.unique(self.run))
        name = f"Measurements {self.file}".rstrip()
        said = [counted(len(self), "row"), f"{int(self.measured.sum())} with a pose", counted(runs, "run")]
        line = f"{name}: {', '.join([*said, counted(self.n_tubes, 'tube')])}"

        def row(name: str, unit: str, values: Array) -> list[list[str]]:
            known = values[np.isfinite(values)]
            return [[name, unit, f"{known.min():.4g}", f"{known.max():.4g}"]] if len(known) else []

        rows = [row(f"beta{i + 1}", "mm", 1e3 * values) for i, values in enumerate(self.beta.T)]
        rows += [row(f"alpha{i + 1}", "deg", np.degrees(values)) for i, values in enumerate(self.alpha.T)]
        rows += [row("force", "N", np.linalg.norm(self.force, axis=1)), row("time", "s", self.t)]
        rows += [row(axis, "mm", 1e3 * values) for axis, values in zip("xyz", self.positions.T, strict=True)]
        first, *others = self.refusal.lines if self.refusal else [""]
        warnings = [*self.doubts, *([f"Not possible as it is: {first}"] if first else [])]
        return Glance(line, ["", "unit", "least", "most"], sum(rows, []), others, 2, warnings)

    @property
    def joint_space(self) -> Array:
        """Joints as one vector (M, 2 N) [rad], in which distances are comparable."""
        return np.column_stack([self.beta / settings.JOINT_LEVER, self.alpha])

    @property
    def load_space(self) -> Array:
        """Joints and load as one vector (M, 2 N + 3) [rad]."""
        return np.column_stack([self.joint_space, self.force / settings.LOAD_LEVER])


@checked
def read(source: Source, n_tubes: int | None = None) -> Measurements:
    """Reads a table of measurements, or a plan, from a file or from a DataFrame with the columns of one.

    n_tubes    of its robot; None: as many as its columns say
    A table that only another convention makes possible, such as angles in degrees, comes with the error that refuses it
    as `refusal`: a comparison then tells the convention. Raises InputError with row, column, value and unit.
    """
    table = open_table(source) if isinstance(source, str | PathLike) else FrameTable(source)
    tubes = n_tubes or _tubes_of(table.columns)
    try:
        return _read(table, tubes)
    except InputError as error:
        refusal = error
    try:
        return replace(_read(table, tubes, plausible=False), refusal=refusal)
    except InputError:
        raise refusal from None


def load(path: str | Path, n_tubes: int) -> Measurements:
    """Reads a table for a robot of `n_tubes` tubes. Raises InputError with row, column, value and unit."""
    return _read(open_table(path), n_tubes)


def _tubes_of(columns: tuple[str, ...]) -> int:
    """The largest number of a tube in the names of columns, as far as there are such robots."""
    numbers = [int(found[1]) for name in columns if (found := re.match(r"(?:beta|alpha)([1-9])(?![0-9])", name))]
    return min(max(numbers, default=1), MAX_TUBES)


def _read(table: Table, n_tubes: int, plausible: bool = True) -> Measurements:
    """Reads the measurements of a table. `plausible`: values outside the usual ranges are faults too."""
    groups = _groups(table, n_tubes)
    faults = Faults(str(table.path))
    data = {name: np.empty((table.n_rows, len(columns))) for name, columns in groups.items()}
    with Progress(f"reading {table.path.name}", table.end - table.start) as progress:
        for rows, numbers, size in table.blocks(faults):
            for name, columns in groups.items():
                data[name][rows - 2] = numbers[:, columns]
                check(name, numbers[:, columns], rows, [table.columns[i] for i in columns], faults, plausible)
            progress.advance(size)
    faults.raise_any()
    return _measurements(data, table)


def check_of(robot: Robot, table: Measurements) -> None:
    """Raises InputError where a table is not one of a robot with as many tubes and at least one row."""
    if table.n_tubes != robot.n_tubes:
        text = f"holds the joints of {counted(table.n_tubes, 'tube')}: the robot has {robot.n_tubes}"
        raise InputError(Problem(text, table.source))
    if not len(table):
        raise InputError(Problem("holds no rows", table.source))


def column_names(n_tubes: int) -> list[str]:
    """All columns of the format, in its order."""
    return [name for names in group_columns(n_tubes).values() for name in names]


def group_columns(n_tubes: int) -> dict[str, tuple[str, ...]]:
    """Columns of the format, by the field of Measurements that they fill."""
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


def _groups(table: Table, n_tubes: int) -> dict[str, list[int]]:
    """Indices of the columns of each group that is present; raises InputError with all faults of the header."""
    groups, file = group_columns(n_tubes), str(table.path)
    unknown = {column: _unknown(column, table.columns, n_tubes) for column in table.columns}
    meant = {near for _, near in unknown.values()}
    joints = [*groups["beta"], *groups["alpha"]]
    if not {*joints} & {*table.columns, *table.index, *meant}:
        text = f"has none of the columns {joints[0]} to {joints[-1]}: if it is a log, ctcr import makes a table of it"
        raise InputError(Problem(text, file, 1, line_name="row"))
    missing = {column: text for column, text in _missing(table.columns, groups, n_tubes) if column not in meant}
    known = {name for names in groups.values() for name in names}
    index = [name for name in table.index if name in known and name not in table.columns]
    missing |= {name: "is the index of the rows: reset_index() makes a column of it" for name in index}
    faults = {column or "(no name)": text for column, (text, _) in unknown.items() if text} | missing
    if faults:
        problems = [Problem(text, file, 1, column, line_name="row") for column, text in faults.items()]
        raise InputError(problems[:SHOWN], omitted=max(0, len(problems) - SHOWN))
    present = {name: names for name, names in groups.items() if names[0] in table.columns}
    return {name: [table.columns.index(column) for column in names] for name, names in present.items()}


def _unknown(column: str, present: tuple[str, ...], n_tubes: int) -> tuple[str, str | None]:
    """The fault of a column that is unknown or doubled, "" if none, and the column that was probably meant."""
    known = column_names(n_tubes)
    if column in known:
        return "this column is there more than once" if present.count(column) > 1 else "", None
    joint = re.match(r"(?:beta|alpha)([0-9]+)_", column)
    if joint and int(joint[1][:9]) > n_tubes:
        return f"unknown column: the robot has {counted(n_tubes, 'tube')}", None
    near = did_you_mean(column, [name for name in known if name not in present])
    other_unit = near and near.partition("_")[0] == column.partition("_")[0]
    hint = f": did you mean {near}?" + (" Columns are in SI units" if other_unit else "") if near else ""
    return f"unknown column{hint}", near


def _missing(present: tuple[str, ...], groups: dict[str, tuple[str, ...]], n_tubes: int) -> Iterator[tuple[str, str]]:
    """Missing columns with the fault of each."""
    for name, columns in groups.items():
        absent = [column for column in columns if column not in present]
        joints = name in ("beta", "alpha")
        reason = f"the robot has {counted(n_tubes, 'tube')}" if joints else f"{', '.join(columns)} come together"
        if joints or len(absent) < len(columns):
            yield from ((column, f"this column is missing: {reason}") for column in absent)


def check(name: str, block: Array, rows: Integers, columns: list[str], faults: Faults, plausible: bool = True) -> None:
    """Faults in the values (rows, columns) of one group of `group_columns`; `columns` are their names in messages.

    `plausible`: whether values that can only be in another unit or of another sign are faults.
    """
    quantity = QUANTITIES.get(name)
    needs = f": needs a number in {quantity.unit}" if quantity else ""
    for column, values in zip(columns, block.T, strict=True):
        if name not in _MAY_BE_EMPTY:
            faults.where(np.isnan(values), rows, column, "empty", lambda _: f"is empty{needs}")
        faults.where(np.isinf(values), rows, column, "finite", lambda _: f"is not finite{needs}")
        if quantity:  # what no unit makes usual would overflow where conventions are tried
            strange = np.isfinite(values) & (np.abs(values) > (quantity.usual[1] if plausible else LARGEST))
            faults.where(strange, rows, column, "unit", lambda i, v=values: quantity.doubt(v[i]))
    if name == "run":
        number = block[:, 0]
        broken = np.isfinite(number) & ((number != np.round(number)) | (np.abs(number) > _MAX_RUN))
        faults.where(broken, rows, "run", "whole", lambda i: f"{number[i]:g} is not a whole number")
    if name == "beta" and plausible:
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


def _check_joint_order(beta: Array, rows: Integers, columns: list[str], faults: Faults) -> None:
    usual = (np.abs(beta) <= QUANTITIES["beta"].usual[1]).all(1)  # else the unit is the fault
    in_front = usual & (beta[:, -1] > JOINT_ORDER_SLACK_M)
    faults.where(in_front, rows, columns[-1], "sign", lambda i: f"{beta[i, -1]:g} m: must be <= 0 m, behind the plate")
    for inner, outer in pairwise(range(len(columns))):
        crossed = usual & (beta[:, inner] > beta[:, outer] + JOINT_ORDER_SLACK_M)

        def say(i: int, inner: int = inner, outer: int = outer) -> str:
            return f"joints out of order: {beta[i, inner]:g} m > {columns[outer]} = {beta[i, outer]:g} m"

        faults.where(crossed, rows, columns[inner], "order", say)


def _measurements(data: dict[str, Array], table: Table) -> Measurements:
    absent = {"t": [[np.nan]], "run": [[0]], "force": [[0.0] * 3]}
    absent = {name: np.repeat(row, table.n_rows, axis=0) for name, row in absent.items()}
    data = absent | {"position": None, "quaternion": None} | data
    data["t"], data["run"] = data["t"][:, 0], data["run"][:, 0].astype(np.int64)
    if data["quaternion"] is not None:
        data["quaternion"] /= np.linalg.norm(data["quaternion"], axis=1, keepdims=True)
    warnings = list(_warnings(data["t"], data["run"], str(table.path)))
    file = str(table.path) if isinstance(table, NumberTable) else ""
    return Measurements(**data, row=np.arange(2, table.n_rows + 2), warnings=warnings, file=file)


def never_turns(quaternion: Array) -> bool:
    """Whether a rotation (M, 4) never changes: the sensor has none, or the program wrote a constant."""
    known = quaternion[np.isfinite(quaternion).all(axis=1)]
    return len(known) > 2 and bool((known == known[0]).all())


def _warnings(t: Array, run: Integers, file: str) -> Iterator[Problem]:
    same_run = run[1:] == run[:-1]
    late = np.flatnonzero(same_run & (t[1:] <= t[:-1]))
    if len(late):
        text = (
            f"{t[late[0] + 1]:g} s does not come after {t[late[0]]:g} s ({len(late)} in all, rows {listed(late + 3)}): "
            "rows are taken in their order; correct their times, or leave t_s out"
        )
        yield Problem(text, file, int(late[0]) + 3, "t_s", line_name="row")
    starts = run[np.flatnonzero(np.concatenate([[True], ~same_run]))]
    if len(np.unique(starts)) < len(starts):
        yield Problem("a run continues after another one: its rows must stand together", file, field="run")
