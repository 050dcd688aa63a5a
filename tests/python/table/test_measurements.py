"""The table of measurements: exact values back, every planted fault with its row, and tables of any size."""

import io

import numpy as np
import pytest
from ctcr.errors import InputError
from ctcr.table import csv_table, measurements
from ctcr.table.measurements import group_columns

OPTIONAL = ("t", "run", "force", "position", "quaternion")


def random_table(rng, rows: int, n_tubes: int, groups=OPTIONAL) -> dict[str, np.ndarray]:
    """A valid table, by groups of columns."""
    quaternion = rng.normal(size=(rows, 4))
    everything = {
        "t": np.arange(rows, dtype=float)[:, None],
        "run": np.sort(rng.integers(0, 3, (rows, 1)), axis=0).astype(float),
        "beta": -np.sort(rng.uniform(0.01, 0.4, (rows, n_tubes)))[:, ::-1],
        "alpha": rng.uniform(-7, 7, (rows, n_tubes)),
        "force": rng.normal(size=(rows, 3)),
        "position": rng.uniform(-0.3, 0.3, (rows, 3)),
        "quaternion": quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
    }
    return {name: everything[name] for name in everything if name in (*groups, "beta", "alpha")}


def as_text(table: dict[str, np.ndarray], n_tubes: int, end: str = "\n", order=None) -> str:
    names = [column for group in table for column in group_columns(n_tubes)[group]]
    numbers = np.hstack(list(table.values()))
    order = range(len(names)) if order is None else order
    lines = [",".join(names[i] for i in order)]
    lines += [",".join("" if np.isnan(row[i]) else repr(float(row[i])) for i in order) for row in numbers]
    return end.join(lines) + end


@pytest.fixture
def load(tmp_path):
    def load(text: str | bytes, n_tubes: int = 3):
        path = tmp_path / "table.csv"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return measurements.load(path, n_tubes)

    return load


@pytest.fixture
def faults(load):
    def faults(text: str | bytes, n_tubes: int = 3) -> list:
        with pytest.raises(InputError) as caught:
            load(text, n_tubes)
        return list(caught.value.problems)

    return faults


@pytest.mark.parametrize("block", [64, 1000, csv_table.BLOCK_BYTES])
def test_round_trip(load, monkeypatch, block):
    """Numbers are read exactly as they were written, for any block size."""
    monkeypatch.setattr(csv_table, "BLOCK_BYTES", block)
    rng = np.random.default_rng(3)
    for _ in range(30):
        n_tubes, rows = int(rng.integers(1, 5)), int(rng.integers(1, 40))
        table = random_table(rng, rows, n_tubes, [name for name in OPTIONAL if rng.random() < 0.6])
        for name in {"t", "position", "quaternion"} & set(table):
            table[name][rng.random(rows) < 0.2] = np.nan
        width = sum(values.shape[1] for values in table.values())
        text = as_text(table, n_tubes, rng.choice(["\n", "\r\n"]), rng.permutation(width))
        text = ("\ufeff" if rng.random() < 0.3 else "") + text + "\n" * int(rng.integers(0, 3))
        read = load(text, n_tubes)
        assert len(read) == rows and read.row.tolist() == list(range(2, rows + 2))
        for name, absent in (("position", None), ("quaternion", None), ("force", np.zeros((rows, 3)))):
            expected = table.get(name, absent)
            if expected is None:
                assert getattr(read, name) is None
            else:
                np.testing.assert_allclose(getattr(read, name), expected, rtol=1e-15)
        for name in ("beta", "alpha"):
            np.testing.assert_array_equal(getattr(read, name), table[name])
            assert getattr(read, name).flags.c_contiguous
        np.testing.assert_array_equal(read.run, table["run"][:, 0] if "run" in table else 0)
        np.testing.assert_array_equal(read.t, table["t"][:, 0] if "t" in table else np.nan)


