"""HDF5 files: plain ones, and MATLAB's .mat of version 7.3, which the tests write as MATLAB does."""

import sys

import numpy as np
import pytest

h5py = pytest.importorskip("h5py", reason="h5py is not installed")

MATLAB_CLASS = {"f": "double", "u": "uint16", "i": "int32", "b": "logical"}


class Cell(list):
    """A cell array of MATLAB."""


def put_matlab(group, name: str, value) -> None:
    """Writes a variable as MATLAB's save -v7.3: a dict is a structure, a list of dicts an array of structures, a text
    a char array."""
    if isinstance(value, dict):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, part in value.items():
            put_matlab(inner, field, part)
    elif isinstance(value, Cell):
        _put_references(group, name, value).attrs["MATLAB_class"] = np.bytes_("cell")
    elif isinstance(value, list):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        for field in value[0]:
            _put_references(inner, field, [one[field] for one in value])
    elif isinstance(value, str):
        letters = np.frombuffer(value.encode("utf-16-le"), "<u2")
        empty = np.array([0, 0], np.uint64)
        data = group.create_dataset(name, data=letters[:, None] if value else empty)
        data.attrs.update({"MATLAB_class": np.bytes_("char"), "MATLAB_int_decode": 2})
        if not value:
            data.attrs["MATLAB_empty"] = 1
    else:
        value = np.asarray(value)
        matrix = value[:, None] if value.ndim == 1 else np.atleast_2d(value)
        data = group.create_dataset(name, data=matrix.T)
        data.attrs["MATLAB_class"] = np.bytes_(MATLAB_CLASS[value.dtype.kind])


def _put_references(group, name: str, parts: list):
    inner = group.file.require_group("#refs#")
    references = []
    for part in parts:
        place = f"r{len(inner)}"
        put_matlab(inner, place, part)
        references.append(inner[place].ref)
    return group.create_dataset(name, data=np.array(references, h5py.ref_dtype)[:, None])


