"""Every command shows the names of a robot, a file, a column and an effect of one's own as they are written."""

import json
import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from ctcr.robot import robot_file
from ctcr.show import style
from ctcr.show.wording import visible

EXAMPLES = Path(__file__).parents[3] / "examples"
TABLE2 = EXAMPLES / "robots" / "table2.yaml"
NAME = "[red]a[/nope] [/] $x^{$ :warning: <script>alert(1)</script> \x1b[2J\a\x9b\u202e\ud800"
FILE = "[red]a \x1b[2J\a\udcff"  # the last byte is no UTF-8
JOINTS = ["--beta-mm", "-330,-240,-165", "--alpha-deg", "50,-40,-60"]
EFFECT = """
from ctcr.user_effects import Effect, Parameter
class Mine(Effect):
    id = "mine"
    title = NAME
    physics = NAME
    measure = NAME
    look_alikes = (NAME,)
    parameters = [Parameter("gain", unit="[/]", sigma=0.1, meaning=NAME)]
    def joints(self, rows, values):
        return rows.beta, rows.alpha + values.gain * rows.alpha
"""


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / f"{FILE}.yaml"
    text = TABLE2.read_text()
    path.write_text(text.replace(text.partition("\nname: ")[2].partition("\n")[0], json.dumps(NAME)))
    assert robot_file.load(path).name == NAME
    return path


@pytest.fixture
def table(tmp_path):
    """40 rows of the demonstration."""
    path = tmp_path / f"{FILE}.csv"
    lines = (EXAMPLES / "data" / "demo" / "measurements.csv").read_text().splitlines()
    path.write_text("\n".join(lines[:41]))
    return path


@pytest.fixture
def effects(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(f"NAME = {ascii(NAME)}\n{EFFECT}")
    yield path
    robot_file.user_effects.clear()


@pytest.fixture
def shows(run, monkeypatch):
    """shows(names, "info", ...): the command, whose code is 0, or not with `fails`, prints these names as they are."""

    monkeypatch.setenv("COLUMNS", "1000")

    def check(names, *arguments, fails=False) -> str:
        code, out, err = run(*arguments)
        assert bool(code) == fails, err
        text = out + err
        assert text.replace("\n", "").isprintable() and "this should not happen" not in text
        for name in names:
            assert visible(name) in text
        return text

    return check


def test_robot(shows, robot, table, tmp_path):
    """A robot's name, and those of the files that are read and written."""
    new, poses = (tmp_path / f"{FILE}.{ending}" for ending in ("new.yaml", "new.csv"))
    shows([NAME], "info", robot)
    shows([NAME, FILE], "shape", robot, *JOINTS, "-o", tmp_path / f"{FILE}.png")
    shows([NAME], "compare", robot, table)
    shows([NAME], "history", robot)
    shows([FILE], "predict", robot, table, "-o", poses)
    shows([FILE], "simulate", robot, table, "-o", poses)
    shows([FILE], "join", robot, table, table, "-o", poses)
    shows([FILE], "add", robot, "tip_load", "-o", new)
    shows([NAME], "calibrate", "fit", robot, table, "--free", "tubes.1.curvature", "-o", tmp_path / "fitted.yaml")
    shows([NAME, FILE], "history", tmp_path / "fitted.yaml")
    shows([FILE], "remove", new, "tip_load", "-o", tmp_path / f"{FILE}.old.yaml")
    assert robot_file.load(new).name == NAME


def test_own_effect(shows, effects):
    """All texts of an effect of one's own."""
    shows([NAME], "effects", "--effects", effects)
    text = shows([NAME, "[/]"], "effects", "mine", "--effects", effects)
    assert text.count(visible(NAME)) == 5


def test_errors(shows, robot, table, tmp_path):
    """Files, columns, fields, effects, values and commands that do not exist."""
    shows([FILE], "info", tmp_path / FILE, fails=True)
    shows([NAME], NAME, fails=True)
    shows(["[red]a[/nope]\a"], "info", robot, "[red]a[/nope]\a", fails=True)
    shows([NAME], "add", robot, NAME, "-o", "x.yaml", fails=True)
    shows([NAME], "calibrate", "fit", robot, table, "--free", NAME, fails=True)
    column = "[/nope] \x9b31m\u202e"
    table.write_text(table.read_text().replace("t_s", column, 1))
    shows([FILE, column], "compare", robot, table, fails=True)
    robot.write_text(robot.read_text() + f"\n{json.dumps(NAME)}: 1\n")
    shows([FILE, NAME], "info", robot, fails=True)


def test_bench(shows, robot, table, tmp_path):
    """Files, fields and devices of a bench, faults of simulators and programs that do not exist."""
    bench, wires = tmp_path / f"{FILE}.bench.yaml", ["--folder", tmp_path / "wires"]
    text = (EXAMPLES / "data" / "bench" / "bench.yaml").read_text()
    for device in ("port", "interface"):
        text = text.replace(f"{device}: simulated", f"{device}: {json.dumps(NAME)}")
    bench.write_text(text)
    with_devices = ["--bench", bench, *wires]
    for package in ("serial", "pysoem"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    shows([NAME], "devices", *with_devices, fails=True)
    shows([NAME], "move", robot, *with_devices, fails=True)
    shows([NAME], "record", robot, table, *with_devices, "-o", tmp_path / f"{FILE}.recorded", fails=True)
    bench.write_text(json.dumps({NAME: 1}))
    shows([FILE, NAME], "devices", *with_devices, fails=True)
    shows([FILE, NAME], "track", robot, bench, fails=True)
    shows([FILE], "sim", "aurora", robot, "--oracle", f"'{FILE}'", *wires, fails=True)
    shows([FILE], "sim", "aurora", robot, "--scenario", table, *wires, fails=True)
    shows([FILE], "stop", "--folder", table, fails=True)


class Elements(HTMLParser):
    """The tags of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attributes) -> None:
        self.found.append(tag)


@pytest.mark.parametrize("command", [("compare",), ("calibrate", "fit", "--free", "tubes.1.curvature")])
def test_report(run, robot, table, tmp_path, monkeypatch, command):
    """A report has the elements that it has with plain names."""
    monkeypatch.setattr(style, "draw", lambda *_: "<svg/>")
    plain, page = tmp_path / "plain.csv", tmp_path / "page.html"
    plain.write_bytes(table.read_bytes())
    elements = []
    for files in ((TABLE2, plain), (robot, table)):
        assert run(*command, *files, "--report", page)[0] == 0
        elements.append(Elements(page.read_text()).found)
    assert elements[0] == elements[1]
    assert "&lt;script&gt;alert(1)" in page.read_text()


def test_narrow_encoding(robot):
    """Letters that a terminal lacks are escaped, too."""
    robot.write_text(robot.read_text().replace("[red]", "Žluť"))
    command = [sys.executable, "-m", "ctcr", "info", robot]
    done = subprocess.run(command, capture_output=True, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0 and b"\\u017dlu\\u0165a" in done.stdout
