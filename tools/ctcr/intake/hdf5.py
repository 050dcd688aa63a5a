"""The arrays of an HDF5 file, by the names of their groups: a plain one, or MATLAB's .mat of version 7.3.

MATLAB stores arrays transposed, texts as numbers, and cells and arrays of structures as references to their parts; an
attribute of each dataset says its class. Its tables and other objects have a form that MATLAB alone knows.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake.packages import needed
from ctcr.intake.units import named

MATLAB, SIGNATURE = b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n"
_INNER = ("#refs#", "#subsystem#")  # groups in which MATLAB keeps parts of other variables


def arrays(path: Path, content: bytes) -> tuple[dict[str, Any], list[str]]:
    """The arrays of a file, those of a compound table by its fields, and what is left out, with reasons.

    Raises InputError where the file cannot be read.
    """
    h5py = needed("h5py", "h5py", "hdf5", path)
    found: dict[str, Any] = {}
    left_out: list[str] = []
    items: list[tuple[str, Any]] = []
    name, inner = None, _INNER
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            file.visititems(lambda *item: items.append(item))
            for place, item in items:
                if place.startswith(inner):
                    continue
                name = place.replace("/", ".")
                if "pandas_type" in item.attrs:
                    text = "is what pandas' to_hdf writes: read it with pandas.read_hdf, and save it with to_csv"
                    raise InputError(Problem(text, str(path), field=name))
                if _is_array_of_structures(h5py, item):
                    found[name], inner = _structures(h5py, item), (*inner, f"{place}/")
                    continue
                if not isinstance(item, h5py.Dataset) or item.shape is None:
                    continue
                if "MATLAB_object_decode" in item.attrs:
                    kind = item.attrs["MATLAB_class"].decode()
                    left_out.append(f"{name} is a {kind} of MATLAB: save it as numbers (docs/formats.md)")
                elif not _fits(item.shape):
                    shape = item.shape[::-1] if "MATLAB_class" in item.attrs else item.shape
                    left_out.append(f"{name} ({' x '.join(map(str, shape))}) is no column, vector or matrix a row")
                elif (value := _value(h5py, item)) is not None:
                    found[name + _unit(item)] = value
    except InputError:
        raise
    except Exception as error:  # the library raises all kinds of exceptions on damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        text = f"is damaged, or h5py cannot read it: {reason}"
        raise InputError(Problem(text, str(path), field=name)) from None
    return found, left_out


def _unit(item: Any) -> str:
    """The unit that an attribute of a dataset states, as names of columns hold it."""
    unit = item.attrs.get("units", item.attrs.get("unit"))
    return f" [{unit}]" if isinstance(unit, str) and named(unit) else ""


def _fits(shape: tuple[int, ...]) -> bool:
    """Whether columns can come of an array: a number, a vector or a small matrix a row. Pictures are not even read."""
    return len(shape) < 3 or len(shape) == 3 and set(sorted(shape)[:2]) <= {3, 4}


def _value(h5py: Any, item: Any) -> Any:
    """A dataset as an array of numbers or texts; a structure or a compound dataset as a dict of these; else None."""
    kind = item.attrs.get("MATLAB_class", b"").decode()
    if isinstance(item, h5py.Group):
        return {name: _value(h5py, part) for name, part in item.items()}
    if "MATLAB_empty" in item.attrs:
        return np.array("") if kind == "char" else None
    if _refers(h5py, item):
        return _joined([_value(h5py, item.file[part]) for part in item[()].ravel()])
    if h5py.check_string_dtype(item.dtype):
        return item.asstr(errors="replace")[()]
    value = item[()]
    if kind == "char":
        value = np.array([row.astype("<u2").tobytes().decode("utf-16-le", "replace") for row in value.T])
    return np.squeeze(value.T) if kind else by_field(np.asarray(value))


def _is_array_of_structures(h5py: Any, item: Any) -> bool:
    """Whether a group is an array of structures of MATLAB: each field refers to its values, one a structure."""
    return (
        isinstance(item, h5py.Group)
        and item.attrs.get("MATLAB_class") == b"struct"
        and len(item) > 0
        and all(_refers(h5py, field) and "MATLAB_class" not in field.attrs for field in item.values())
    )


def _structures(h5py: Any, group: Any) -> Array:
    """The structures of such an array, each a dict of its fields."""
    columns = [[_value(h5py, group.file[part]) for part in field[()].ravel()] for field in group.values()]
    return np.array([dict(zip(group, row, strict=True)) for row in zip(*columns, strict=True)], dtype=object)


def _refers(h5py: Any, item: Any) -> bool:
    return isinstance(item, h5py.Dataset) and h5py.check_ref_dtype(item.dtype) is h5py.Reference


def _joined(parts: list[Any]) -> Array | None:
    """The parts of a cell as rows: texts, numbers of one shape, structures; else None."""
    if all(isinstance(part, dict) for part in parts):
        return np.array(parts, dtype=object)
    if any(not isinstance(part, np.ndarray) for part in parts):
        return None
    if len({(part.shape, part.dtype.kind == "U") for part in parts}) > 1:
        return None
    return np.squeeze(np.stack(parts))


def by_field(value: Any) -> Any:
    """A compound array by its fields; matrices along the first axis, as Python has them, go along the last one."""
    if value.dtype.names:
        return {name: by_field(value[name]) for name in value.dtype.names}
    if value.dtype.kind == "M":
        return value.astype(str)  # times as ISO texts
    if value.dtype.kind in "SO":
        return np.frompyfunc(lambda one: one.decode(errors="replace") if isinstance(one, bytes) else one, 1, 1)(value)
    return np.moveaxis(value, 0, 2) if value.ndim == 3 and set(value.shape[1:]) <= {3, 4} else value
