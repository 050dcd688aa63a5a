"""A comma-separated table of numbers, read in blocks with the exact row of every fault.

Rows are numbered as a spreadsheet shows them: the header is row 1. An empty field reads as NaN.
"""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, ClassVar

import numpy as np

from ctcr.arrays import Array, Integers, Mask
from ctcr.errors import InputError, Problem, shown
from ctcr.inputs import open_input

BLOCK_BYTES = 4 << 20
BYTES_PER_NUMBER = 32  # of memory: the table, and what comparisons and fits make of it
MAX_HEADER_BYTES = 1 << 16
SHOWN_PER_KIND = 3  # rows shown of each kind of fault; the others are counted
SHOWN = 20  # faults shown of a table

_IMPORT = " (ctcr import does so with a log)"
_NUMBER_BYTES = b"0123456789+-.eE, "
_NUMBER = re.compile(r" *[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)? *")


@dataclass
class Faults:
    """Faults of a table by kind; a fault of a million rows stays three lines and a count."""

    file: str
    _kinds: dict[tuple[str, str], tuple[int, list[Problem]]] = field(default_factory=dict)

    def add(self, row: int, column: str | None, message: str, kind: str | None = None, count: int = 1) -> None:
        """`count` faults of one kind (`kind`, else the message), the first of them in `row`."""
        key = (column or "", kind or message)
        total, examples = self._kinds.get(key, (0, []))
        if len(examples) < SHOWN_PER_KIND:
            examples = [*examples, Problem(message, self.file, row, column, line_name="row")]
        self._kinds[key] = (total + count, examples)

    def where(self, bad: Mask, rows: Integers, column: str, kind: str, say: Callable[[int], str]) -> None:
        """A fault of a kind in each row `rows[i]` where `bad[i]`; `say(i)` is its message."""
        found = np.flatnonzero(bad)
        for i in found[:SHOWN_PER_KIND]:
            self.add(int(rows[i]), column, say(i), kind)
        if len(found) > SHOWN_PER_KIND:
            self.add(int(rows[found[-1]]), column, "", kind, len(found) - SHOWN_PER_KIND)

    @property
    def total(self) -> int:
        return sum(total for total, _ in self._kinds.values())

    def problems(self) -> list[Problem]:
        """The first faults of each kind, in the order of the rows."""
        found = [problem for _, examples in self._kinds.values() for problem in examples]
        return sorted(found, key=lambda problem: problem.line)[:SHOWN]

    def raise_any(self) -> None:
        if self._kinds:
            found = self.problems()
            raise InputError(found, omitted=self.total - len(found))


@dataclass(frozen=True)
class NumberTable:
    """A table whose header has been read. Rows are the bytes from `start` to `end`, `n_rows` of them."""

    path: Path
    columns: tuple[str, ...]
    n_rows: int
    start: int
    end: int
    index: ClassVar[tuple[str, ...]] = ()  # names of what a DataFrame holds beside its columns

    def blocks(self, faults: Faults) -> Iterator[tuple[Integers, Array, int]]:
        """Blocks of rows: (row numbers, numbers (rows, columns), bytes read). Unreadable rows go to `faults`."""
        row = 2
        with open(self.path, "rb") as file:
            file.seek(self.start)
            while (left := self.end - file.tell()) > 0:
                raw = file.read(min(BLOCK_BYTES, left))
                raw += file.readline(self.end - file.tell())
                lines = raw.replace(b"\r\n", b"\n").removesuffix(b"\n").split(b"\n")
                rows = np.arange(row, row + len(lines))
                numbers = _numbers(lines, len(self.columns))
                if numbers is None:
                    readable = [_is_readable(line, self.columns, row + i, faults) for i, line in enumerate(lines)]
                    rows = rows[readable]
                    numbers = _numbers([lines[i - row] for i in rows], len(self.columns))
                yield rows, numbers, len(raw)
                row += len(lines)


def read_columns(path: str | Path, columns: Sequence[str]) -> Array:
    """The numbers (M, columns) of a table that has just these columns. Raises InputError with its faults."""
    table, faults = open_table(path), Faults(str(path))
    if table.columns != tuple(columns):
        raise InputError(Problem(f"holds other columns than {','.join(columns)}", str(path), 1, line_name="row"))
    numbers = np.vstack([block for _, block, _ in table.blocks(faults)])
    faults.raise_any()
    return numbers