PLANTED = [
    ("beta1_m", "-300.5", "is this mm?", "beta1_m"),
    ("beta3_m", "0.2", "must be <= 0 m", "beta3_m"),
    ("beta1_m", "-0.001", "joints out of order", "beta1_m"),
    ("beta2_m", "", "is empty: needs a number in m", "beta2_m"),
    ("beta2_m", "nan", "is not a number", "beta2_m"),
    ("alpha2_rad", "ten", "'ten' is not a number", "alpha2_rad"),
    ("alpha2_rad", "1e999", "is not finite: needs a number in rad", "alpha2_rad"),
    ("alpha3_rad", "inf", "is not a number", "alpha3_rad"),
    ("alpha3_rad", "1_000", "is not a number", "alpha3_rad"),
    ("alpha3_rad", "\u0661", "is not a number", "alpha3_rad"),
    ("fx_N", "", "is empty: needs a number in N", "fx_N"),
    ("fy_N", '"1.0"', "without quotes", "fy_N"),
    ("run", "1.5", "is not a whole number", "run"),
    ("run", "", "is empty", "run"),
    ("t_s", "-", "leave the field empty", "t_s"),
    ("x_m", "120", "is this mm?", "x_m"),
    ("y_m", "", "fill in all or none", "x_m..z_m"),
    ("qx", "", "fill in all or none", "qw..qz"),
    ("qw", "3.0", "quaternion of norm", "qw..qz"),
    ("z_m", "0.1,0.2", "has 19 fields: the header has 18", None),
]


@pytest.mark.parametrize("column, value, message, field", PLANTED)
def test_fault(faults, monkeypatch, column, value, message, field):
    """A planted fault is reported with its row and column."""
    monkeypatch.setattr(csv_table, "BLOCK_BYTES", 700)
    rng = np.random.default_rng(11)
    for _ in range(5):
        lines = as_text(random_table(rng, 25, 3), 3).splitlines()
        row = int(rng.integers(2, 27))
        fields = lines[row - 1].split(",")
        fields[lines[0].split(",").index(column)] = value
        lines[row - 1] = ",".join(fields)
        (problem,) = faults("\n".join(lines))
        assert (problem.line, problem.field) == (row, field)
        assert message in problem.message and "table.csv, row" in str(problem)


def test_all_faults(load):
    """Faults of all kinds are reported together and counted."""
    rng = np.random.default_rng(5)
    lines = as_text(random_table(rng, 500, 3), 3).splitlines()
    column = lines[0].split(",").index("alpha1_rad")
    lines[3] = ""
    unreadable = sorted(rng.choice(np.arange(10, 400), 150, replace=False))
    for row, index, value in [*((row, column, "x") for row in unreadable), (450, column + 1, "1e999")]:
        fields = lines[row - 1].split(",")
        fields[index] = value
        lines[row - 1] = ",".join(fields)
    with pytest.raises(InputError) as caught:
        load("\n".join(lines))
    problems, omitted = caught.value.problems, caught.value.omitted
    assert len(problems) + omitted == 152
    expected = [(4, None), *((row, "alpha1_rad") for row in unreadable[:3]), (450, "alpha2_rad")]
    assert [(problem.line, problem.field) for problem in problems] == expected


@pytest.mark.parametrize(
    "change, field, message",
    [
        (lambda h: h.replace("beta1_m", "beta1_mm"), "beta1_mm", "did you mean beta1_m? Columns are in SI units"),
        (lambda h: h.replace("alpha2_rad", "alfa2_rad"), "alfa2_rad", "did you mean alpha2_rad?"),
        (lambda h: h.replace("qz", "colour"), "colour", "unknown column"),
        (lambda h: h.replace("qz", "colour"), "qz", "come together"),
        (lambda h: h.replace("beta3_m", "beta4_m"), "beta4_m", "the robot has 3 tubes"),
        (lambda h: h.replace("fx_N", "fy_N"), "fy_N", "more than once"),
        (lambda h: h.replace("alpha1_rad,", ""), "alpha1_rad", "missing: the robot has 3 tubes"),
        (lambda h: h + ",", "(no name)", "unknown column"),
    ],
)
def test_header(faults, change, field, message):
    """Each fault of the header is named with its column."""
    header, rest = as_text(random_table(np.random.default_rng(1), 3, 3), 3).split("\n", 1)
    assert any(p.field == field and message in p.message and p.line == 1 for p in faults(change(header) + "\n" + rest))


def test_log_of_another_form(faults):
    """What has no joints as the format names them gets one advice, not a fault a column."""
    (found,) = faults("tiempo (s),avance 1,avance 2,avance 3,giro 1,giro 2,giro 3,x,y,z\n" + ",".join("1" * 10))
    assert found.line == 1 and "beta1_m to alpha3_rad: if it is a log, ctcr import" in found.message


