"""The result of a calibration procedure, compared with the robot file, and how it is given back: table, JSON, report,
robot file."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, hypot, inf, isfinite, nan
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array
from ctcr.calibrate.procedure_figures import WIDTH
from ctcr.calibrate.tables import Table
from ctcr.errors import ArgumentError, InputError, Problem
from ctcr.model import parameters
from ctcr.model.parameters import field_of, name_at, stated_sd, uncertainty_of, value_at
from ctcr.robot import checks, ledger
from ctcr.robot.description import Robot
from ctcr.robot.ledger import Change, Entry
from ctcr.robot.yaml_document import FieldPath
from ctcr.show import html_page, output
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.wording import deviation, number


@dataclass(frozen=True)
class Row:
    """A value with its unit and standard deviation (NaN: not known), and both by the robot file (NaN: it says nothing).

    `path`: the field of the robot file that holds it, where it is to be updated. `apart`: value less `old`, where that
    is no plain difference.
    """

    name: str
    unit: str
    value: float
    sd: float = nan
    old: float = nan
    path: FieldPath | None = None
    old_sd: float = nan
    apart: float = nan

    @property
    def shift(self) -> float:
        """Value less that of the robot file, in standard deviations of this difference; NaN where one is not known."""
        sd = hypot(self.old_sd, self.sd)
        apart = self.apart if isfinite(self.apart) else self.value - self.old
        return apart / sd if isfinite(sd) and sd > 0 else nan

    @property
    def contradicts(self) -> bool:
        """Whether value and robot file can hardly both be right."""
        return isfinite(self.shift) and abs(self.shift) > settings.MOVED_FAR


@dataclass(frozen=True)
class Picture:
    """A picture of the report: plot(figure, subject)."""

    plot: Callable
    subject: Any
    caption: str
    height: float = 3.8  # [in]


@dataclass(frozen=True)
class Outcome:
    """The rows to show and notices about them. `correlations`: pairs of the rows' paths, and r of their errors.

    `suspects`: what of the measurement may be wrong where it contradicts the robot file. `doubts`: what speaks against
    the values, see `judged`.
    """

    title: str
    rows: list[Row]
    notices: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)
    picture: Picture | None = None
    correlations: list[tuple[FieldPath, FieldPath, float]] = field(default_factory=list)
    view: tuple[str, str] | None = None  # JSON of a 3-D view of the report, and its caption
    suspects: str = ""
    doubts: list[str] = field(default_factory=list)

    @property
    def changes(self) -> list[Change]:
        """The changes of the robot file. Components of a rotation vector have no standard deviation in the ledger."""
        updating = [row for row in self.rows if row.path]
        return [Change(row.path, row.unit, row.value, None if row.unit == "rad" else row.sd) for row in updating]

    def as_dict(self) -> dict[str, Any]:
        shown = ("name", "unit", "value", "sd", "old", "old_sd", "shift")
        values = [{name: getattr(row, name) for name in shown} for row in self.rows]
        return {"values": values, "figures": self.figures, "notices": [*self.doubts, *self.notices], **self.details}


def computed(procedure: Callable, table: Table, about: str = "", **arguments):
    """Calls a procedure of the compiled core; its ValueError becomes a fault of the table, in its row of the file.

    `about`: what the fault is of, where the table holds more.
    """
    try:
        return procedure(**arguments)
    except ValueError as error:
        row, text = re.fullmatch(r"(?:row (\d+): )?(.*)", str(error), re.DOTALL).groups()
        line = int(table.row[int(row) - 1]) if row else None
        raise InputError(Problem(text, table.file, line, about or None, "row")) from None


# ---- against the robot file


def in_file(robot, path: FieldPath) -> float:
    """The number at a path such as ("tubes", 0, "length_mm"); NaN without a robot, or where the file has none."""
    value = value_at(robot, path)
    return nan if value is None else value


def row_of(robot: Robot | None, name: str, unit: str, value: float, sd: float, path: FieldPath) -> Row:
    """The row of a value that the robot file holds, with what that says of it."""
    return Row(name, unit, value, sd, in_file(robot, path), path, _sd_in_file(robot, path))


def _sd_in_file(robot: Robot | None, path: FieldPath) -> float:
    """The standard deviation of a number of the file by its `uncertainty`, in the unit of that number."""
    name = name_at(path) if robot else None
    sd = stated_sd(robot, name) if name else None
    factor = field_of(name).factor if name and field_of(name).path else 1.0  # numbers of a rotation vector are in rad
    return nan if sd is None else factor * sd


def by_robot(robot: Robot, function: Callable[[Array], float], *names: str) -> tuple[float, float]:
    """A function of parameters (SI) at the robot file's values, and its standard deviation (linearised)."""
    values, step = parameters.values(robot, names), 1e-3  # standard deviations
    changes = np.diag([step * (stated_sd(robot, name) or 0.0) for name in names])
    part = np.array([function(values + change) - function(values - change) for change in changes]) / (2 * step)
    correlations = parameters.correlations(robot, names)
    variance = part @ (part if correlations is None else correlations @ part)
    return function(values), float(np.sqrt(max(variance, 0.0)))


