"""The small tables of the calibration procedures: CSV, the unit of a column at the end of its name.

A column may come in any unit of its kind: `x_mm` or `x_m`, `motor_angle_deg` or `motor_angle_rev`. SI inside.
"""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np

from ctcr import inputs
from ctcr.arrays import Array, Integers
from ctcr.errors import InputError, Problem, did_you_mean, shown
from ctcr.table.csv_table import Faults, header_names

MAX_BYTES = 16 << 20
MOST_COUNTED = 1e9  # of a number of tubes or readings: far more than there are, and exact as an integer

UNITS = {
    "length": {"mm": 1e-3, "m": 1.0, "um": 1e-6},
    "angle": {"deg": pi / 180, "rad": 1.0, "rev": 2 * pi},
    "load": {"N": 1.0, "mN": 1e-3, "g": 9.80665e-3},
    "picture": {"px": 1.0, "mm": 1e-3, "m": 1.0},
}


@dataclass(frozen=True)
class Column:
    """A column of a table. `kind`: one of UNITS; or, without unit, "text", "count" (1, 2, ..) or "sign" (1 or -1).

    `needed`: the column must be there. `filled`: no field of it may be empty. `positive`: all its numbers are above 0.
    """

    name: str
    kind: str
    needed: bool = True
    filled: bool = True
    positive: bool = False

    @property
    def headings(self) -> dict[str, str]:
        """The possible headings with their unit, the usual one first; without unit the name alone."""
        return {f"{self.name}_{unit}": unit for unit in UNITS[self.kind]} if self.kind in UNITS else {self.name: ""}

    @property
    def usual(self) -> str:
        """The usual heading."""
        return next(iter(self.headings))


@dataclass(frozen=True)
class Table:
    """The columns that are there, by name, in SI units; empty fields are NaN. `unit` is as written in the file."""

    file: str
    row: Integers  # (M,) of the file; the header is row 1
    columns: dict[str, Array | Integers | list[str]]
    unit: dict[str, str]

    def __len__(self) -> int:
        return len(self.row)

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str):
        return self.columns[name]

    def stacked(self, *names: str) -> Array:
        """Columns side by side (M, len(names))."""
        return np.stack([self.columns[name] for name in names], axis=1)


def read(path: str | Path, columns: Sequence[Column]) -> Table:
    """Reads a table. Raises InputError with every fault: row, column, and the unit that is needed."""
    header, *lines = _lines(path)
    file, header = str(path), [name.strip() for name in header]
    found = _find(header, columns, file)
    numbered = [(number, fields) for number, fields in enumerate(lines, start=2) if any(map(str.strip, fields))]
    if not numbered:
        raise InputError(Problem("has no rows below the header", file))
    faults = Faults(file)
    for number, fields in numbered:
        if len(fields) != len(header):
            faults.add(number, None, f"has {len(fields)} fields: the header has {len(header)}", "fields")
    faults.raise_any()
    row, texts = zip(*numbered, strict=True)
    by_heading = dict(zip(header, zip(*texts, strict=True), strict=True))
    data = {
        column.name: _values(column, heading, [text.strip() for text in by_heading[heading]], row, faults)
        for column, heading in found.items()
    }
    faults.raise_any()
    return Table(file, np.array(row), data, {one.name: one.headings[heading] for one, heading in found.items()})


def _lines(path: str | Path) -> list[list[str]]:
    """The fields of each line, the header first."""
    content = inputs.read(path, "this is not a table of a calibration procedure", MAX_BYTES)
    header_names(content.partition(b"\n")[0], str(path))
    try:
        return list(csv.reader(content.decode("utf-8-sig").splitlines()))
    except UnicodeDecodeError:
        raise InputError(Problem("is not text in UTF-8", str(path))) from None


def _find(header: list[str], columns: Sequence[Column], file: str) -> dict[Column, str]:
    """The heading of each column that is there; raises InputError with all faults of the header."""
    known = {heading: column for column in columns for heading in column.headings}
    absent = [column for column in columns if not any(name in header for name in column.headings)]
    found: dict[Column, str] = {}
    problems, meant = [], set()
    for heading in header:
        column = known.get(heading)
        if column is None:
            near = did_you_mean(heading, [other.usual for other in absent])
            meant.add(near)
            hint = f"did you mean {near}?" if near else f"those known are {', '.join(c.usual for c in columns)}"
            problems.append(Problem(f"unknown column: {hint}", file, 1, heading or "(no name)", "row"))
        elif column in found:
            problems.append(Problem(f"this column is there twice, also as {found[column]}", file, 1, heading, "row"))
        else:
            found[column] = heading
    for column in columns:
        if column.needed and column not in found and column.usual not in meant:
            others = ", ".join(list(column.headings)[1:])
            text = "this column is missing" + (f" (or as {others})" if others else "")
            problems.append(Problem(text, file, 1, column.usual, "row"))
    if problems:
        raise InputError(problems)
    return found


def _values(column: Column, heading: str, texts: list[str], rows: Sequence[int], faults: Faults):
    """The fields in SI units (M,), or as text."""
    unit, needs = column.headings[heading], {"text": "a name", "count": "a whole number from 1", "sign": "1 or -1"}
    needed = f": needs {f'a number in {unit}' if unit else needs[column.kind]}{' above 0' if column.positive else ''}"
    values = np.full(len(texts), np.nan)
    for i, (row, text) in enumerate(zip(rows, texts, strict=True)):
        if not text:
            if column.filled:
                faults.add(row, heading, f"is empty{needed}", "empty")
        elif column.kind != "text":
            values[i] = _number(column, text, needed, lambda *fault, row=row: faults.add(row, heading, *fault))
    if column.kind == "text":
        return texts
    return values * UNITS[column.kind][unit] if unit else np.nan_to_num(values).astype(np.int64)


def _number(column: Column, text: str, needed: str, fault: Callable[[str, str], None]) -> float:
    """The number of a field; NaN where it is none or does not fit, after fault(message, kind)."""
    try:
        value = float(text)
    except ValueError:
        fault(f"{shown(text)} is not a number{needed}", "number")
        return np.nan
    if not np.isfinite(value):
        fault(f"is not finite{needed}", "finite")
    elif {"count": not 1 <= value <= MOST_COUNTED or value != round(value), "sign": abs(value) != 1}.get(
        column.kind, column.positive and value <= 0
    ):
        fault(f"{shown(text)} does not fit{needed}", "kind")
    else:
        return value
    return np.nan
