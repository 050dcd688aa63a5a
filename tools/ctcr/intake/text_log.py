"""Logs as text: delimiters, decimal commas, headers of any height and rows that are no rows are found out.

What cannot go wrong is tolerated (blank lines, comments, a header repeated where files were joined, an index column, a
trailing delimiter, a last row cut off) and said; any other row that does not fit is a fault with its number.
"""

import csv
import io
import re
from collections import Counter
from pathlib import Path

import numpy as np

from ctcr.arrays import Integers
from ctcr.errors import InputError, Problem
from ctcr.intake import makers
from ctcr.intake.log import Log
from ctcr.intake.units import named
from ctcr.show.wording import listed
from ctcr.table.csv_table import Faults

SAMPLE_LINES = 400
HEAD_LINES = 2000  # among which the table begins
WHITESPACE = " "
_DELIMITERS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", WHITESPACE: "spaces"}  # in this order
_NUMBER = re.compile(r"[-+−]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[-+−]?\d*,\d+([eEdD][-+]?\d+)?")
_POINT_NUMBER = re.compile(r"[-+−]?\d*\.\d+([eEdD][-+]?\d+)?")

Rows = list[tuple[int, list[str]]]  # number of the line in the file, from 1; fields


def read(path: Path, content: bytes) -> Log:
    """The log of a text file. Raises InputError with all its rows that do not fit."""
    text, notes = _decoded(path, content)
    lines = text.split("\n")
    delimiter = _delimiter(lines)
    head = _split(path, lines[:HEAD_LINES], delimiter)
    if maker := makers.reader_of(head):
        return maker(path, _split(path, lines, delimiter))
    start = _first_data(head)
    if start is None:
        raise InputError(Problem("holds no rows of numbers: is this a log?", str(path)))
    count = _usual_count(head, start)
    names, header = _names(head, start, count)
    notes += [f"line 1 to {head[start][0] - 1}: no table; passed over"] * (header is None and head[start][0] > 1)
    first, sample = head[start][0], [fields for _, fields in head[start : start + SAMPLE_LINES]]
    columns, numbers = _regular(lines, first, delimiter, len(names)) or _irregular(
        path, _split(path, lines, delimiter)[start:], len(names), header, notes
    )
    decimal_comma = _has_decimal_comma(sample)
    used = [i for i, name in enumerate(names) if name or any(columns[i])]  # an empty column without a name is none
    kind = f"text, separated by {_DELIMITERS[delimiter]}" + ", decimal commas" * decimal_comma
    labels = tuple(_distinct([names[i] or f"#{i + 1}" for i in used]))
    return Log(path, kind, labels, tuple(columns[i] for i in used), numbers, decimal_comma, notes=notes)


def _regular(lines: list[str], first: int, delimiter: str, count: int) -> tuple[list[list[str]], Integers] | None:
    """The columns of lines without quotes, comments or gaps from line `first` on, fast; None for all others."""
    last = len(lines)
    while last > first and not lines[last - 1].strip():
        last -= 1
    body = lines[first - 1 : last]
    odd = delimiter == WHITESPACE or any(line.count(delimiter) != count - 1 or line[:1] in "#%" for line in body)
    if odd or (first > 1 and lines[first - 2] in body):
        return None
    whole = delimiter.join(body)
    if '"' in whole:
        return None
    fields = whole.split(delimiter)
    return [fields[i::count] for i in range(count)], np.arange(first, last + 1)


def _decoded(path: Path, content: bytes) -> tuple[str, list[str]]:
    notes: list[str] = []
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", "replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", "replace")
            notes.append("is not UTF-8: read as Windows text (cp1252)")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\0" in text[:4096]:
        raise InputError(Problem("is neither text nor a format that is known (.mat, .h5, .mcap)", str(path)))
    if not text.strip():
        raise InputError(Problem("is empty", str(path)))
    return text, notes


