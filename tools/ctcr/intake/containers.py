"""Logs in binary files: MATLAB's .mat, and MCAP with JSON messages as `ctcr export` writes it."""

import io
import json
import re
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake.log import Log

MAT5, HDF5, MCAP = b"MATLAB 5.0", b"MATLAB 7.3", b"\x89MCAP0\r\n"
_VECTORS = {"pos", "position", "positions", "p", "xyz", "tip", "sensor", "force", "f", "translation", "x"}
_TURNS = {"rpy", "euler", "angles", "angle", "rot", "rotation", "orientation", "joint", "joints", "tube", "tubes"}
_OURS = ("/joints", "/measurements")


def read_mat(path: Path, content: bytes) -> Log:
    """Variables, fields of structures and columns of matrices that share the length that most of them have."""
    if content.startswith(HDF5):
        text = "is a .mat file of version 7.3: save it in MATLAB with save(name, '-v7', ...) or as text"
        raise InputError(Problem(text, str(path)))
    try:
        variables = loadmat(io.BytesIO(content), simplify_cells=True)
    except Exception as error:  # the reader leaks all kinds of exceptions on damaged files
        raise InputError(Problem(f"is a damaged .mat file: {' '.join(str(error).split())}", str(path))) from None
    arrays = dict(_arrays("", {name: value for name, value in variables.items() if not name.startswith("__")}))
    lengths = Counter(size for array in arrays.values() for size in set(array.shape) if size > 4)
    if not lengths:
        hint = "a table of MATLAB is saved as s = table2struct(T, 'ToScalar', true); save(name, '-struct', 's')"
        raise InputError(Problem(f"holds no arrays of a common length ({hint})", str(path)))
    length = max(lengths, key=lambda size: (lengths[size], size))
    columns = dict(column for name, array in arrays.items() for column in _columns(name, array, length))
    other = [name for name, array in arrays.items() if length not in array.shape]
    notes = [f"not {length} values long, left out: {', '.join(other)}"] if other else []
    return Log(path, "MATLAB .mat", tuple(columns), tuple(columns.values()), np.arange(1, length + 1), notes=notes)


def _arrays(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """All arrays of numbers or texts, with the names of the structures that hold them."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _arrays(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim in (1, 2, 3):
        yield prefix, value
    elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "OU":
        if all(isinstance(item, str) for item in value):
            yield prefix, value
        elif value.size and all(isinstance(item, dict) for item in value):  # an array of structures: a row each
            for name in value[0]:
                parts = [np.atleast_1d(item.get(name, np.nan)) for item in value]
                if len({part.shape for part in parts}) == 1 and parts[0].dtype.kind in "fiub":
                    yield from _arrays(f"{prefix}.{name}", np.squeeze(np.stack(parts)))


def _columns(name: str, array: Any, length: int) -> Iterator[tuple[str, list[str] | Array]]:
    """One column, or those of a matrix: 1, 2, ..., or x, y, z of vectors; matrices along the third axis by rows."""
    if array.ndim == 3 and array.shape[2] == length and array.shape[0] in (3, 4):
        for i, row in enumerate(array, start=1):
            for j, values in enumerate(row, start=1):
                yield f"{name}_T{i}{j}", np.asarray(values, dtype=float)
        return
    if array.ndim == 3 or length not in array.shape:
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
            yield (name if matrix.shape[1] == 1 else f"{name}_{label}"), column


def read_mcap(path: Path, content: bytes) -> Log:
    """JSON messages; those of several channels at one time are one row."""
    try:
        make_reader = import_module("mcap.reader").make_reader
    except ModuleNotFoundError:
        text = 'needs the Python package mcap: install it with `pip install "ctcr[bench]"`'
        raise InputError(Problem(text, str(path))) from None
    rows: dict[int, dict[str, Any]] = {}
    skipped: Counter[str] = Counter()
    try:
        messages = list(make_reader(io.BytesIO(content)).iter_messages())
        ours = any(channel.topic in _OURS for _, channel, _ in messages)
        for _, channel, message in messages:
            if channel.message_encoding != "json" or ours and channel.topic not in _OURS:
                skipped[channel.topic] += 1
                continue
            rows.setdefault(message.log_time, {}).update(json.loads(message.data))
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(Problem(f"is a damaged MCAP file: {reason}", str(path))) from None
    if not rows:
        raise InputError(Problem("holds no JSON messages: export it with `ctcr export`, or as text", str(path)))
    ordered = [row for _, row in sorted(rows.items())]
    names = tuple(dict.fromkeys(name for row in ordered for name in row))
    values = tuple(["" if row.get(name) is None else str(row[name]) for row in ordered] for name in names)
    notes = [f"channel {topic}: {count} messages left out" for topic, count in skipped.items()]
    return Log(path, "MCAP", names, values, np.arange(1, len(ordered) + 1), notes=notes)
