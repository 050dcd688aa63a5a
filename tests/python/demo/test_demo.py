"""The demonstration on the simulated bench, and what it is made of."""

import json
import os
import re
from dataclasses import replace

import numpy as np
import pytest
from ctcr.bench.devices import emergency_stop
from ctcr.bench.record.joined import PAUSE_S, joined, start_of
from ctcr.bench.shared.folder import VARIABLE, private_folder
from ctcr.demo import effect_story
from ctcr.demo.bench_story import VALUE
from ctcr.demo.story import LOG, Story, new_folder
from ctcr.errors import InputError, Problem
from ctcr.table import measurements
from rich.console import Console
from simulated_bench import ROOT, ctcr, run_before_others, skip_without_bench

TABLE = ROOT / "examples" / "data" / "calibration" / "measurements.csv"


# ---- recordings put together


def test_joined():
    """Rows keep their order, runs their borders, times their distance by one clock."""
    table = measurements.load(TABLE, 3)
    for starts, shift in (([1e9, 1e9 + 500], 500), ([None, 3.0], table.t.max() + PAUSE_S)):
        whole = joined([table, table], starts)
        n = len(table)
        np.testing.assert_array_equal(whole.t[:n], table.t)
        np.testing.assert_allclose(whole.t[n:], table.t + shift)
        np.testing.assert_array_equal(np.diff(whole.run[:n]) != 0, np.diff(table.run) != 0)
        assert whole.run[n] == whole.run[n - 1] + 1 and len(np.unique(whole.run)) == 2 * len(np.unique(table.run))
        np.testing.assert_array_equal(whole.alpha, np.vstack([table.alpha] * 2))
        assert list(whole.row[[0, -1]]) == [2, 2 * n + 1]
    timeless = replace(table, t=np.full(len(table), np.nan))
    for before in ([timeless], [table, timeless]):
        whole = joined([*before, table], [None] * (1 + len(before)))
        np.testing.assert_allclose(np.diff(whole.t[-n:]), np.diff(table.t), atol=1e-9)
    without = replace(table, quaternion=None)
    assert joined([table, without], [None, None]).quaternion is None


def test_start(tmp_path):
    """From the session.json beside the table."""
    assert start_of(tmp_path / "measurements.csv") is None
    (tmp_path / "session.json").write_text(json.dumps({"started_unix_s": 12.5}))
    assert start_of(tmp_path / "measurements.csv") == 12.5


# ---- stories


def test_story(tmp_path):
    """It keeps the results of commands, and their errors."""
    story = Story(new_folder(tmp_path / "story"), Console(quiet=True))
    robot = ROOT / "examples" / "data" / "demo" / "robot.yaml"
    story.do("describe it", f"info {robot}", lambda told: told["robot"]["name"], "described")
    assert story.steps[0].found == "demo" and story.answers["described"]["robot"]["name"] == "demo"
    assert (story.folder / LOG).read_text().startswith("$ ctcr info")
    with pytest.raises(InputError, match="ctcr info nothing.yaml.*cannot read it"):
        story.do("fail", "info nothing.yaml", lambda told: "")


def test_effect_story(tmp_path, monkeypatch, capfd):
    """It runs its commands one behind the other on files of its own, and ends with one that fails."""
    monkeypatch.setattr(
        effect_story, "STEPS", {"Look": "info robot.yaml", "Fail": "info no.yaml", "Rest": "info no.yaml"}
    )
    assert effect_story.tell(new_folder(tmp_path / "story"), Console()) == 1
    printed = capfd.readouterr()
    assert "$ ctcr info robot.yaml" in printed.out and "Rest" not in printed.out and "no.yaml" in printed.err
    assert {"robot.yaml", "measurements.csv", LOG} == {path.name for path in (tmp_path / "story").iterdir()}


def test_resumed_story(tmp_path, monkeypatch):
    """A command that ends with a stop of the story's own bench is run again; one that always does is a fault."""
    wires, ran = tmp_path / "wires", []
    wires.mkdir()
    story = Story(new_folder(tmp_path / "story"), Console(quiet=True), wires)

    def starved(times):
        def run(arguments, command):
            ran.append(command)
            if len(ran) > times:
                return None
            emergency_stop.stop(wires, "no frame came back")
            return InputError(Problem("failed"))

        ran.clear()
        monkeypatch.setattr(story, "_run", run)

    starved(times=2)
    story.do("record", "record", "done")
    assert len(ran) == 3 and len(story.steps) == 1 and not emergency_stop.is_stopped(wires)
    starved(times=1000)
    with pytest.raises(InputError, match="failed"):
        story.do("record", "record", "done")


def test_foreign_folder(tmp_path):
    """Only the folder of an earlier story is removed."""
    (tmp_path / "mine.txt").write_text("keep me")
    with pytest.raises(InputError, match="holds no demonstration"):
        new_folder(tmp_path)
    assert (tmp_path / "mine.txt").exists()
    story = new_folder(tmp_path / "story")
    (story / "old.csv").touch()
    assert list(new_folder(story).iterdir()) == [story / LOG]


def run_demo(tmp_path, *options):
    """What the demonstration printed, and its folder."""
    skip_without_bench()
    target = tmp_path / "demo"
    done = run_before_others(
        ctcr("demo", "bench", "-o", target, *options), env=os.environ | {"COLUMNS": "150"}, timeout=900
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, target


def check_story(said, folder):
    added = json.loads((folder / "added.json").read_text())
    assert added["added"] == ["friction"]
    rms = added["rms_mm"]
    assert rms["friction"] < 0.8 * rms["calibrated"] < 0.8 * rms["nominal"]
    # Few rows, and how the tubes moved between them in real time is not in the table: farther off than their sd says.
    coefficients = [found["value"] for name, found in added["parameters"].items() if ".coefficient." in name]
    assert 0.7 * VALUE < np.median(coefficients) < 1.3 * VALUE
    diagnosis = json.loads((folder / "diagnosis.json").read_text())
    assert diagnosis["effects"][0]["class"][0] == "friction"
    assert "The error of the model fell from" in said
    page = (folder / "report.html").read_text()
    assert not re.search(r'(src|href)="http', page) and page.count("<svg") >= 3 and len(page.encode()) <= 1_000_000


@pytest.mark.alone
def test_short_demo(tmp_path, monkeypatch):
    """Shortened, but through the same serial line and the same bus, while the user's own bench is stopped."""
    wires = private_folder(tmp_path / "wires")
    monkeypatch.setenv(VARIABLE, str(wires))
    emergency_stop.stop(wires, "mine")
    check_story(*run_demo(tmp_path, "--short"))
    assert emergency_stop.reason(wires) == "mine"


@pytest.mark.slow
def test_whole_demo(tmp_path):
    """The second recording decides; friction in the model reduces every error."""
    said, folder = run_demo(tmp_path)
    check_story(said, folder)
    first = json.loads((folder / "first_diagnosis.json").read_text())
    assert first["verdict"] == "ambiguous" and "friction" in first["effects"][0]["class"]
    assert json.loads((folder / "diagnosis.json").read_text())["verdict"] == "identified"
    before, after = map(float, re.search(r"off by ([\d.]+) mm before and ([\d.]+) mm after", said).groups())
    assert after < 0.6 * before