def frame_rows(
    robot: Robot | None, position_mm: Array, position_sd_mm: Array, vector: Array, sd: Array, prior: bool = True
) -> list[Row]:
    """The rows of a tracker frame: its origin, and its rotation vector [rad] with the standard deviations (3,) of turns
    about the axes. `prior`: whether the file's frame counts as known with its uncertainty."""
    turn = np.full(3, nan)
    if robot is not None:
        turn = (Rotation.from_rotvec(vector) * Rotation.from_matrix(robot.tracker.rotation).inv()).as_rotvec()
    rows = []
    for key, text, unit, values, widths, apart in (
        ("position_mm", "origin of the base frame", "mm", position_mm, position_sd_mm, np.full(3, nan)),
        ("rotation_vector_rad", "rotation vector", "rad", vector, sd, turn),
    ):
        for i, axis in enumerate("xyz"):
            path = ("tracker", key, i)
            row = row_of(robot, f"{text}, {axis}", unit, float(values[i]), float(widths[i]), path)
            rows.append(replace(row, apart=float(apart[i]), old_sd=row.old_sd if prior else nan))
    return rows


def judged(outcome: Outcome, robot: Robot | None) -> Outcome:
    """The outcome with its doubts: values that contradict the robot file, or that look wrong by themselves.

    Raises InputError where no robot can have the values.
    """
    said, heading, names = [], "", {}
    for row in outcome.rows:  # an indented one belongs to the last that is not
        heading = heading if row.name.startswith(" ") else row.name.partition(": ")[0]
        name = f"{heading}: {row.name.strip()}" if row.name.startswith(" ") else row.name
        names[row.path] = name
        said += [f"{name}: {_contradiction(row)}"] if row.contradicts else []
    for path, text in _odd(outcome, robot):
        said.append(f"{names.get(path) or checks.path_text(path)}: {text}")
    if said and outcome.suspects:
        said.append(f"what may be wrong: {outcome.suspects}{', or the robot file' if robot else ''}")
    return replace(outcome, doubts=said)


def _contradiction(row: Row) -> str:
    found = f"{number(row.value, row.sd)} ± {deviation(row.sd)} {row.unit} measured"
    stated = f"{number(row.old, row.old_sd)} ± {deviation(row.old_sd)}" if row.old_sd else f"exactly {row.old:.4g}"
    apart = float(f"{abs(row.shift):.2g}")
    return f"{found}, {stated} by the robot file: {apart:g} standard deviations apart"


def _odd(outcome: Outcome, robot: Robot | None) -> Iterator[checks.Fault]:
    """Implausible values: without a robot judged by their units, else as values of its file."""
    if robot is None:
        known = [(row, *Robot.owner(row.path)) for row in outcome.rows if row.path]
        quantities = [(row, section.quantity(key)) for row, section, key in known]
        yield from ((row.path, unit.doubt(row.value)) for row, unit in quantities if not unit.is_usual(row.value))
        return
    before = set(checks.doubts(robot))
    after = ledger.changed(robot, _changes(outcome, robot), Entry(""))
    yield from (fault for fault in checks.doubts(after) if fault not in before and fault[0][0] != "uncertainty")