@pytest.mark.parametrize("table_tubes, robot_tubes", [(3, 2), (2, 3)])
def test_other_robot(faults, table_tubes, robot_tubes):
    """A table of a robot with another number of tubes."""
    text = as_text(random_table(np.random.default_rng(1), 3, table_tubes), table_tubes)
    assert all(f"the robot has {robot_tubes} tubes" in problem.message for problem in faults(text, robot_tubes))


HEADER = ",".join(name for names in group_columns(1).values() for name in names)


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "is empty"),
        (b"\n\n", "empty first row"),
        (HEADER.encode(), "no rows below the header"),
        (HEADER.encode() + b"\n\r\n\n", "no rows below the header"),
        (b"1,2,3\n4,5,6\n", "no header"),
        (HEADER.replace(",", ";").encode() + b"\n1;2\n", "use commas, and points for decimals (ctcr import"),
        (HEADER.replace("x_m", '"x_m"').encode() + b"\n1,2\n", "without (ctcr import"),
        (HEADER.encode("utf-16") + b"\n", "UTF-16"),
        (HEADER.encode() + b"\r1,2\r", "LF or CR LF"),
        (b"PK\x03\x04garbage", "spreadsheet"),
        (bytes(range(256)), "not text"),
        (b"\x89PNG\r\n\x1a\n", "not text"),
        (b"beta1_m" * 20000, "first row without end"),
    ],
)
def test_other_files(faults, content, message):
    """A file that is no table is one clear sentence."""
    (problem,) = faults(content, 1)
    assert message in problem.message and "\n" not in str(problem)


def test_robot_file(tmp_path):
    """A robot file given as a table is called one."""
    path = tmp_path / "robot.yaml"
    path.write_text("name: mine\ntubes: []\n")
    with pytest.raises(InputError, match="is a robot file, not a table") as caught:
        measurements.read(path)
    assert len(caught.value.problems) == 1


def test_binary(faults):
    """Bytes that are no text are faults of their lines."""
    problems = faults(HEADER.encode() + b"\n" + bytes(range(256)), 1)
    assert problems and all(problem.line >= 2 for problem in problems)


def test_warnings(load):
    """Time that runs backwards and interrupted runs are warnings."""
    table = random_table(np.random.default_rng(2), 6, 2)
    table["run"][:, 0] = [0, 0, 0, 1, 1, 0]
    table["t"][:, 0] = [0, 2, 1, 0, 1, 9]
    late, split = load(as_text(table, 2), 2).warnings
    assert (late.line, late.field) == (4, "t_s")
    assert "stand together" in split.message


def test_rounded_joints(load, faults):
    """Joints may be out of order by their rounding, and no more."""
    table = random_table(np.random.default_rng(2), 1, 2)
    for excess, good in ((0.5e-6, True), (2e-6, False)):
        table["beta"][0] = [-0.1 + excess, -0.1]
        (load if good else faults)(as_text(table, 2), 2)


def test_memory(load):
    """Reading a long table needs little more memory than its numbers."""
    import tracemalloc

    rng = np.random.default_rng(0)
    once = as_text(random_table(rng, 2000, 3, ("position",)), 3)
    header, body = once.split("\n", 1)
    text = (header + "\n" + body * 25).encode()  # 50 000 rows, several blocks
    tracemalloc.start()
    read = load(io.BytesIO(text).getvalue())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    numbers = read.beta.nbytes + read.alpha.nbytes + read.position.nbytes
    assert len(read) == 50_000
    assert peak < 3 * numbers + 20 * csv_table.BLOCK_BYTES


@pytest.mark.parametrize("group", ["beta", "alpha", "force", "position"])
def test_beyond_any_unit(tmp_path, group):
    """A value that is usual in no unit is a fault of its row: no other convention is tried on it, which would overflow.
    One that another unit makes usual is kept, with the refusal."""
    for value, kept in ((1e300, False), (-4e4, True)):
        table = random_table(np.random.default_rng(1), 5, 2)
        table[group][3, 0] = value
        path = tmp_path / "table.csv"
        path.write_text(as_text(table, 2))
        if kept:
            assert measurements.read(path).refusal is not None
            continue
        with pytest.raises(InputError) as caught:
            measurements.read(path)
        assert [(problem.line, problem.field) for problem in caught.value.problems] == [(5, group_columns(2)[group][0])]
