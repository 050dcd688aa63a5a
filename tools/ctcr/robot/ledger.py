"""Writes a changed robot file: the comments, order and layout of the old one, the new values, and a ledger.

The ledger, `history`, holds an entry a change: its date, command and measurements, the old and the new value of each
field, and the error before and after. Old values are never lost.
"""

import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from datetime import date
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq

from ctcr.errors import InputError, Problem
from ctcr.inputs import fingerprint, open_input
from ctcr.robot import robot_file
from ctcr.robot.checks import path_text
from ctcr.robot.description import Robot
from ctcr.robot.yaml_document import FieldPath, YamlDocument
from ctcr.show.output import atomic_writer

_RECORDED = {"home_translation_mm": "recorded_home_translation_mm", "home_rotation_deg": "recorded_home_rotation_deg"}
_RECORDED_NOTE = "of the controller that recorded the tables; remove once it uses the homes above"


@dataclass(frozen=True)
class Change:
    """A number of the file, at a path such as ("tubes", 0, "length_mm") or ("tracker", "position_mm", 2), or a list,
    and its new value in the unit of that field, None where it is not known; `deviation` is its standard deviation, or a
    list, where known."""

    path: FieldPath
    unit: str
    new: float | list | None
    deviation: float | list[float] | None = None


@dataclass(frozen=True)
class Entry:
    """An entry of the ledger, but for the values. `figures`: numbers with the unit in the name, such as `rms_mm`."""

    command: str
    sources: Sequence[str | Path] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""


def write(
    robot: Robot,
    target: str | Path,
    changes: Sequence[Change],
    entry: Entry,
    *,
    effects: Mapping[str, Mapping[str, Any]] | None = None,
    in_place: bool = False,
) -> Robot:
    """Writes `robot` as `changed` makes it, and returns it.

    Raises InputError where the target is the file the robot came from and not `in_place`, and where the target cannot
    be used; nothing is written then.
    """
    source = robot._source
    if source and not in_place and os.path.realpath(target) == os.path.realpath(source.file):
        text = "is the input: choose another name, or permit the change (--in-place; in_place=True)"
        raise InputError(Problem(text, str(target)))
    updated = changed(robot, changes, entry, effects=effects, file=str(target))
    with _unchanged(source) if source and in_place else nullcontext(), atomic_writer(target) as file:
        file.write(updated._source.text)
    return updated


def changed(
    robot: Robot,
    changes: Sequence[Change],
    entry: Entry,
    *,
    effects: Mapping[str, Mapping[str, Any]] | None = None,
    file: str | None = None,
) -> Robot:
    """The robot with the changes and one more entry of the ledger, as if it had been read from a file.

    `effects` replaces that section; None leaves it. New homes leave the old ones as the recorded ones, so that tables
    keep their meaning. Raises InputError where the new values make no possible robot, or a source cannot be read.
    """
    file = file or robot.file or robot.name
    yaml, document = robot_file.layout(robot)
    rows = [_apply(document, change) for change in changes]
    if effects is not None:
        _set_effects(document, effects)
    document.setdefault("history", CommentedSeq()).append(_ledger_entry(entry, rows))
    text = robot_file.dumped(yaml, document, robot._source)
    try:
        return robot_file.parse(text.encode(), file)
    except InputError as error:
        found = [Problem(f"the new value {p.message}", file, field=p.field) for p in error.problems]
        raise InputError(found, error.omitted) from None


def section(entry: dict, *names: str) -> dict:
    """A section of an entry, or one within it; empty where it is none, as a file may be edited by hand."""
    for name in names:
        entry = entry[name] if isinstance(entry.get(name), dict) else {}
    return entry


@contextmanager
def _unchanged(source: YamlDocument) -> Iterator[None]:
    """Locks the file of a robot, so that two commands that change it do not overwrite each other's changes.

    Raises InputError where the file has changed since it was read.
    """
    with open_input(source.file) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        replaced = not os.path.samestat(os.fstat(file.fileno()), os.stat(source.file))
        if replaced or file.read().decode("utf-8-sig") != source.text:
            raise InputError(Problem("has changed since it was read: run the command again", source.file))
        yield


def _apply(document: CommentedMap, change: Change) -> CommentedMap:
    """Sets one value; returns its row of the ledger."""
    *parents, last = change.path
    parent = reduce(getitem, parents, document)
    old = parent.get(last) if isinstance(parent, dict) else parent[last]
    if change.path[0] == "actuation" and change.path[1] in _RECORDED:
        _keep_recorded(document["actuation"], change.path[1])
    parent[last] = _tidy(change.new)
    row = {"field": path_text(change.path), "unit": change.unit, "old": _plain(old), "new": _tidy(change.new)}
    if change.deviation is not None:
        each = change.deviation
        row["sd"] = [_shortest(sd, 3) for sd in each] if isinstance(each, list) else _shortest(each, 3)
    return _one_line(row)


def _keep_recorded(actuation: CommentedMap, key: str) -> None:
    """Keeps homes that are about to change as the recorded ones, unless there are such already."""
    kept = _RECORDED[key]
    if actuation.get(kept) is not None:
        return
    values = CommentedSeq(_plain(value) for value in actuation[key])
    values.fa.set_flow_style()
    # Above them: a comment below a field, such as that of the next section, belongs to the field.
    actuation.insert(list(actuation).index(key), kept, values, comment=_RECORDED_NOTE)


def _set_effects(document: CommentedMap, effects: Mapping[str, Mapping[str, Any]]) -> None:
    if not effects:
        document.pop("effects", None)
        return
    section = _tidy(effects)
    if "effects" in document or "history" not in document:
        document["effects"] = robot_file.updated(document.get("effects"), section)
    else:
        document.insert(list(document).index("history"), "effects", section)


def _ledger_entry(entry: Entry, rows: list[CommentedMap]) -> CommentedMap:
    made = CommentedMap(date=date.today().isoformat(), command=entry.command)
    if entry.sources:
        made["sources"] = [_one_line({"file": Path(path).name, "sha256": fingerprint(path)}) for path in entry.sources]
    if rows:
        made["changes"] = rows
    if entry.figures:
        made["figures"] = _tidy(entry.figures)
        made["figures"].fa.set_block_style()
    if entry.note:
        made["note"] = entry.note
    return made


def _tidy(value: Any) -> Any:
    """A value in the layout of the file: numbers of eight digits, lists and mappings of numbers on one line."""
    if isinstance(value, Mapping):
        made = CommentedMap({str(key): _tidy(each) for key, each in value.items()})
        if made and all(isinstance(each, int | float) for each in made.values()):
            made.fa.set_flow_style()
        return made
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        made = CommentedSeq(_tidy(each) for each in value)
        if not any(isinstance(each, Mapping) for each in value):
            made.fa.set_flow_style()
        return made
    return _shortest(value) if isinstance(value, float) else value


def _one_line(row: Mapping[str, Any]) -> CommentedMap:
    made = CommentedMap(row)
    made.fa.set_flow_style()
    return made


def _plain(value: Any) -> Any:
    """A value of the document without its layout."""
    if isinstance(value, list | dict):
        return _tidy(value)
    return float(value) if isinstance(value, float) else value


def _shortest(value: float, digits: int = 8) -> float:
    return float(f"{value:.{digits}g}")
