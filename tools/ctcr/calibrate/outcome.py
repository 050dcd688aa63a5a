"""What a calibration procedure found, and how it is given back: table, JSON, robot file."""

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from pathlib import Path
from typing import Any

from ctcr.calibrate.procedure_figures import WIDTH
from ctcr.errors import InputError, Problem
from ctcr.robot import ledger
from ctcr.robot.ledger import Change, Entry
from ctcr.show import html_page, output
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.output import atomic_writer


@dataclass(frozen=True)
class Row:
    """A value with its unit and standard deviation (NaN: not known); `old`: in the robot file (NaN: no file)."""

    name: str
    unit: str
    value: float
    deviation: float = nan
    old: float = nan


@dataclass(frozen=True)
class Picture:
    """What a report draws: plot(figure, subject)."""

    plot: Callable
    subject: Any
    caption: str
    height: float = 3.8  # [in]


@dataclass(frozen=True)
class Outcome:
    """The rows to show, what to say about them, and what changes in the robot file."""

    title: str
    rows: list[Row]
    notices: list[str] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)
    picture: Picture | None = None

    def as_dict(self) -> dict[str, Any]:
        values = [
            {"name": row.name, "unit": row.unit, "value": row.value, "sd": row.deviation, "old": row.old}
            for row in self.rows
        ]
        return {"values": values, "figures": self.figures, "notices": self.notices, **self.details}


def computed(procedure: Callable, file: str, **arguments):
    """Calls a procedure of the compiled core; what it refuses becomes the fault of the file."""
    try:
        return procedure(**arguments)
    except ValueError as error:
        raise InputError(Problem(str(error), file)) from None


def check_target(robot, target: str | None, in_place: bool) -> str | None:
    """The robot file to write, if any. Raises InputError where that asks for the impossible, before any work."""
    if in_place and target:
        raise InputError(Problem("give either -o or --in-place"))
    if (in_place or target) and robot is None:
        raise InputError(Problem("give --robot: the robot file whose values are to be updated"))
    return robot._source.file if in_place else target


def deliver(
    outcome: Outcome,
    robot,
    command: str,
    sources: Sequence[str],
    target: str | None,
    in_place: bool,
    json_target: str | None,
    report: str | None,
) -> None:
    """Writes what was asked for, the files first, and prints the table."""
    if target:
        entry = Entry(command, sources, outcome.figures, " ".join(outcome.notices))
        ledger.write(robot, target, outcome.changes, entry, in_place=in_place)
    if report:
        write_report(outcome, report, command, " and ".join(map(str, sources)), robot)
    if json_target:
        output.write_json(outcome.as_dict(), json_target)
    console = output.console(json_target)
    show(console, outcome)
    for name, file in (("Report", report), ("Robot file", target)):
        if file:
            console.print(f"{name}: {file}", markup=False)


def show(console, outcome: Outcome) -> None:
    console.print(output.table(outcome.title, *cells(outcome), text_columns=2))
    for notice in outcome.notices:
        console.print(f"  • {notice}", markup=False)


def cells(outcome: Outcome) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of the table; the first two columns are text."""
    with_old = any(isfinite(row.old) for row in outcome.rows)
    columns = ["", "unit", *(["robot file"] if with_old else []), "found", "sd"]
    return columns, [
        [
            row.name,
            row.unit,
            *([number(row.old, row.deviation)] if with_old else []),
            number(row.value, row.deviation),
            deviation(row.deviation),
        ]
        for row in outcome.rows
    ]


def number(value: float, deviation: float = nan) -> str:
    """A value to a tenth of its standard deviation, or to four digits."""
    if not isfinite(value):
        return "-"
    if not isfinite(deviation) or deviation <= 0:
        return f"{value:.4g}"
    return f"{value:.{digits(deviation)}f}"


def deviation(value: float) -> str:
    """A standard deviation to two digits."""
    return f"{value:.{digits(value)}f}" if isfinite(value) and value > 0 else "-"


def digits(deviation: float) -> int:
    """Decimals that show a standard deviation to two digits."""
    return max(0, 1 - int(f"{deviation:.1e}".partition("e")[2]))


def write_report(outcome: Outcome, target: str | Path, command: str, source: str, robot=None) -> None:
    """Write the report; source says what was measured. Raises InputError when the file cannot be written."""
    with atomic_writer(target) as file:
        file.write(page(outcome, command, source, robot))


def page(outcome: Outcome, command: str, source: str, robot=None) -> str:
    """The whole HTML text."""
    title = f"{outcome.title}: {robot.name}" if robot else outcome.title
    sections = [f"<h1>{html.escape(title)}</h1>"]
    if outcome.notices:
        sections.append("<h2>To know</h2>" + bullets(outcome.notices))
    if outcome.picture:
        p = outcome.picture
        sections.append(figure(p.plot, p.subject, WIDTH, p.height, p.caption, wide=True))
    sections.append(table("Found, with one standard deviation", *cells(outcome), 2))
    return html_page.page(title, sections, source, command)
