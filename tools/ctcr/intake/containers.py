"""Logs in files of named arrays: MATLAB's .mat, HDF5, .npz and .npy of numpy, and JSON."""

import io
import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from os.path import commonprefix
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake import hdf5
from ctcr.intake.log import Log
from ctcr.intake.names import RUN
from ctcr.show.wording import listed

MAT5, NPY = b"MATLAB 5.0", b"\x93NUMPY"
_VECTORS = {"pos", "position", "positions", "p", "xyz", "tip", "sensor", "force", "f", "translation", "x"}
_TURNS = {"rpy", "euler", "angles", "angle", "rot", "rotation", "orientation", "joint", "joints", "tube", "tubes"}
_SEVERAL = {"tube", "joint", "motor", "drive", "axis", "actuator", "stage", "marker", "sensor", "coil", "tracker"}
_SEVERAL |= {f"{part}s" for part in _SEVERAL} | {"axes", "body", "bodies"}  # of which a machine has several
_TABLE = "; a table of MATLAB is saved as s = table2struct(T, 'ToScalar', true); save(name, '-struct', 's')"


def read_mat(path: Path, content: bytes) -> Log:
    """A .mat file up to version 7."""
    try:
        variables = loadmat(io.BytesIO(content), simplify_cells=True)
    except Exception as error:  # the reader leaks all kinds of exceptions on damaged files
        raise InputError(Problem(f"is a damaged .mat file: {' '.join(str(error).split())}", str(path))) from None
    shown = {name: value for name, value in variables.items() if not name.startswith("__")}
    return _log(path, "MATLAB .mat", shown, [], _TABLE)


def read_hdf5(path: Path, content: bytes) -> Log:
    """A plain HDF5 file, or a .mat file of version 7.3."""
    matlab = content.startswith(hdf5.MATLAB)
    return _log(path, "MATLAB .mat" if matlab else "HDF5", *hdf5.arrays(path, content), _TABLE if matlab else "")


def read_numpy(path: Path, content: bytes) -> Log:
    """A .npz or .npy file. The columns of a single matrix have no names. Raises InputError where it is damaged."""
    try:
        loaded = np.load(io.BytesIO(content))
        arrays = {path.stem: loaded} if isinstance(loaded, np.ndarray) else {name: loaded[name] for name in loaded}
    except Exception as error:  # the reader leaks all kinds of exceptions on damaged files
        text = f"is damaged, or holds objects of Python: save its arrays with numpy.savez ({error})"
        raise InputError(Problem(text, str(path))) from None
    if isinstance(loaded, np.ndarray) and loaded.ndim == 2:
        arrays = {f"#{i}": column for i, column in enumerate(loaded.T, start=1)}
    return _log(path, "numpy", {name: hdf5.by_field(array) for name, array in arrays.items()}, [], "")


def read_json(path: Path, content: bytes) -> Log:
    """JSON: an object a reading, in a list or in lines of their own, or arrays that hold a value a reading."""
    lines = [(i, line) for i, line in enumerate(content.splitlines(), start=1) if line.strip()]
    is_lines = len(lines) > 1 and all(line.rstrip().endswith(b"}") for _, line in lines[:2])
    read: list[Any] = []
    for number, part in lines if is_lines else [(None, content)]:
        try:
            read.append(json.loads(part))
        except (ValueError, RecursionError) as error:
            raise InputError(Problem(f"is damaged JSON: {error}", str(path), number)) from None
    try:
        variables = dict(_flat("log", read if is_lines else read[0]))
    except ValueError:
        raise InputError(Problem("is JSON with lists in which lists of several lengths stand", str(path))) from None
    return _log(path, "JSON", variables, [], "; write an object a reading, or arrays that hold a value a reading")


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The values and arrays of an object, with the names of the objects that hold them; NaN for null."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        yield prefix, np.array([dict(_flat("", item)) for item in value], dtype=object)
    else:
        yield prefix, np.array(_known(value)) if isinstance(value, list) else _known(value)


def _known(value: Any) -> Any:
    if isinstance(value, list):
        return [_known(item) for item in value]
    return np.nan if value is None else value


@dataclass(frozen=True)
class _Table:
    """The columns of one length of some arrays, and the names of the arrays that are left out."""

    columns: dict[str, list[str] | Array]
    length: int
    left_out: list[str]

    def column(self, name: str) -> list[str] | Array:
        """A column; NaN where it is missing."""
        return self.columns.get(name, np.full(self.length, np.nan))


def _log(path: Path, kind: str, variables: dict[str, Any], left_out: list[str], hint: str) -> Log:
    """Variables, fields of structures and columns of matrices that share the length that most of them have; where
    structures or groups hold a run each, one run after the other."""
    arrays = dict(_arrays("", variables))
    runs, others = _runs(arrays)
    tables = {f"run {run}, ": _table(inside) for run, inside in runs.items()} or {"": _table(arrays)}
    names = list(dict.fromkeys(name for one in tables.values() for name in one.columns))
    if not names:
        held = "; ".join([listed(list(variables))] * bool(variables) + left_out) or "nothing"
        raise InputError(Problem(f"holds no arrays of a common length, but {held}{hint}", str(path)))
    columns = {name: _one_after_another([one.column(name) for one in tables.values()]) for name in names}
    notes = [*left_out]
    if runs:
        columns = {"run": np.repeat([*runs], [one.length for one in tables.values()])} | columns
        notes.append(f"a group is a run each: {listed([str(run) for run in runs])}")
        notes += [f"not in a group of a run, left out: {listed(others)}"] * bool(others)
    for run, one in tables.items():
        missing = [name for name in names if name not in one.columns]
        notes += [f"{run}not {one.length} values long, left out: {listed(one.left_out)}"] * bool(one.left_out)
        notes += [f"{run}missing: {listed(missing)}"] * bool(missing)
    count = sum(one.length for one in tables.values())
    return Log(path, kind, tuple(columns), tuple(columns.values()), np.arange(1, count + 1), notes=notes)


