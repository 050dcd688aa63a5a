"""Recordings without hardware: rows survive kills and power cuts, plans are checked before moves."""

import io
import json
import multiprocessing
import os
import random
import signal
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import cli, compare
from ctcr.bench.devices import bench_file
from ctcr.bench.devices.person import Person
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.record.display import picture
from ctcr.bench.record.folder import Folder
from ctcr.bench.record.live_page import SHOWN, LivePage, page
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.record.session import Approach, Progress, Session, steps_of
from ctcr.commands.options import with_effects
from ctcr.compare import summary
from ctcr.errors import InputError
from ctcr.model import simulation
from ctcr.robot import robot_file
from ctcr.table import measurements
from ctcr.table.measurements import column_names

ROOT = Path(__file__).parents[3]
DATA = ROOT / "examples" / "data"
COLUMNS = 2 + 2 * 2 + 3 + 7  # of two tubes


def rows_of(number, group):
    """The rows of one group: t_s counts, the last field is not measured."""
    return [np.array([number * group + i, number, *range(COLUMNS - 3), np.nan]) for i in range(group)]


@pytest.mark.parametrize("hidden", [["friction.coefficient=0.02"], []])
def test_first_plan(hidden):
    """The plan of the first session shows friction as hysteresis, as docs/hardware.md says, and none else."""
    robot = robot_file.load(DATA / "demo" / "robot.yaml")
    plan = measurements.load(DATA / "bench" / "plan.csv", robot.n_tubes)
    readings = simulation.simulate(with_effects(robot, hidden), plan)
    found = [one.text for one in summary.findings(compare(robot, readings))]
    assert any("There is hysteresis" in text and "friction" in text for text in found) == bool(hidden)


def _append_for_ever(path, group, pipe):
    file = RowFile(path, column_names(2), group)
    while True:
        file.append(rows_of(file.groups, group))
        pipe.send(file.groups)


def test_kills(tmp_path):
    """SIGKILL at random moments: every row that was reported as written is in the file, whole, once, in order."""
    context, rng, group = multiprocessing.get_context("fork"), random.Random(1), 3
    path, reported = tmp_path / "measurements.csv", 0
    for _ in range(100):
        ours, theirs = context.Pipe()
        process = context.Process(target=_append_for_ever, args=(path, group, theirs))
        process.start()
        theirs.close()
        reported = ours.recv()
        time.sleep(rng.uniform(0, 0.01))
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        try:
            while True:
                reported = ours.recv()
        except EOFError:
            pass
        lines = path.read_text().splitlines()[1:]
        assert len(lines) >= reported * group
        assert [int(float(line.split(",")[0])) for line in lines] == list(range(len(lines)))
    assert reported >= 100  # each process has written one at least


@pytest.mark.parametrize("cut", [1, 20, 70, 150])
def test_power_cut(tmp_path, cut):
    """A power cut loses the group of rows that was being written, and no other."""
    path = tmp_path / "measurements.csv"
    file = RowFile(path, column_names(2), 2)
    for number in range(5):
        file.append(rows_of(number, 2))
    file.close()
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    again = RowFile(path, column_names(2), 2)
    assert 2 <= again.groups < 5 and float(again.last[0]) == 2 * again.groups - 1
    while again.groups < 5:
        again.append(rows_of(again.groups, 2))
    again.close()
    assert path.read_bytes() == whole


def test_foreign_table(tmp_path):
    """A file with other columns is refused and left alone."""
    path = tmp_path / "measurements.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="other columns"):
        RowFile(path, column_names(2))
    assert path.read_text() == "a,b\n1,2\n"


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (b"late" + b",0" * 15, "row 2, t_s: 'late' is not a number"),
        (b"nan" + b",0" * 15, "row 2, t_s: 'nan' is not a number"),
        (b"1,\xff" + b",0" * 14, "row 2: is not text in UTF-8"),
        (b"", "row 2: has 0 fields: the header has 16"),
    ],
)
def test_damaged_last_row(tmp_path, row, words):
    """It is named with what to do."""
    path = Folder(tmp_path / "out", {}, {}, 2).path / "measurements.csv"
    path.write_bytes(path.read_bytes() + row + b"\n")
    with pytest.raises(InputError, match=f"measurements.csv, {words}: correct or remove it"):
        Folder(tmp_path / "out", {}, {}, 2)


