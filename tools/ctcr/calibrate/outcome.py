"""The result of a calibration procedure, and how it is given back: table, JSON, report, robot file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import degrees, inf, isfinite, nan
from typing import Any

from ctcr.calibrate.procedure_figures import WIDTH
from ctcr.errors import ArgumentError, InputError, Problem
from ctcr.model.parameters import name_at, uncertainty_of, value_at
from ctcr.robot import ledger
from ctcr.robot.ledger import Change, Entry
from ctcr.robot.yaml_document import FieldPath
from ctcr.show import html_page, output
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.wording import deviation, number


@dataclass(frozen=True)
class Row:
    """A value with its unit and standard deviation (NaN: not known); `old`: in the robot file (NaN: no file).

    `path`: the field of the robot file that holds it, where it is to be updated.
    """

    name: str
    unit: str
    value: float
    sd: float = nan
    old: float = nan
    path: FieldPath | None = None


@dataclass(frozen=True)
class Picture:
    """A picture of the report: plot(figure, subject)."""

    plot: Callable
    subject: Any
    caption: str
    height: float = 3.8  # [in]


@dataclass(frozen=True)
class Outcome:
    """The rows to show and notices about them. `correlations`: pairs of the rows' paths, and r of their errors."""

    title: str
    rows: list[Row]
    notices: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)
    picture: Picture | None = None
    correlations: list[tuple[FieldPath, FieldPath, float]] = field(default_factory=list)
    view: tuple[str, str] | None = None  # JSON of a 3-D view of the report, and its caption

    @property
    def changes(self) -> list[Change]:
        """Those of the robot file; the ledger holds no deviations of the components of a rotation vector."""
        updating = [row for row in self.rows if row.path]
        return [Change(row.path, row.unit, row.value, None if row.unit == "rad" else row.sd) for row in updating]

    def as_dict(self) -> dict[str, Any]:
        values = [{name: value for name, value in vars(row).items() if name != "path"} for row in self.rows]
        return {"values": values, "figures": self.figures, "notices": self.notices, **self.details}


def computed(procedure: Callable, file: str, **arguments):
    """Calls a procedure of the compiled core; its ValueError becomes a fault of the file."""
    try:
        return procedure(**arguments)
    except ValueError as error:
        raise InputError(Problem(str(error), file)) from None


def in_file(robot, path: FieldPath) -> float:
    """The number at a path such as ("tubes", 0, "length_mm"); NaN without a robot, or where the file has none."""
    value = value_at(robot, path)
    return nan if value is None else value


def frame_rows(robot, position_mm: Sequence[float], vector_rad: Sequence[float], sd: Sequence[float]) -> list[Row]:
    """A tracker frame T_ref with its standard deviations (6,) [mm], [rad]."""
    kinds = (
        ("position_mm", "origin of the base frame", "mm", position_mm, sd[:3]),
        ("rotation_vector_rad", "rotation vector", "rad", vector_rad, sd[3:]),
    )
    rows = []
    for key, text, unit, values, widths in kinds:
        for i, (axis, value, width) in enumerate(zip("xyz", values, widths, strict=True)):
            path = ("tracker", key, i)
            rows.append(Row(f"{text}, {axis}", unit, float(value), float(width), in_file(robot, path), path))
    return rows


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
    entry = Entry(command, [source], outcome.figures, " ".join(outcome.notices))
    changes = [*outcome.changes, *_uncertainties(robot, outcome.rows), *_correlations(robot, outcome)]
    ledger.write(robot, target, changes, entry, in_place=in_place)


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
    """Those of the measured values, in place of all that the file says of these."""
    measured = {name_at(row.path) for row in outcome.rows if row.path}
    old = robot.uncertainty.correlations
    kept = [vars(pair) for pair in old if not {pair.first, pair.second} & measured]
    found = [{"first": name_at(a), "second": name_at(b), "r": float(f"{r:.3g}")} for a, b, r in outcome.correlations]
    return [Change(("uncertainty", "correlations"), "", [*kept, *found])] if found or len(kept) < len(old) else []


def show(console, outcome: Outcome) -> None:
    console.print(output.table(outcome.title, *cells(outcome), text_columns=2))
    console.bullets(outcome.notices)


def cells(outcome: Outcome) -> tuple[dict[str, str], list[list[str]]]:
    """Columns and rows of the table; the first two columns are text."""
    with_old = any(isfinite(row.old) for row in outcome.rows)
    columns = {"": "", "unit": ""} | ({"robot file": "the value before"} if with_old else {})
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
    sections = ["<h2>To know</h2>" + bullets(outcome.notices)] if outcome.notices else []
    if outcome.picture:
        p = outcome.picture
        sections.append(figure(p.plot, p.subject, WIDTH, p.height, p.caption, wide=True))
    if outcome.view:
        sections.append(html_page.view(*outcome.view))
    sections.append(table("Found, with one standard deviation", *cells(outcome), 2))
    return html_page.page(title, sections, files)
