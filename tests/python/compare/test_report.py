"""The report is one page that needs nothing else, the command writes its files, and a big table takes bounded time."""

import json
import re
import time
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from compare_bench import bench, stop_and_go
from ctcr import cli
from ctcr.api import compare as compare_api
from ctcr.compare import compare, report
from ctcr.compare.summary import findings, headline
from ctcr.fit.floors import Floors
from ctcr.show import output

ROOT = Path(__file__).parents[3]
SHARED = ROOT.parent / "shared" / "data" / "real" / "boston_2016"
ROBOT = ROOT / "examples" / "robots" / "table2.yaml"
FETCHING = ("src", "href", "data", "poster", "srcset", "action", "xlink:href")


class Page(HTMLParser):
    """Collects the text, the scripts, and what a browser would fetch."""

    def __init__(self, text):
        super().__init__()
        self.fetched, self.scripts, self.words, self._inside = [], [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self._inside = tag
        self.fetched += [value for name, value in attributes if name in FETCHING and not (value or "#").startswith("#")]

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        (self.scripts if self._inside == "script" else self.words).append(data)


def planted(seed=1, runs=10):
    random = np.random.default_rng(seed)
    path = stop_and_go(random, runs=runs)
    return bench(random, path, lambda q, t, run: 1e-3 * np.column_stack([np.cos(q[:, 2]), 0 * t, 0 * t + 0.5]))


def without_links(svg_or_css):
    """url(#...) points into the page itself."""
    return re.sub(r"url\(\s*[\"']?#", "", svg_or_css)


def test_page():
    """The page fetches nothing and holds all findings."""
    result = compare(*planted())
    page = Page(report.page(result))
    text = "".join(page.words)
    for fetched in page.fetched:
        assert fetched.startswith("data:"), fetched[:60]
    assert not re.search(r"@import|url\(", without_links(text))
    assert headline(result) in text
    for item in findings(result):
        assert item.text in text
    assert len(page.scripts) == 2


def test_scene():
    """The 3-D view is valid JSON with the true points and arrows."""
    result = compare(*planted())
    drawing = json.loads(report.scene(result))
    by_name = {layer["name"]: layer for layer in drawing["layers"]}
    rows = report.shown_rows(result)
    for name, points in (("measured", result.headline.measured), ("predicted", result.headline.predicted)):
        shown = np.column_stack([by_name[name][axis] for axis in "xyz"])
        np.testing.assert_allclose(shown, points[rows] * 1e3, atol=5.1e-4)
    factor = report.arrow_factor(result)
    assert factor >= 1
    arrows = by_name[f"error × {factor:g}"]
    start, end = (np.column_stack([ends[axis] for axis in "xyz"]) for ends in (arrows, arrows["to"]))
    np.testing.assert_allclose(end - start, factor * result.headline.error[rows] * 1e3, atol=2e-3)


def test_escaping(monkeypatch):
    """A robot name with HTML in it adds no script to the page."""
    monkeypatch.setattr("ctcr.show.style.draw", lambda *_: None)
    robot, readings, prediction = planted(runs=6)
    robot.name = "</script><script>alert(1)</script>"
    page = Page(report.page(compare(robot, readings, prediction)))
    assert len(page.scripts) == 2
    assert not any("alert(1)" in script for script in page.scripts)


def write_table(path, readings):
    header = "t_s,run,beta1_m,beta2_m,beta3_m,alpha1_rad,alpha2_rad,alpha3_rad,x_m,y_m,z_m"
    rows = np.column_stack([readings.t, readings.run, readings.beta, readings.alpha, readings.position])
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.fixture
def table(tmp_path, monkeypatch):
    """A table for a three-tube robot whose predictions are given, so that no compiled model is needed."""
    robot, readings, prediction = planted()
    third = np.zeros((len(readings.run), 1))
    wider = {name: np.hstack([getattr(readings, name), third]) for name in ("beta", "alpha")}
    readings = replace(readings, **wider)
    write_table(tmp_path / "table.csv", readings)
    monkeypatch.setattr(compare_api, "predict", lambda robot, readings, steps: prediction)
    monkeypatch.setattr(compare_api, "_fitted", lambda *_: ([], Floors().as_dict()))
    return tmp_path / "table.csv"


def test_command(table, tmp_path, capsys):
    """The command prints, and writes the report and the numbers."""
    page, numbers = tmp_path / "report.html", tmp_path / "numbers.json"
    assert cli.run(["compare", str(ROBOT), str(table), "--report", str(page), "--json", str(numbers)]) == 0
    said = capsys.readouterr().out
    assert "The model is wrong by" in said
    assert "Limits of these data" in said
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    data = json.loads(numbers.read_text())
    assert data["position_mm"]["count"] == 180
    assert {item["run"] for item in data["runs"]} == set(range(10))
    assert data["conventions"] and not data["dependence"]["ranked"]  # the robot is another one


def test_json_on_standard_output(table, capsys):
    """Nothing else goes to standard output."""
    assert cli.run(["compare", str(ROBOT), str(table), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"]["compared"] == 180


def test_unwritable_report(table, tmp_path, capsys):
    """A folder that does not exist is one clear error."""
    assert cli.run(["compare", str(ROBOT), str(table), "--report", str(tmp_path / "no" / "r.html")]) == 1
    assert "cannot write" in capsys.readouterr().err


def test_long_table():
    """50 000 rows; the limit is generous, a quadratic step would take far longer."""
    random = np.random.default_rng(2)
    joints, run, _ = stop_and_go(random, runs=2_500, stops=10)
    start = time.process_time()
    result = compare(*bench(random, (joints, run, np.arange(len(run)) * 2.0)))
    assert time.process_time() - start < 30
    assert result.position_mm.count == 50_000
    json.dumps(output.plain(result.as_dict()), allow_nan=False)


@pytest.mark.skipif(not SHARED.exists(), reason="the real measurements are not here")
def test_real_robot():
    """The numbers of a real recording agree with an analysis by hand."""
    if not hasattr(pytest.importorskip("ctcr._core"), "Model"):
        pytest.skip("the compiled model is not built")
    from ctcr.robot import robot_file
    from ctcr.table import measurements

    robot = robot_file.load(SHARED / "robot.yaml")
    readings = measurements.load(SHARED / "measurements.csv", robot.n_tubes)
    result = compare(robot, readings, compare_api.predict(robot, readings))
    assert result.position_mm.mean == pytest.approx(5.4, abs=0.1)
    assert result.direction.delay_s == pytest.approx(0.10, abs=0.01)
    assert result.direction.rms_without_delay_mm == pytest.approx(3.5, abs=0.1)
    assert result.ranking.chosen[0].name == "lag"