def _delimiter(lines: list[str]) -> str:
    """The first delimiter that splits the later lines of a sample alike; commas, which may be decimal, come late."""
    sample = [line for line in lines[:SAMPLE_LINES] if line.strip()]
    sample = sample[len(sample) // 2 :]

    def agreement(delimiter: str) -> float:
        counts = Counter(len(_fields(line, delimiter)) for line in sample)
        count, times = counts.most_common(1)[0]
        return times / len(sample) if count > 1 else 0.0

    scores = {delimiter: agreement(delimiter) for delimiter in _DELIMITERS}
    good = [delimiter for delimiter, score in scores.items() if score >= 0.8]
    return good[0] if good else max(scores, key=lambda delimiter: scores[delimiter])


def _fields(line: str, delimiter: str) -> list[str]:
    if delimiter == WHITESPACE:
        return line.split()
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


def _split(path: Path, lines: list[str], delimiter: str) -> Rows:
    if delimiter == WHITESPACE:
        return [(i, line.split()) for i, line in enumerate(lines, start=1)]
    reader = csv.reader(io.StringIO("\n".join(lines)), delimiter=delimiter, skipinitialspace=True)
    try:
        return [(reader.line_num, fields) for fields in reader]
    except csv.Error as error:
        raise InputError(Problem(f"cannot be read as a table: {error}", str(path), reader.line_num)) from None


def _is_number(text: str) -> bool:
    return _NUMBER.fullmatch(text.strip()) is not None


def _looks_like_data(fields: list[str]) -> bool:
    filled = [field for field in fields if field.strip()]
    return len(filled) > 1 and sum(map(_is_number, filled)) >= max(1, len(filled) / 3)


def _first_data(rows: Rows) -> int | None:
    """The index of the first row of numbers that the next one follows with as many fields."""
    following = [i for i, (_, fields) in enumerate(rows) if _looks_like_data(fields)]
    for i in following:
        after = next((fields for _, fields in rows[i + 1 :] if any(fields)), None)
        alike = after is None or abs(len(after) - len(rows[i][1])) <= 1 and _looks_like_data(after)
        counting = [field.strip() for field in rows[i][1]] == [str(k) for k in range(len(rows[i][1]))]
        if alike and not counting:  # 0, 1, 2, ... is how some programs name columns
            return i
    return None


def _usual_count(rows: Rows, start: int) -> int:
    return Counter(len(fields) for _, fields in rows[start : start + SAMPLE_LINES] if fields).most_common(1)[0][0]


def _names(rows: Rows, start: int, count: int) -> tuple[list[str], list[str] | None]:
    """Names of the `count` columns, and the row that held them; a row of units below them is joined to them."""
    above = [fields for _, fields in rows[:start] if any(field.strip() for field in fields)]
    units: list[str] = []
    if len(above) > 1 and _are_units(above[-1]) and abs(len(above[-2]) - count) <= 1:
        units = [field.strip(" []()") for field in above.pop()]
    header = above[-1] if above and abs(len(above[-1]) - count) <= 1 and count > 1 else None
    if header is None:
        return [f"#{i}" for i in range(1, count + 1)], None
    names = [field.strip().strip("'\"").strip() for field in header]
    names[0] = names[0].lstrip("#%").strip()
    if len(names) == count + 1 and not names[0]:  # the sign of the comment stood alone
        names, units = names[1:], units[1:]
    if len(names) < count:
        last_empty = all(not fields[-1].strip() for _, fields in rows[start:] if len(fields) == count)
        names = [*names, ""] if last_empty else ["", *names]
    names = [f"{name} [{unit}]" if unit else name for name, unit in _padded(names, units)]
    return names[: max(count, len([n for n in names if n]))], header


def _padded(names: list[str], units: list[str]) -> list[tuple[str, str]]:
    units = [""] * max(0, len(names) - len(units)) + units if len(units) < len(names) else units
    return list(zip(names, units, strict=False))


def _are_units(fields: list[str]) -> bool:
    filled = [field.strip(" []()") for field in fields if field.strip(" []()")]
    return bool(filled) and sum(named(field) is not None for field in filled) >= len(filled) / 2


def _irregular(
    path: Path, rows: Rows, count: int, header: list[str] | None, notes: list[str]
) -> tuple[list[list[str]], Integers]:
    """The columns of rows among which some do not belong to the table of `count` columns, and their lines."""
    faults, kept = Faults(str(path)), []
    passed: dict[str, list[int]] = {}
    for i, (number, fields) in enumerate(rows):
        if len(fields) == count:
            if header is not None and fields == header:
                passed.setdefault("the header again", []).append(number)
            else:
                kept.append((number, fields))
        elif not any(field.strip() for field in fields):
            continue
        elif fields[0].lstrip().startswith(("#", "%")):
            passed.setdefault("a comment", []).append(number)
        elif len(fields) > count and not any(fields[count:]):
            kept.append((number, fields[:count]))
        elif len(fields) == count - 1 and header is not None and not header[-1].strip():
            kept.append((number, [*fields, ""]))
        elif all(not any(later) for _, later in rows[i + 1 :]) and len(fields) < count:
            passed.setdefault("cut off, the last of the file", []).append(number)
        else:
            faults.add(number, None, f"has {len(fields)} fields: the table has {count}", "fields")
    faults.raise_any()
    if not kept:
        raise InputError(Problem("has no whole row below its header", str(path)))
    notes += [f"row {listed(numbers)}: {why}; left out" for why, numbers in passed.items()]
    columns = [list(column) for column in zip(*(fields for _, fields in kept), strict=True)]
    return columns, np.array([number for number, _ in kept], dtype=np.int64)


def _has_decimal_comma(rows: list[list[str]]) -> bool:
    fields = [field.strip() for row in rows for field in row]
    commas = sum(_COMMA_NUMBER.fullmatch(field) is not None for field in fields)
    return commas > 0 and not any(_POINT_NUMBER.fullmatch(field) for field in fields)


def _distinct(names: list[str]) -> list[str]:
    """The names, where one comes again with its count: x, x (2)."""
    seen: Counter[str] = Counter()
    made = []
    for name in names:
        seen[name] += 1
        made.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return made