def open_table(path: str | Path) -> NumberTable:
    """Reads the header and counts the rows. Raises InputError where the file is no table of text."""
    with open_input(path) as file:
        columns = header_names(file.readline(MAX_HEADER_BYTES), str(path))
        if any('"' in name for name in columns):
            raise InputError(Problem(f"holds quotes: write names and numbers without{_IMPORT}", str(path)))
        start = file.tell()
        end = _end_of_content(file, start)
        n_rows = _count_lines(file, start, end)
    if n_rows == 0:
        raise InputError(Problem("has no rows below the header", str(path)))
    needed, present = BYTES_PER_NUMBER * n_rows * len(columns), os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > present:
        said = (
            f"has {n_rows} rows: {needed / 1e9:.0f} GB of memory are needed, {present / 1e9:.0f} GB are there: split it"
        )
        raise InputError(Problem(said, str(path)))
    return NumberTable(Path(path), columns, n_rows, start, end)


def header_names(header: bytes, file: str) -> tuple[str, ...]:
    """The names of the columns, from the first line of a table. Raises InputError where it is no such line."""
    try:
        text = header.decode("utf-8-sig").strip()
    except UnicodeDecodeError:
        text = "\0"
    names = tuple(name.strip() for name in text.split(","))
    faults = {
        "is a robot file, not a table of measurements": file.endswith((".yaml", ".yml")),
        "is text in UTF-16: save it as UTF-8": header.startswith((b"\xff\xfe", b"\xfe\xff")),
        "is a spreadsheet, not text: save it as CSV": header.startswith(b"PK"),
        "is not text": any(ord(letter) < 32 and letter not in "\t\r" for letter in text),
        "is empty": not header,
        "has an empty first row: it must name the columns": not text,
        "ends its lines with CR alone: save it with LF or CR LF": "\r" in text,
        "has a first row without end: this is not a table": len(header) == MAX_HEADER_BYTES,
        f"separates its columns by semicolons or tabs: use commas, and points for decimals{_IMPORT}": len(names) == 1
        and len(re.split("[;\t]", text)) > 1,
        "has no header: its first row must name the columns": all(_NUMBER.fullmatch(name) for name in names),
    }
    if fault := next((fault for fault, found in faults.items() if found), None):
        raise InputError(Problem(fault, file))
    return names


def _end_of_content(file: BinaryIO, start: int) -> int:
    """Where the last row that is not blank ends."""
    position = file.seek(0, 2)
    while position > start:
        step = min(BLOCK_BYTES, position - start)
        file.seek(position - step)
        if content := file.read(step).rstrip(b"\r\n"):
            return position - step + len(content)
        position -= step
    return start


def _count_lines(file: BinaryIO, start: int, end: int) -> int:
    file.seek(start)
    lines = 1 if end > start else 0
    while block := file.read(min(BLOCK_BYTES, end - file.tell())):
        lines += block.count(b"\n")
    return lines


def _numbers(lines: list[bytes], n_columns: int) -> Array | None:
    """The numbers (lines, columns), or None where any line is faulty: fast; `_is_readable` then finds the line."""
    if any(line.count(b",") != n_columns - 1 for line in lines):
        return None
    text = b",".join(lines)
    if text.translate(None, _NUMBER_BYTES):
        return None
    text = b"," + text + b","
    while b",," in text:
        text = text.replace(b",,", b",nan,")
    try:
        numbers = map(float, text[1:-1].decode("ascii").split(","))
        return np.fromiter(numbers, float, count=len(lines) * n_columns).reshape(len(lines), n_columns)
    except ValueError:
        return None


def _is_readable(line: bytes, columns: tuple[str, ...], row: int, faults: Faults) -> bool:
    """Whether `_numbers` can read the line; adds its faults to `faults`."""
    fields = line.decode("utf-8", "replace").split(",")
    if not line.strip():
        faults.add(row, None, "is empty")
        return False
    if len(fields) != len(columns):
        faults.add(row, None, f"has {len(fields)} fields: the header has {len(columns)}", "fields")
        return False
    wrong = {column: text for column, text in zip(columns, fields, strict=True) if text and not _NUMBER.fullmatch(text)}
    for column, text in wrong.items():
        faults.add(row, column, f"{shown(text)} is not a number{_hint(text)}", "number")
    return not wrong


def _hint(text: str) -> str:
    if text.strip(" \"'").lower() in ("nan", "na", "n/a", "none", "null", "-", ""):
        return ": leave the field empty where nothing was measured"
    return ": write it without quotes" if '"' in text else ""
