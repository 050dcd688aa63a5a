"""Logs as text: delimiters, decimal commas, headers of any height and rows that are no rows are found out.

What cannot go wrong is tolerated (blank lines, comments, lines that name a run, a header repeated where files were
joined, an index column, a trailing delimiter, a last row cut off) and said; any other row that does not fit is a fault
with its number.
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
from ctcr.intake.log import Log, distinct
from ctcr.intake.makers import Rows
from ctcr.intake.names import RUN, meaning
from ctcr.intake.units import named
from ctcr.show.wording import listed
from ctcr.table.csv_table import Faults

SAMPLE_LINES = 400
HEAD_LINES = 2000  # among which the table begins
WHITESPACE = " "
_WIDE = ("utf-32-le", "utf-32-be", "utf-16-le", "utf-16-be")
_NO_COMMENT = ("", "comment", "comments")  # names of a last column that rows may leave out, as LabVIEW writes it
_DELIMITERS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", WHITESPACE: "spaces"}  # in this order
_NUMBER = re.compile(r"[-+−]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[-+−]?\d*,\d+([eEdD][-+]?\d+)?")
_POINT_NUMBER = re.compile(r"[-+−]?\d*\.\d+([eEdD][-+]?\d+)?")

_BRACKETED = re.compile(r"\[.*\]|\(.*\)")
_RUN_LINE = re.compile(r"\W*([^\W\d_]+)[\W_]*(\d+)\W*")  # Run 2, # trial_3


def read(path: Path, content: bytes) -> Log:
    """The log of a text file. Raises InputError with all its rows that do not fit."""
    text, notes = _decoded(path, content)
    lines = makers.without_labview_headers(text.split("\n"))
    delimiter = _delimiter(lines)
    head = _split(path, lines[:HEAD_LINES], delimiter)
    if maker := makers.reader_of(head):
        return maker(path, _split(path, lines, delimiter))
    start = _first_data(head)
    if start is None:
        raise InputError(Problem("holds no rows of numbers: is this a log?", str(path)))
    first, sample = head[start][0], [fields for _, fields in head[start : start + SAMPLE_LINES]]
    count = Counter(len(fields) for fields in sample if fields).most_common(1)[0][0]  # the usual one
    names = _names(head, start, count)
    if delimiter == "," and (halves := _halves(head, start, count)):
        text = f"has {count} fields a row and {halves} names: between commas, decimal commas cannot be told: "
        text += "export it with decimal points, or separated by semicolons or tabs"
        raise InputError(Problem(text, str(path)))
    notes += [f"line 1 to {first - 1}: no table; passed over"] * (names[0] == "#1" and first > 1)
    regular = _regular(lines, first, delimiter, len(names))
    rows = [] if regular else _split(path, lines, delimiter)
    columns, numbers = regular or _irregular(path, rows, start, names, notes)
    if (runs := _runs(rows, numbers)) and not any(found and found.role == "run" for found in map(meaning, names)):
        names, columns = [*names, "run"], [*columns, runs]
    decimal_comma = _has_decimal_comma(sample)
    used = [i for i, name in enumerate(names) if name or any(columns[i])]  # an empty column without a name is none
    kind = f"text, separated by {_DELIMITERS[delimiter]}" + ", decimal commas" * decimal_comma
    names = _called(names, columns)
    labels = tuple(distinct([names[i] or f"#{i + 1}" for i in used]))
    meanings = {name: makers.X_VALUE for name in labels if name == "X_Value"}
    return Log(path, kind, labels, tuple(columns[i] for i in used), numbers, decimal_comma, meanings, notes=notes)


def _regular(lines: list[str], first: int, delimiter: str, count: int) -> tuple[list[list[str]], Integers] | None:
    """The columns of lines without quotes, comments or gaps from line `first` on, fast; None for all others."""
    last = len(lines)
    while last > first and not lines[last - 1].strip():
        last -= 1
    body = lines[first - 1 : last]
    odd = any(line.count(delimiter) != count - 1 or line[:1] in "#%" or _RUN_LINE.fullmatch(line) for line in body)
    if odd or delimiter == WHITESPACE or (first > 1 and lines[first - 2] in body):
        return None
    whole = delimiter.join(body)
    if '"' in whole:
        return None
    fields = whole.split(delimiter)
    return [fields[i::count] for i in range(count)], np.arange(first, last + 1)


def _decoded(path: Path, content: bytes) -> tuple[str, list[str]]:
    notes: list[str] = []
    if b"\0" in content[:4096]:
        wide = [content.decode(encoding, "replace").removeprefix("\ufeff") for encoding in _WIDE]
        text = max(wide, key=lambda text: sum(map(str.isascii, text[:1000])) / len(text[:1000] or " "))
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", "replace")
            notes.append("is not UTF-8: read as Windows text (cp1252)")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if re.search(r"[\0-\b]", text[:4096]):
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


def _is_comment(fields: list[str]) -> bool:
    return fields[0].lstrip().startswith(("#", "%"))


def _looks_like_data(fields: list[str]) -> bool:
    filled = [field for field in fields if field.strip()]
    return len(filled) > 1 and not _is_comment(fields) and sum(map(_is_number, filled)) >= max(1, len(filled) / 3)


def _first_data(rows: Rows) -> int | None:
    """The index of the first row of numbers that the next one follows with as many fields."""
    following = [i for i, (_, fields) in enumerate(rows) if _looks_like_data(fields)]
    for i in following:
        after = next((fields for _, fields in rows[i + 1 :] if any(fields) and not _is_comment(fields)), None)
        alike = after is None or abs(len(after) - len(rows[i][1])) <= 1 and _looks_like_data(after)
        counting = _counts([field.strip() for field in rows[i][1]])
        above = next((fields for _, fields in reversed(rows[:i]) if any(fields)), [])
        if alike and not counting and not _joined(above, rows[i][1]):  # 0, 1, 2, ... is how some programs name columns
            return i
    return None


def _names(rows: Rows, start: int, count: int) -> list[str]:
    """Names of the `count` columns, #1, #2, ... without a header; a second row of names, or one of units, below it is
    joined to them. Below a row of `count` names, comments and shorter rows are passed over."""
    above = [fields for _, fields in rows[:start] if any(field.strip() for field in fields)]
    plain = [not _is_comment(fields) and abs(len(fields) - count) <= 1 for fields in above]
    full = [abs(sum(map(bool, fields)) - count) <= 1 and not _are_units(fields) for fields in above]
    header = max((i for i in range(len(above)) if plain[i] and full[i]), default=len(above))
    above = [fields for i, fields in enumerate(above) if i <= header or plain[i]]
    units: list[str] = []
    if len(above) > 1 and _are_units(above[-1]) and abs(len(above[-2]) - count) <= 1:
        units = [field.strip(" []()") for field in above.pop()]
    if len(above) > 1 and (both := _joined(*above[-2:])):
        above.append(both)
    header = above[-1] if above and abs(len(above[-1]) - count) <= 1 and count > 1 else None
    if header is None:
        return [f"#{i}" for i in range(1, count + 1)]
    names = [field.strip().strip("'\"").strip() for field in header]
    names[0] = names[0].lstrip("#%").strip()
    if len(names) == count + 1 and not names[0]:  # the sign of the comment stood alone
        names, units = names[1:], units[1:]
    if len(names) < count:
        last_empty = all(not fields[-1].strip() for _, fields in rows[start:] if len(fields) == count)
        names = [*names, ""] if last_empty else ["", *names]
    units = [""] * (len(names) - len(units)) + units
    names = [f"{name} [{unit}]" if unit.strip("-") else name for name, unit in zip(names, units, strict=False)]
    return names[: max(count, len([n for n in names if n]))]


def _halves(rows: Rows, start: int, count: int) -> int:
    """How many names stand above rows of `count` fields, if decimal commas made two fields of most numbers; else 0."""
    above = next((fields for _, fields in reversed(rows[:start]) if any(field.strip() for field in fields)), [])
    named = len(above) + 1 < count <= 2 * len(above) and not any(map(_is_number, above))
    fields = [field.strip() for _, fields in rows[start : start + SAMPLE_LINES] for field in fields]
    return len(above) if named and not any(map(_POINT_NUMBER.fullmatch, fields)) else 0


def _joined(upper: list[str], lower: list[str]) -> list[str]:
    """The names of a header of two rows; [] where two rows are none. Columns share an upper name, once where cells are
    merged. Lower ones count these columns, or are words of which some stand below other upper names too."""
    groups: dict[str, list[str]] = {}
    names, name, words = [], "", [field.strip() for field in lower]
    for above, word in zip([*upper, *[""] * len(lower)], words, strict=False):
        name = above.strip() or name * bool(word)
        groups.setdefault(name, []).append(word)
        names.append(f"{name} {word}".strip())
    groups.pop("", None)
    told = [
        _counts(group) or len({*group}) == len(group) and not any(map(_is_number, group)) for group in groups.values()
    ]
    again = any(map(_is_number, words)) or len({*words} - {""}) < sum(map(bool, words))
    return names if all(told) and again and any(len(group) > 1 for group in groups.values()) else []


def _counts(fields: list[str]) -> bool:
    """Whether fields are 0, 1, 2, ... or 1, 2, 3, ..."""
    return len(fields) > 1 and fields in ([str(i + first) for i in range(len(fields))] for first in (0, 1))


def _are_units(fields: list[str]) -> bool:
    """Whether most fields are units, or stand in brackets: of what has no unit, or none that is known."""
    filled = [field.strip() for field in fields if field.strip(" []()")]
    units = [_BRACKETED.fullmatch(field) or field == "-" or named(field.strip(" []()")) for field in filled]
    return sum(map(bool, units)) >= max(1, len(filled) / 2) and any(
        map(named, (field.strip(" []()") for field in filled))
    )


def _irregular(
    path: Path, all_rows: Rows, start: int, names: list[str], notes: list[str]
) -> tuple[list[list[str]], Integers]:
    """Columns of the table that begins at row `start`, and the line of each row; other text between rows is skipped."""
    faults, kept, count = Faults(str(path)), [], len(names)
    passed: dict[str, list[int]] = {}
    above, rows = {tuple(fields) for _, fields in all_rows[:start]}, all_rows[start:]
    for i, (number, fields) in enumerate(rows):
        if _number_of_run(fields):
            passed.setdefault("names a run", []).append(number)
        elif not any(field.strip() for field in fields):
            continue
        elif _is_comment(fields):
            passed.setdefault("a comment", []).append(number)
        elif tuple(fields) in above:
            passed.setdefault("the header again", []).append(number)
        elif len(fields) == count:
            kept.append((number, fields))
        elif len(fields) > count and not any(fields[count:]):
            kept.append((number, fields[:count]))
        elif len(fields) == count - 1 and names[-1].lower() in _NO_COMMENT:
            kept.append((number, [*fields, ""]))
        elif all(not any(later) for _, later in rows[i + 1 :]) and len(fields) < count:
            passed.setdefault("cut off, the last of the file", []).append(number)
        else:
            todo = "a line that is no row begins with #, one such as Run 2 begins a run"
            faults.add(number, None, f"has {len(fields)} fields: the table has {count} ({todo})", "fields")
    faults.raise_any()
    if not kept:
        raise InputError(Problem("has no whole row below its header", str(path)))
    notes += [f"row {listed(numbers)}: {why}{'; left out' * (why != 'names a run')}" for why, numbers in passed.items()]
    columns = [list(column) for column in zip(*(fields for _, fields in kept), strict=True)]
    return columns, np.array([number for number, _ in kept], dtype=np.int64)


def _number_of_run(fields: list[str]) -> str:
    """The run that a line such as "Run 2" begins; "" for other lines."""
    found = _RUN_LINE.fullmatch(" ".join(field for field in fields if field.strip()))
    return found[2] if found and found[1].lower() in RUN else ""


def _runs(rows: Rows, numbers: Integers) -> list[str]:
    """The run of each row of numbers, where lines between them begin runs; [] where none does."""
    begins = {number: run for number, fields in rows if (run := _number_of_run(fields))}
    if not begins or max(begins) < numbers[0]:
        return []
    runs = [str(min(map(int, begins.values())) - 1), *begins.values()]  # the first: of rows above these lines
    return [runs[i] for i in np.searchsorted([*begins], numbers)]


def _has_decimal_comma(rows: list[list[str]]) -> bool:
    fields = [field.strip() for row in rows for field in row]
    commas = sum(_COMMA_NUMBER.fullmatch(field) is not None for field in fields)
    return commas > 0 and not any(_POINT_NUMBER.fullmatch(field) for field in fields)


def _called(names: list[str], columns: list[list[str]]) -> list[str]:
    """The names, where texts of ROS say them in columns of their own: position2 is that of the joint in name2."""
    parts = [re.fullmatch(r"(.*?)([a-z]+)(\d+)", name) for name in names]
    pairs = [(part.group(1, 3), part[2]) if part else (None, "") for part in parts]
    called = [(key, {*column}) for (key, word), column in zip(pairs, columns, strict=True) if word == "name"]
    words = {key: found.pop() for key, found in called if len(found) == 1}
    return [
        f"{words[key]} {word}" if key in words and word != "name" else name
        for (key, word), name in zip(pairs, names, strict=True)
    ]