def test_full_disk(tmp_path, monkeypatch):
    """No half of a group stays, and what was there before does."""
    path = tmp_path / "measurements.csv"
    file = RowFile(path, column_names(2))
    file.append(rows_of(0, 1))
    before, write = path.read_bytes(), os.pwrite

    def half(handle, data, place):
        write(handle, data[: len(data) // 2], place)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", half)
    with pytest.raises(InputError, match="no space left on device"):
        file.append(rows_of(1, 1))
    monkeypatch.undo()
    assert path.read_bytes() == before and file.groups == 1
    file.append(rows_of(1, 1))
    assert path.read_bytes().startswith(before) and file.groups == 2


def test_table_of_rows(tmp_path):
    """A recorded table loads as measurements."""
    path = tmp_path / "measurements.csv"
    file = RowFile(path, column_names(3))
    joints = [-0.3, -0.2, -0.1, 0.1, 0.2, 0.3]
    file.append([np.array([0.5, 1, *joints, 0, -0.1, 0, 0.1, 0.2, 0.3, 1, 0, 0, 0])])
    file.append([np.array([1.5, 1, *joints, 0, -0.1, 0, *[np.nan] * 7])])
    table = measurements.load(path, 3)
    np.testing.assert_array_equal(table.beta[0], joints[:3])
    assert np.isnan(table.position[1]).all() and not table.warnings


@pytest.fixture(scope="module")
def limits():
    robot = robot_file.load(DATA / "demo" / "robot.yaml")
    return bench_file.load(DATA / "bench" / "bench.yaml").axis_settings(robot).limits


def test_approach(limits):
    """The way point lies below or above the target."""
    plan = measurements.load(DATA / "plan.csv", 3)
    for direction, sign in (("forward", -1), ("backward", 1)):
        step = steps_of(plan, Approach(direction, 1e-3, 0.1), limits, "plan")[3]
        np.testing.assert_allclose(step.way_point - step.joints, sign * np.repeat([1e-3, 0.1], 3))
        assert step.row == 5
    assert all(step.way_point is None for step in steps_of(plan, Approach(), limits, "plan"))


@pytest.mark.parametrize(
    ("loads", "weight_left", "asked"),
    [
        ([0, 0], False, []),
        ([0, 0], True, [0]),  # left there by an interrupted recording
        ([0, 1, 1], False, [0, 1, 0]),
        ([1, 0], True, [1, 0]),
    ],
)
def test_weights(limits, monkeypatch, loads, weight_left, asked):
    """A person is asked wherever the weight changes, and at the start where one may hang there; no weight is left."""
    plan = steps_of(measurements.load(DATA / "plan.csv", 3), Approach(), limits, "plan")
    steps = [replace(step, force=np.array([0.0, load, 0])) for step, load in zip(plan, loads, strict=False)]
    monkeypatch.setattr(Session, "_measured", Session._approach)
    monkeypatch.setattr(Session, "_go", lambda self, joints: None)
    rows, motors, hung = SimpleNamespace(groups=0, append=list), SimpleNamespace(halt=list), []
    robot = robot_file.load(DATA / "demo" / "robot.yaml")
    session = Session(
        robot, motors, None, rows, None, None, lambda force: hung.append(force[1]), weight_left=weight_left
    )
    session.run(steps)
    assert hung == asked


@pytest.mark.parametrize(
    "text",
    ["{", "[]", "{}", "3", *(f'{{"started_unix_s": {t}, "settings": {{}}, "sittings": []}}' for t in ("null", '"1"'))],
)
def test_damaged_about(tmp_path, text):
    """A damaged session.json is named, and what was recorded stays."""
    Folder(tmp_path / "out", {}, {}, 3)
    (tmp_path / "out" / "session.json").write_text(text)
    with pytest.raises(InputError, match="session.json: does not describe a recording"):
        Folder(tmp_path / "out", {}, {}, 3)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_interrupted(tmp_path, number):
    """A recording that a signal ends says so in its session.json."""
    folder, bench = Folder(tmp_path / "out", {}, {}, 3), bench_file.load(DATA / "bench" / "bench.yaml")
    figures = dict.fromkeys(["cycles", "bad_cycles", "p99_late", "worst_late", "real_time"], 0)
    motors = SimpleNamespace(state=figures, settings=SimpleNamespace(interface="none", period=0.004), names=[])
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), folder.sitting(motors, Tracker(bench, tmp_path, 1.0)):
        os.kill(os.getpid(), number)
        time.sleep(1)
    ended = json.loads((tmp_path / "out" / "session.json").read_text())["sittings"][0]["ended"]
    assert ended == f"interrupted by {number.name}" and signal.getsignal(number) == before


@pytest.mark.parametrize("option", ["--speed", "--dwell", "--patience"])
def test_nan_option(tmp_path, capfd, option):
    """Options are finite numbers."""
    files = [DATA / "demo" / "robot.yaml", DATA / "plan.csv", "--bench", DATA / "bench" / "bench.yaml"]
    assert cli.run([*map(str, ["record", *files, "-o", tmp_path / "out"]), option, "nan"]) == 2
    assert f"Invalid value for '{option}': 'nan' is not a finite number" in capfd.readouterr().err


def test_forbidden_rows(tmp_path, capfd):
    """They are named before anything moves or is written."""
    lines = (DATA / "plan.csv").read_text().splitlines()[:5]
    lines[2] = lines[2].replace("-0.158925341", "-0.05")
    plan = tmp_path / "plan.csv"
    plan.write_text("\n".join(lines) + "\n")
    command = ["record", DATA / "demo" / "robot.yaml", plan, "--bench", DATA / "bench" / "bench.yaml"]
    code = cli.run([*map(str, command), "-o", str(tmp_path / "out"), "--folder", str(tmp_path / "bench")])
    assert code == 1 and "row 3: beta3 = -50.00 mm: may be" in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def test_person(tmp_path, monkeypatch, capfd):
    """The prompts. Later programs remember a weight; an answer that is not a finite number is asked for again."""
    answers = io.StringIO("\n\nnan\ninf\n12.5\n")
    monkeypatch.setattr("sys.stdin", answers)
    person = Person(tmp_path)
    assert not person.weight_left
    person.hang(np.array([0.0, -0.0980665, 0.0]))
    assert Person(tmp_path).weight_left
    person.hang(np.zeros(3))
    assert not Person(tmp_path).weight_left
    assert person.deployed(1) == pytest.approx(12.5e-3)
    said = capfd.readouterr().err
    assert "Hang 10.0 g at the tip (force +0, -0.09807, +0 N in the base frame), then press Enter" in said
    assert said.count("is not a finite number") == 2
    assert "See that nothing hangs" in said and "tip of tube 2 stand out of the plate? 0: flush [mm]" in said


def test_live_page(tmp_path, monkeypatch):
    """It shows the newest state, reloads itself during the recording, and no more at its end."""
    target, now = tmp_path / "page.html", [0.0]
    monkeypatch.setattr("ctcr.bench.record.live_page.time.monotonic", lambda: now[0])
    progress = Progress(10, done=2, doing="row 4: moving", errors_mm=[3.0, 4.0])
    with LivePage(target, "A <robot>") as live:
        live.show(progress)
        first = target.read_text()
        progress.errors_mm += [float("nan"), 5.0]
        live.show(progress)
        assert target.read_text() == first  # not before its time
        now[0] += 2.0
        live.show(progress)
        second = target.read_text()
    assert 'http-equiv="refresh" content="2"' in first and first.count("<circle") == 2
    assert "A &lt;robot&gt;" in first and "row 4: moving" in first and "3.54 mm" in first
    assert second.count("<circle") == 3 and "5.00 mm" in second
    assert "refresh" not in target.read_text() and target.read_text().count("<circle") == 3


def test_page_of_unknown_errors():
    """Where the model has no solution there is no point, and no picture where that is so for all of its readings."""
    shown = page(Progress(10, errors_mm=[0.1] + [np.nan] * SHOWN), "title", 2)
    assert "<circle" not in shown and "not known" in shown and "nan mm" not in shown and "0.10 mm" in shown


def test_picture():
    """Errors as blocks, a gap for NaN."""
    assert picture([0.0, 0.5, 1.0, float("nan")]) == "▁▅█ "
    progress = Progress(10, errors_mm=[3.0, 4.0, float("nan")])
    assert progress.rms_mm == pytest.approx(12.5**0.5)
    assert np.isnan(Progress(10).rms_mm)