def check_target(robot, target: str | None, in_place: bool, needed: bool = False) -> str | None:
    """The robot file to write, if any. Raises InputError where that asks for the impossible, before any work."""
    if in_place and target:
        raise ArgumentError(Problem("give either -o or --in-place"))
    if (in_place or target) and robot is None:
        raise ArgumentError(Problem("give --robot: the robot file whose values are to be updated"))
    if needed and not (in_place or target):
        raise ArgumentError(Problem("give -o: the robot file to write"))
    return robot._source.file if in_place else target


def write_robot(outcome: Outcome, robot, target: str, command: str, source: str, in_place: bool) -> None:
    """Writes the robot file with the changes, and an entry of its ledger."""
    entry = Entry(command, [source], outcome.figures, " ".join([*outcome.doubts, *outcome.notices]))
    ledger.write(robot, target, _changes(outcome, robot), entry, in_place=in_place)


def _changes(outcome: Outcome, robot) -> list[Change]:
    """All that the outcome changes in the robot file: values, their standard deviations and correlations."""
    return [*outcome.changes, *_uncertainties(robot, outcome.rows), *_correlations(robot, outcome)]


def _uncertainties(robot, rows: list[Row]) -> list[Change]:
    """The standard deviations of measured values, which become the priors of the next fit, a list for each key."""
    found: dict[str, list[float]] = {}
    for row in rows:
        name = name_at(row.path) if row.path and row.value and 0 < row.sd < inf else None
        if name is None or uncertainty_of(name) is None:
            continue
        key, index = uncertainty_of(name)
        count = 3 if row.path[0] == "tracker" else robot.n_tubes
        each = found.setdefault(key, [robot.uncertainty.of(key, i) for i in range(count)])
        factor = 100 / abs(row.value) if key.endswith("_percent") else degrees(1) if row.unit == "rad" else 1.0
        each[index] = float(f"{factor * row.sd:.3g}")
    return [Change(("uncertainty", key), key.rsplit("_", 1)[-1], each) for key, each in found.items()]


def _correlations(robot, outcome: Outcome) -> list[Change]:
    """The change that puts the correlations of the measured values in place of those of the file; none without any."""
    measured = {name_at(row.path) for row in outcome.rows if row.path}
    old = robot.uncertainty.correlations
    kept = [vars(pair) for pair in old if not {pair.first, pair.second} & measured]
    found = [{"first": name_at(a), "second": name_at(b), "r": float(f"{r:.3g}")} for a, b, r in outcome.correlations]
    return [Change(("uncertainty", "correlations"), "", [*kept, *found])] if found or len(kept) < len(old) else []


def show(console, outcome: Outcome) -> None:
    for doubt in outcome.doubts:
        console.print(f"Doubt: {doubt}", style="bold")
    console.print(output.table(outcome.title, *cells(outcome), text_columns=2))
    console.bullets(outcome.notices)


def cells(outcome: Outcome) -> tuple[dict[str, str], list[list[str]]]:
    """Columns and rows of the table; the first two columns are text."""
    with_old = any(isfinite(row.old) for row in outcome.rows)
    columns = {"": "", "unit": ""} | ({"robot file": "the value before, or predicted"} if with_old else {})
    columns |= {"found": "the value measured", "sd": "its standard deviation"}
    rows = []
    for row in outcome.rows:
        values = [row.old, row.value] if with_old else [row.value]
        shown = [number(value, row.sd) for value in values]
        rows.append([row.name, row.unit, *shown, deviation(row.sd)])
    return columns, rows


def page(outcome: Outcome, files: Sequence[str], robot=None) -> str:
    """The whole HTML text; `files`: the input files."""
    title = f"{outcome.title}: {robot.name}" if robot else outcome.title
    lists = ("Doubts", outcome.doubts), ("To know", outcome.notices)
    sections = [f"<h2>{heading}</h2>" + bullets(lines) for heading, lines in lists if lines]
    if outcome.picture:
        p = outcome.picture
        sections.append(figure(p.plot, p.subject, WIDTH, p.height, p.caption, wide=True))
    if outcome.view:
        sections.append(html_page.view(*outcome.view))
    sections.append(table("Found, with one standard deviation", *cells(outcome), 2))
    return html_page.page(title, sections, files)
