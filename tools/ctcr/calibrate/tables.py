"""The small tables of the calibration procedures: CSV, the unit of a column at the end of its name.

A column may come in any unit of its kind: `x_mm` or `x_m`, `motor_angle_deg` or `motor_angle_rev`. SI inside.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ctcr.errors import InputError, Problem, did_you_mean, file_fault, shown
from ctcr.table.csv_table import Faults

Array = NDArray[np.float64]
MAX_BYTES = 16 << 20

UNITS = {
    "length": {"mm": 1e-3, "m": 1.0, "um": 1e-6},
    "angle": {"deg": pi / 180, "rad": 1.0, "rev": 2 * pi},
    "load": {"N": 1.0, "mN": 1e-3, "g": 9.80665e-3},
    "picture": {"px": 1.0, "mm": 1e-3, "m": 1.0},
}
_WITHOUT_UNIT = {"count": "a whole number from 1", "sign": "1 or -1"}


@dataclass(frozen=True)
class Column:
    """A column of a table. `kind`: one of UNITS; or, without unit, "text", "count" (1, 2, ..) or "sign" (1 or -1).

    `needed`: the column must be there. `filled`: no field of it may be empty.
    """

    name: str
    kind: str
    needed: bool = True
    filled: bool = True

    @property
    def headings(self) -> tuple[str, ...]:
        """How the column may be called, the usual one first."""
        if self.kind in UNITS:
            return tuple(f"{self.name}_{unit}" for unit in UNITS[self.kind])
        return (self.name,)


@dataclass(frozen=True)
class Table:
    """The columns that are there, by name, in SI units; empty fields are NaN. `unit` is as written in the file."""

    file: str
    row: NDArray[np.int64]  # (M,) of the file; the header is row 1
    columns: dict[str, Array | NDArray[np.int64] | list[str]]
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
    lines = _lines(path)
    file, header = str(path), [name.strip() for name in lines[0]]
    found = _find(header, columns, file)
    faults = Faults(file)
    rows = [(number, fields) for number, fields in enumerate(lines[1:], start=2) if any(map(str.strip, fields))]
    if not rows:
        raise InputError(Problem("has no rows below the header", file))
    for number, fields in rows:
        if len(fields) != len(header):
            faults.add(number, None, f"has {len(fields)} fields: the header has {len(header)}", "fields")
    faults.raise_any()
    data, units = {}, {}
    for column, heading in found.items():
        place = header.index(heading)
        texts = [fields[place].strip() for _, fields in rows]
        values = _values(column, heading, texts, [number for number, _ in rows], faults)
        units[column.name] = heading.removeprefix(column.name).removeprefix("_")
        data[column.name] = values
    faults.raise_any()
    return Table(file, np.array([number for number, _ in rows]), data, units)


def _lines(path: str | Path) -> list[list[str]]:
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise file_fault(error, path, "read") from None
    fault = None
    if len(content) > MAX_BYTES:
        fault = f"is over {MAX_BYTES >> 20} MB: this is not a table of a calibration procedure"
    elif content.startswith(b"PK"):
        fault = "is a spreadsheet, not text: save it as CSV"
    else:
        try:
            text = content.decode("utf-8-sig")
            if "\0" in text:
                fault = "is not text"
        except UnicodeDecodeError:
            fault = "is not text in UTF-8"
    if not fault and not text.strip():
        fault = "is empty"
    if fault:
        raise InputError(Problem(fault, str(path)))
    rows = text.splitlines()
    if "," not in rows[0] and (";" in rows[0] or "\t" in rows[0]):
        raise InputError(
            Problem("separates its columns by semicolons or tabs: use commas, and points for decimals", str(path))
        )
    return list(csv.reader(rows))


def _find(header: list[str], columns: Sequence[Column], file: str) -> dict[Column, str]:
    """The heading of each column that is there; raises InputError with all faults of the header."""
    known = {heading: column for column in columns for heading in column.headings}
    found: dict[Column, str] = {}
    problems, meant = [], set()
    for heading in header:
        column = known.get(heading)
        if column is None:
            free = [other for other in columns if not any(name in header for name in other.headings)]
            near = did_you_mean(heading, [other.headings[0] for other in free])
            meant |= {other for other in free if other.headings[0] == near}
            text = "unknown column" + (f": did you mean {near}?" if near else f": those known are {_names(columns)}")
            problems.append(Problem(text, file, 1, heading or "(no name)", line_name="row"))
        elif column in found:
            problems.append(Problem(f"this column is there twice, also as {found[column]}", file, 1, heading, "row"))
        else:
            found[column] = heading
    for column in columns:
        if column.needed and column not in found and column not in meant:
            text = (
                f"this column is missing (or as {', '.join(column.headings[1:])})"
                if column.headings[1:]
                else ("this column is missing")
            )
            problems.append(Problem(text, file, 1, column.headings[0], line_name="row"))
    if problems:
        raise InputError(problems)
    return found


def _names(columns: Sequence[Column]) -> str:
    return ", ".join(column.headings[0] for column in columns)


def _values(column: Column, heading: str, texts: list[str], rows: list[int], faults: Faults):
    if column.kind == "text":
        for row, text in zip(rows, texts, strict=True):
            if not text:
                faults.add(row, heading, "is empty: needs a name")
        return texts
    unit = heading.removeprefix(column.name).removeprefix("_")
    needs = f": needs a number in {unit}" if unit else f": needs {_WITHOUT_UNIT[column.kind]}"
    values = np.full(len(texts), np.nan)
    for i, (row, text) in enumerate(zip(rows, texts, strict=True)):
        if not text:
            if column.filled:
                faults.add(row, heading, f"is empty{needs}", "empty")
            continue
        try:
            values[i] = float(text)
        except ValueError:
            faults.add(row, heading, f"{shown(text)} is not a number{needs}", "number")
            continue
        if not np.isfinite(values[i]):
            faults.add(row, heading, f"is not finite{needs}", "finite")
        elif (column.kind == "count" and (values[i] < 1 or values[i] != round(values[i]))) or (
            column.kind == "sign" and abs(values[i]) != 1
        ):
            faults.add(row, heading, f"{shown(text)} does not fit{needs}", "kind")
    if not unit:
        return np.nan_to_num(values).astype(np.int64)
    return values * UNITS[column.kind][unit]
