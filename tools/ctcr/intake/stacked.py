"""Logs with a row for each tool of the tracker: rows of one time become one row, with columns of each tool."""

import re
from dataclasses import replace

import numpy as np

from ctcr.arrays import Integers
from ctcr.errors import InputError, Problem
from ctcr.intake.choices import Choices
from ctcr.intake.log import Log
from ctcr.intake.mapping import MOVING
from ctcr.intake.names import LARGEST, Meaning, meaning
from ctcr.show.wording import join

_TOOLS = {"tool", "marker", "port", "body", "sensor", "probe", "coil"}
_LABELS = {"id", "no", "nr", "number", "name", "label", "rigid", "handle"}
_SHARED = (*MOVING, "t", "nsec")  # roles of columns that are the same for all tools


def unstacked(log: Log, choices: Choices) -> tuple[Log, Choices]:
    """The log with one row a time, and the choices that are left to make. Where tools have times of their own, or the
    user counts columns, only the rows of the sensor stay. Raises InputError where none is chosen."""
    taken = {log.find(name) for name in (*choices.ignore, *choices.columns.values())}
    column = next((i for i, name in enumerate(log.names) if i not in taken and _names_tools(log, i)), None)
    if column is None:
        return log, choices
    tool, name = _texts(log, column), log.names[column]
    by_position = any(said.startswith("#") for said in choices.columns.values())  # of the columns as they stand
    if not by_position and (time := _time(log, tool)) is not None:
        return _wide(log, column, tool, time), choices
    tools, asked = list(dict.fromkeys(tool.tolist())), (choices.sensor or "").lower()
    found = [one for one in tools if one.lower() == asked] or [one for one in tools if asked and asked in one.lower()]
    if len(found) != 1 or choices.relative_to:
        text = (
            f"holds {join(tools)} in rows of their own, which are not of one time: take those of one with --sensor NAME"
        )
        text += f", without --relative-to; if all are one tool, --ignore {name}"
        raise InputError(Problem(text, str(log.path), field=name))
    rows = np.flatnonzero(tool == found[0])
    values = tuple(one[rows] if isinstance(one, np.ndarray) else [one[i] for i in rows] for one in log.values)
    notes = [*log.notes, f"only the rows of {found[0]}, of {join(tools)}"]
    return replace(log, values=values, rows=log.rows[rows], notes=notes), choices.model_copy(update={"sensor": None})


def _names_tools(log: Log, column: int) -> bool:
    """Whether a column says whose pose a row holds: few names or small numbers, each in several rows, under a name such
    as tool or Port ID."""
    words = set(re.findall(r"[a-z]+|\d+", log.names[column].lower()))
    if log.is_stated or not words & _TOOLS or words - _TOOLS - _LABELS:
        return False
    values, counts = np.unique(_texts(log, column), return_counts=True)
    numbers = all(re.fullmatch(r"[-+\d.,e]+", value) for value in values)
    small = all(value.isdigit() and int(value) <= LARGEST for value in values)
    return len(values) > 1 and min(counts) > 1 and (small or not numbers)


def _texts(log: Log, column: int) -> np.ndarray:
    return np.char.strip(np.asarray(log.values[column]).astype(str))


def _meaning(log: Log, column: int) -> Meaning | None:
    name = log.names[column]
    return log.meanings[name] if name in log.meanings else meaning(name)


def _time(log: Log, tool: np.ndarray) -> Integers | None:
    """The number of each row's time (M,), by a column of times or frames that rows of several tools share: no tool is
    there twice, and joints do not move. None where there is none."""
    found = [_meaning(log, i) for i in range(len(log.names))]
    moving = [_texts(log, i) for i, one in enumerate(found) if one and one.role.rstrip("123456789") in MOVING]
    for i, one in enumerate(found):
        if one and one.role == "t" or "frame" in log.names[i].lower():
            stamps = _texts(log, i)
            time = np.cumsum(np.append(0, stamps[1:] != stamps[:-1]))
            first = np.unique(time, return_index=True)[1]
            alone = len(set(zip(time.tolist(), tool.tolist(), strict=True))) == len(tool) > len(first)
            if alone and all((values == values[first][time]).all() for values in moving):
                return time
    return None


def _wide(log: Log, column: int, tool: np.ndarray, time: Integers) -> Log:
    """A row a time. Columns of poses, and others that differ between tools, become one of each tool."""
    first = np.unique(time, return_index=True)[1]
    columns, meanings = {}, {}
    for i, name in enumerate(log.names):
        one, values, texts = _meaning(log, i), np.asarray(log.values[i]), _texts(log, i)
        if one and one.role.rstrip("123456789") in _SHARED or not one and (texts == texts[first][time]).all():
            columns[name] = values[first]
        elif i != column:
            for label in dict.fromkeys(tool.tolist()):
                mine = tool == label
                made = (
                    np.full(len(first), "", values.dtype) if values.dtype.kind == "U" else np.full(len(first), np.nan)
                )
                made[time[mine]] = values[mine]
                columns[f"{label}: {name}"] = made
                meanings[f"{label}: {name}"] = one and replace(one, marker=label)
    listed = tuple(made.tolist() if made.dtype.kind == "U" else made for made in columns.values())
    return replace(log, names=tuple(columns), values=listed, rows=log.rows[first], meanings=log.meanings | meanings)