def _runs(arrays: dict[str, Any]) -> tuple[dict[int, dict[str, Any]], list[str]]:
    """The arrays of each run, without what names it, and the names of all others. Structures or groups such as run_1
    and run_2, or 1 and 2, are runs."""
    runs: dict[int, dict[str, Any]] = {}
    others = []
    for name, array in arrays.items():
        parts = name.split(".")
        numbers = [_number_of_run(group, parts[:k]) for k, group in enumerate(parts[:-1])]
        place = next((k for k, number in enumerate(numbers) if number is not None), None)
        if place is None:
            others.append(name)
        else:
            runs.setdefault(numbers[place], {})[".".join(parts[:place] + parts[place + 1 :])] = array
    return (dict(sorted(runs.items())), others) if len(runs) > 1 else ({}, [])


def _number_of_run(group: str, inside: list[str]) -> int | None:
    """The number of the run that the name of a group gives; a number alone counts parts of a robot or a tracker where
    the groups that hold it say so."""
    name, number = re.fullmatch(r"(.*?)[ _-]*(\d*)", group).groups()
    words = set(re.findall("[a-z]+", (name or " ".join(inside)).lower()))
    is_run = words & RUN if name else not words & _SEVERAL
    return int(number) if number and is_run else None


def _table(arrays: dict[str, Any]) -> _Table:
    """A structure or group that holds all columns is left out of their names: log_3 would say what none of them is."""
    lengths = Counter(size for array in arrays.values() for size in set(array.shape) if size > 4)
    if not lengths:
        return _Table({}, 0, list(arrays))
    length = max(lengths, key=lambda size: (lengths[size], size))
    used = [name for name, array in arrays.items() if length in array.shape]
    shared = sum(len(part) + 1 for part in commonprefix([name.split(".")[:-1] for name in used]))
    columns = dict(column for name in used for column in _columns(name[shared:], arrays[name], length))
    return _Table(columns, length, [name for name in arrays if name not in used])


def _one_after_another(parts: list[list[str] | Array]) -> list[str] | Array:
    if all(isinstance(part, np.ndarray) for part in parts):
        return np.concatenate(parts)
    return [str(value) for part in parts for value in part]


def _arrays(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """All arrays of numbers or texts, with the names of the structures that hold them."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _arrays(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, list) and all(isinstance(item, dict) for item in value):  # as scipy reads structures
        yield from _arrays(prefix, np.array(value, dtype=object))
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim in (1, 2, 3):
        yield prefix, value
    elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "OU":
        if all(isinstance(item, str) for item in value):
            yield prefix, value
        elif value.size and all(isinstance(item, dict) for item in value):  # an array of structures
            if _holds_columns(value[0]):  # a run each
                yield from _arrays(prefix, {str(number): item for number, item in enumerate(value, start=1)})
                return
            for name in dict.fromkeys(key for item in value for key in item):  # a row each
                parts = [np.atleast_1d(item.get(name, np.nan)) for item in value]
                size = max(part.shape for part in parts)
                parts = [np.full(size, np.nan) if _is_missing(part) else part for part in parts]
                if len({part.shape for part in parts}) == 1 and parts[0].dtype.kind in "fiubU":
                    yield from _arrays(f"{prefix}.{name}", np.squeeze(np.stack(parts)))


def _is_missing(part: Array) -> bool:
    return part.dtype.kind == "f" and part.shape == (1,) and bool(np.isnan(part[0]))


def _holds_columns(structure: dict[str, Any]) -> bool:
    """Whether most fields of a structure have one length, longer than the vectors of a reading: else it is a row."""
    sizes = Counter(_sizes(structure))
    return any(size > 4 and 2 * often > sizes.total() for size, often in sizes.items())


def _sizes(value: Any) -> Iterator[int]:
    """The longest side of each field; 0 of numbers and texts."""
    if isinstance(value, dict):
        for inner in value.values():
            yield from _sizes(inner)
    else:
        yield max(np.shape(value), default=0)


def _columns(name: str, array: Any, length: int) -> Iterator[tuple[str, list[str] | Array]]:
    """One column, or those of a matrix: 1, 2, ..., or x, y, z of vectors; matrices along the third axis by rows.

    A unit in brackets stays at the end of the name.
    """
    stem, bracket, inside = name.partition(" [")
    unit = bracket + inside
    if array.ndim == 3 and array.shape[2] == length and array.shape[0] in (3, 4):
        for i, row in enumerate(array, start=1):
            for j, values in enumerate(row, start=1):
                yield f"{stem}_T{i}{j}{unit}", np.asarray(values, dtype=float)
        return
    if array.ndim == 3:
        return
    if array.dtype.kind in "OU":
        yield name, [str(value) for value in array]
    elif array.ndim == 1:
        yield name, array
    else:
        matrix = array if array.shape[0] == length else array.T
        words = set(re.findall(r"[a-z]+", name.lower()))
        vector = matrix.shape[1] == 3 and words & _VECTORS and not words & _TURNS
        labels = list("xyz") if vector else range(1, matrix.shape[1] + 1)
        for label, column in zip(labels, matrix.T, strict=True):
            yield (name if matrix.shape[1] == 1 else f"{stem}_{label}{unit}"), column