def matlab(path, variables: dict):
    """A .mat file of version 7.3: MATLAB's text in front of the HDF5 file."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put_matlab(file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\0\2IM")
    return path


def hdf5(path, items: dict, units: dict | None = None):
    """A plain HDF5 file of datasets, a slash for a group; `units` become attributes."""
    with h5py.File(path, "w") as file:
        for name, value in items.items():
            file[name] = value
        for name, unit in (units or {}).items():
            file[name].attrs["units"] = unit
    return path


def matrices(truth):
    """Poses as matrices (24, 4, 4)."""
    made = np.tile(np.eye(4), (24, 1, 1))
    made[:, :3, :3], made[:, :3, 3] = truth.rotation.as_matrix(), truth.position
    return made


def test_matlab_structure(truth, tmp_path, imported, same):
    """A structure of vectors and matrices, and 4 x 4 matrices along the third axis; others are left out and said."""
    log = {"time": truth.t, "beta": 1e3 * truth.beta, "alpha": truth.alpha, "T": np.moveaxis(matrices(truth), 0, 2)}
    path = matlab(tmp_path / "log.mat", {"log": log, "gain": 3.0, "notes": "first try", "limits": np.arange(7.0)})
    table, said = imported(path, "--unit", "alpha=rad")
    same(table)
    assert "MATLAB" in said and "not 24 values long, left out: limits" in said


@pytest.mark.parametrize("as_cell", [False, True])
def test_matlab_structures_and_cells(truth, tmp_path, imported, same, as_cell):
    """An array, or a cell, of structures is a row each; a cell of texts is a column, with empty ones in it."""
    rows = zip(truth.t, truth.beta, truth.alpha, truth.position, strict=True)
    log = [{"t": t, "beta": beta, "alpha": alpha, "pos": place} for t, beta, alpha, place in rows]
    states = ["ok"] * 24
    states[3], states[5] = "lost", ""
    variables = {"log": Cell(log) if as_cell else log, "state": Cell(states)}
    table, said = imported(matlab(tmp_path / "log.mat", variables))
    seen = np.isfinite(table.position).all(axis=1)
    assert np.flatnonzero(~seen).tolist() == [3, 5] and "state" in said
    table.position[~seen] = truth.position[~seen]
    same(table, orientation=False)


def test_matlab_rows_of_long_vectors(truth, tmp_path, imported, same):
    """Structures with vectors of a pose, and a text, are a row each, not a run of seven rows each."""
    pose = np.column_stack([truth.position, truth.rotation.as_quat()])
    rows = zip(truth.t, truth.beta, truth.alpha, pose, strict=True)
    log = [{"t": t, "beta": beta, "alpha": alpha, "tip": tip, "state": "ok"} for t, beta, alpha, tip in rows]
    columns = ("x", "y", "z", "qx", "qy", "qz", "qw")
    options = [word for i, role in enumerate(columns, 1) for word in ("--column", f"{role}=tip_{i}")]
    table, _ = imported(matlab(tmp_path / "log.mat", {"log": log}), *options)
    same(table)


def test_matlab_table(truth, tmp_path, refused, imported):
    """What only MATLAB reads is named, with what to do: alone it is a fault, beside arrays a note."""
    path = matlab(tmp_path / "log.mat", {"gain": 3.0, "T": np.arange(6, dtype=np.uint16)})
    with h5py.File(path, "r+") as file:
        file["T"].attrs.update({"MATLAB_class": np.bytes_("table"), "MATLAB_object_decode": 3})
    error = refused(path)
    assert "T is a table of MATLAB" in error and "table2struct" in error and "gain" in error
    with h5py.File(path, "r+") as file:
        for name, value in {"t": truth.t, "beta": truth.beta, "alpha": truth.alpha, "pos": truth.position}.items():
            put_matlab(file, name, value)
    assert "T is a table of MATLAB" in imported(path)[1]


def test_groups(truth, tmp_path, imported, same):
    """Datasets in groups, matrices along the first axis, units as attributes; pictures are left out and said."""
    items = {
        "robot/time": 1e3 * truth.t,
        "robot/beta": 1e6 * truth.beta,
        "robot/alpha": np.rad2deg(truth.alpha),
        "tracker/T": matrices(truth),
        "camera/image": np.zeros((24, 8, 9), np.uint8),
        "about": "first try",
    }
    units = {"robot/time": "ms", "robot/beta": "um", "robot/alpha": "deg"}
    table, said = imported(hdf5(tmp_path / "log.h5", items, units))
    same(table)
    assert "camera.image (24 x 8 x 9)" in said


@pytest.mark.parametrize("how", ["groups", "matlab", "structures"])
def test_runs(truth, tmp_path, imported, same, how):
    """A group, or a structure, for each run, of different lengths: one run after the other, in the order of their
    numbers. What one run lacks is missing there."""
    parts = {2: slice(0, 7), 10: slice(7, 24)}
    logs = {
        run: {"time": truth.t[part], "beta": truth.beta[part], "alpha": truth.alpha[part], "pos": truth.position[part]}
        for run, part in parts.items()
    }
    if how == "groups":
        items = {f"data/run_{run}/{name}": value for run, log in logs.items() for name, value in log.items()}
        table, said = imported(hdf5(tmp_path / "log.h5", items | {"limits": np.arange(7.0)}))
        assert "left out: limits" in said
    elif how == "matlab":
        table, said = imported(matlab(tmp_path / "log.mat", {f"trial{run}": log for run, log in logs.items()}))
    else:
        table, said = imported(matlab(tmp_path / "log.mat", {"trials": list(logs.values())}))
    same(table, orientation=False)
    assert np.bincount(table.run).tolist()[-1] == 17 and np.sum(table.run == table.run[0]) == 7
    del logs[2]["pos"]
    items = {f"run_{run}/{name}": value for run, log in logs.items() for name, value in log.items()}
    table, said = imported(hdf5(tmp_path / "log.h5", items))
    assert np.isnan(table.positions).all(axis=1).tolist() == [True] * 7 + [False] * 17
    assert "run 2, missing: pos_x" in said


@pytest.mark.parametrize("group", ["tube{}", "tubes/{}", "robot/tube_{}", "motor/{}"])
def test_tubes_are_no_runs(truth, tmp_path, imported, same, group):
    """Groups of tubes have numbers too: their arrays stand side by side."""
    items = {"t": truth.t, "pos": truth.position}
    for i in range(2):
        items |= {f"{group.format(i + 1)}/{name}": getattr(truth, name)[:, i] for name in ("beta", "alpha")}
    same(imported(hdf5(tmp_path / "log.h5", items))[0], orientation=False)


def test_compound_table(truth, tmp_path, imported, same):
    """A table of h5py: fields with names, vectors among them, and texts."""
    fields = [("t", float), ("beta", float, 2), ("alpha", float, 2), ("pos", float, 3), ("state", "S4")]
    data = np.zeros(24, fields)
    data["t"], data["beta"], data["alpha"], data["pos"] = truth.t, truth.beta, truth.alpha, truth.position
    data["state"], data["state"][4] = b"ok", b"lost"
    table, _ = imported(hdf5(tmp_path / "log.hdf5", {"run_1/table": data}))
    assert np.isnan(table.position[4]).all()
    table.position[4] = truth.position[4]
    same(table, orientation=False)


def test_pandas(truth, tmp_path, refused):
    """Frames of pandas are refused with the way round, as pandas marks them: a group with an attribute."""
    path = hdf5(tmp_path / "log.h5", {"frame/block0_values": truth.beta})
    with h5py.File(path, "r+") as file:
        file["frame"].attrs["pandas_type"] = np.bytes_("frame")
    assert "to_csv" in (error := refused(path)) and "frame" in error


def test_unsuitable(tmp_path, refused):
    """Damaged, empty and other files are refused with the names of what they hold."""
    ragged = np.array([np.arange(2.0), np.arange(3.0)], dtype=object)
    path = hdf5(tmp_path / "log.h5", {"gain": 3.0, "about/robot": "the first"})
    with h5py.File(path, "r+") as file:
        file.create_dataset("ragged", data=ragged, dtype=h5py.vlen_dtype(float))
    assert "gain" in (error := refused(path)) and "about.robot" in error
    whole = path.read_bytes()
    for content in (whole[: len(whole) // 2], b"MATLAB 7.3 MAT-file" + bytes(2000)):
        path.write_bytes(content)
        assert "is damaged" in refused(path)
    assert "nothing" in refused(hdf5(tmp_path / "empty.h5", {}))
    assert "looks like a joint" in (error := refused(hdf5(tmp_path / "other.h5", {"volts": np.arange(9.0)})))
    assert "volts" in error


def test_any_damage(truth, tmp_path, log, run):
    """Wherever a byte is wrong, the file is read or refused: nothing else happens."""
    whole = hdf5(tmp_path / "log.h5", {"t": truth.t, "beta": truth.beta, "alpha": truth.alpha}).read_bytes()
    rng = np.random.default_rng(5)
    for place in rng.integers(8, len(whole), 60):
        content = bytearray(whole)
        content[place] ^= int(rng.integers(1, 256))
        assert run("import", log(bytes(content), "bad.h5"), "-o", tmp_path / "out.csv")[0] in (0, 1, 2)


def test_without_the_package(truth, tmp_path, refused, monkeypatch):
    """Without h5py the error names the extra to install."""
    path = hdf5(tmp_path / "log.h5", {"t": truth.t})
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert 'pip install "ctcr[hdf5]"' in refused(path)
