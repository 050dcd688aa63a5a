"""Text exports of makers' programs, recognised by their first lines: NDI ToolBox, OptiTrack Motive and LabVIEW.

The first two say themselves what each column holds, and hold no joints.
"""

import re
from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path

import numpy as np

from ctcr.errors import InputError, Problem
from ctcr.intake.log import Log, distinct
from ctcr.intake.names import Meaning
from ctcr.intake.units import Unit, named

_MM, _S, _DEG = named("mm"), named("s"), named("deg")
X_VALUE = Meaning("t", _S)  # LabVIEW's column of times
# roll about z, pitch about y, yaw about x of NDI: R = Rz Ry Rx
_NDI = {"q0": "qw", "qx": "qx", "qy": "qy", "qz": "qz", "tx": "x", "ty": "y", "tz": "z", "rx": "rx", "ry": "ry"}
_NDI |= {"rz": "rz", "state": "seen"}

Rows = list[tuple[int, list[str]]]  # number of the line in the file, from 1; fields


def reader_of(rows: Rows) -> Callable[[Path, Rows], Log] | None:
    """The reader of a file that a maker's program wrote, by the file's rows; None for other files."""
    first = next((fields for _, fields in rows if any(fields)), [])
    if first and first[0].strip().strip('"') == "Format Version":
        return _motive
    is_ndi = len(first) > 3 and first[0].strip() == "Tools" and re.match(r"Port\b", first[1].strip())
    return _ndi if is_ndi else None


def without_labview_headers(lines: list[str]) -> list[str]:
    """The lines of a file of LabVIEW with empty ones for its headers: one of the file, and one of each time it was
    written to. The units of the columns, which they state, are added to the names below them."""
    if not lines[0].startswith("LabVIEW Measurement"):
        return lines
    made, units, inside, tab = [], [], True, "\t" if "\t" in "".join(lines[:9]) else ","
    for line in lines:
        fields = line.split(tab)
        inside = inside or fields[0] == "Channels"
        units = fields if fields[0] == "Y_Unit_Label" else units
        if fields[0] == "X_Value":
            pairs = zip_longest(fields, units[: len(fields)], fillvalue="")
            line = tab.join(f"{name} [{unit}]" if named(unit) else name for name, unit in pairs)
        made.append("" if inside else line)
        inside = inside and fields[0] != "***End_of_Header***"
    return made


def _ndi(path: Path, rows: Rows) -> Log:
    """A group of columns a tool: its port and name, Frame, State, rotation, translation; then its single markers."""
    above = next(i for i, (_, fields) in enumerate(rows) if any(fields))
    header = [name.strip() for name in rows[above][1]]
    columns, marker, single = [], "", False
    for name in header:
        if name.startswith("Port"):
            marker, single = re.sub(r"\s+", " ", name), False
        label = f"{marker}: {name}" if marker and name != marker else name
        columns.append((label, None if single else _ndi_meaning(name, marker)))
        single = single or name == "Markers"
    return _log(path, "NDI ToolBox", columns, rows[above + 1 :], "ZYX", [])


def _ndi_meaning(name: str, marker: str) -> Meaning | None:
    lower = name.lower()
    if lower.startswith("time"):
        return Meaning("t", _S)
    role = _NDI.get(lower)
    unit = {"t": _MM, "r": _DEG}.get(lower[0]) if role and role != "seen" else None
    return Meaning(role, unit, marker) if role else None


def _motive(path: Path, rows: Rows) -> Log:
    """Rows of types, names and properties above the row of axes, which begins with Frame."""
    first = rows[0][1]
    about = dict(zip(first[::2], first[1::2], strict=False))
    at = next((i for i, (_, fields) in enumerate(rows) if fields and fields[0].strip() == "Frame"), None)
    length = named(about.get("Length Units", "Meters"))
    above = [] if at is None else [fields for _, fields in rows[1:at] if any(fields)]
    if at is None or len(above) < 3 or length is None:
        text = "is an export of Motive whose header is incomplete: export it with header information"
        raise InputError(Problem(text, str(path)))
    axes = rows[at][1]
    types, bodies, properties = (_wide(fields, len(axes)) for fields in (above[0], above[1], above[-1]))
    wanted = "Rigid Body" if "Rigid Body" in types else "Bone" if "Bone" in types else "Marker"
    euler = about.get("Rotation Type", "Quaternion").strip()
    columns = []
    for i, axis in enumerate(axis.strip() for axis in axes):
        name = " ".join(part for part in (bodies[i], properties[i], axis) if part) or f"#{i + 1}"
        is_used = i < 2 or types[i] == wanted
        columns.append((name, _motive_meaning(axis, properties[i], bodies[i], length) if is_used else None))
    notes = [f"recording started at {about['Capture Start Time']}"] if about.get("Capture Start Time") else []
    return _log(path, "OptiTrack Motive", columns, rows[at + 1 :], None if euler == "Quaternion" else euler, notes)


def _motive_meaning(axis: str, kind: str, body: str, length: Unit) -> Meaning | None:
    if axis.startswith("Time"):
        return Meaning("t", _S)
    if axis not in ("X", "Y", "Z", "W"):
        return None
    if kind == "Rotation":
        return Meaning(f"o{axis.lower()}", _DEG, body)
    return Meaning(axis.lower(), length, body) if kind == "Position" else None


def _wide(fields: list[str], width: int) -> list[str]:
    return [field.strip() for field in fields] + [""] * (width - len(fields))


def _log(path, kind, described, rows, euler, notes) -> Log:
    """The log of columns that each have a name and a meaning."""
    names, of_names = zip(*described, strict=True)
    meanings = dict(zip(distinct(names), of_names, strict=True))
    count, data = len(meanings), [(number, fields) for number, fields in rows if any(fields)]
    if not data:
        raise InputError(Problem("has no rows below the header", str(path)))
    padded = [[*fields, *[""] * (count - len(fields))][:count] for _, fields in data]
    numbers = np.array([number for number, _ in data], dtype=np.int64)
    columns = tuple(map(list, zip(*padded, strict=True)))
    return Log(path, kind, tuple(meanings), columns, numbers, False, meanings, euler, notes)
