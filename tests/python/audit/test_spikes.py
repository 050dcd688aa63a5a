"""Spikes of the tracker are distinguished from motions of the tip, and left out."""

import json
from dataclasses import replace
from pathlib import Path

import ctcr
import numpy as np
import pytest
from ctcr import cli
from ctcr.audit import spikes
from ctcr.effects import catalogue
from ctcr.model import simulation
from ctcr.table import measurements
from ctcr.table.measurements import Measurements

TABLE2 = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"
STOPS, RUNS = 13, 12
EFFECTS = {
    "friction": {f"effects.friction.coefficient.{i}": 0.08 for i in (1, 2, 3)},
    "backlash_rotation": {f"effects.backlash_rotation.play.{i}": 0.15 for i in (1, 2, 3)},
    "contact": {"effects.contact.stiffness": 200.0, "effects.contact.distance": 0.02},
    "frame_jump": {"effects.frame_jump.y": 0.02, "effects.frame_jump.when": 0.5},
    "softening": {f"effects.softening.gamma.{i}": 0.01 for i in (1, 2, 3)},
}


@pytest.fixture(scope="module")
def paths(plan):
    """Out and back, run by run, under three loads: each step moves the tip by a few millimetres."""
    rng = np.random.default_rng(11)
    out = np.linspace(0, 1, STOPS)
    way = np.r_[out, out[-2::-1]]
    starts = rng.choice(len(plan), RUNS, replace=False)
    turn = rng.uniform(0.3, 0.8, (RUNS, 3)) * rng.choice([-1, 1], (RUNS, 3))
    count = RUNS * len(way)
    force = np.zeros((count, 3))
    force[:, 1] = -0.1 * np.repeat(np.arange(RUNS) % 3, len(way))
    beta, run = np.repeat(plan.beta[starts], len(way), axis=0), np.repeat(np.arange(RUNS), len(way))
    alpha = np.concatenate([plan.alpha[k] + way[:, None] * t for k, t in zip(starts, turn, strict=True)])
    return Measurements.of_joints(beta, alpha, t=2.0 * np.arange(count), run=run, force=force)


def measured(robot, paths, effect=None, seed=1):
    hidden = catalogue.with_values(robot, [effect], EFFECTS[effect]) if effect else robot
    return simulation.simulate(hidden, paths, "jitter", seed=seed)


def struck(table, rows, size=0.03, seed=1):
    """The table with readings that are off by `size` [m]."""
    way = np.random.default_rng(seed).normal(size=(len(rows), 3))
    position = table.position.copy()
    position[rows] += size * way / np.linalg.norm(way, axis=1)[:, None]
    return replace(table, position=position)


def interior(rng, count):
    """Rows of as many runs between their start and where they turn."""
    runs = rng.choice(RUNS, count, replace=False)
    return np.sort(runs * (2 * STOPS - 1) + rng.integers(2, STOPS - 2, count))


@pytest.mark.parametrize("effect", [None, *EFFECTS])
def test_spikes(robot, paths, effect):
    """All planted spikes are found and no reading of a robot with an effect."""
    table = measured(robot, paths, effect)
    assert np.isnan(spikes.leaps(robot, table)).all()
    assert spikes.left_out(robot, table) == (table, [])
    rows = interior(np.random.default_rng(3), 8)
    with_spikes = struck(table, rows)
    leap = spikes.leaps(robot, with_spikes)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(leap)), rows)
    assert (leap[rows] > 0.02).all()
    rest, said = spikes.left_out(robot, with_spikes)
    assert len(said) == 1
    assert "8 readings leap" in said[0]
    assert str(rows[0] + 2) in said[0]  # as the table numbers it
    assert np.isnan(rest.position[rows]).all()
    assert np.isnan(rest.quaternion[rows]).all()
    np.testing.assert_array_equal(np.delete(rest.position, rows, axis=0), np.delete(table.position, rows, axis=0))


def test_undecidable(robot, paths):
    """At the ends of a run, where a path turns, beside another spike, and where the joints move the tip as far."""
    table, length = measured(robot, paths), 2 * STOPS - 1
    for rows in ([0], [length - 1], [length], [STOPS - 1], [5, 6]):
        assert np.isnan(spikes.leaps(robot, struck(table, rows))).all()
    assert np.isnan(spikes.leaps(robot, struck(table, [5], size=3e-4))).all()
    every = np.arange(0, len(table), 6)
    names = ("t", "run", "beta", "alpha", "force", "position", "quaternion", "row")
    coarse = replace(table, **{name: getattr(table, name)[every] for name in names})
    assert np.isnan(spikes.leaps(robot, struck(coarse, [2], size=0.004))).all()


def test_beyond_reach(robot, paths):
    """What no tip reaches, such as -9999 for a missing number, is a spike wherever the path turns or a run ends."""
    table, turns = measured(robot, paths), [STOPS - 1, 2 * STOPS - 2, 2 * STOPS - 1 + 5]
    for row in turns:
        position = table.position.copy()
        position[row, 1] = -9.999
        leap = spikes.leaps(robot, replace(table, position=position))
        assert np.flatnonzero(np.isfinite(leap)).tolist() == [row]


def test_other_frame(robot, paths):
    """Only steps are compared, so that a wrong tracker frame changes nothing."""
    table = struck(measured(robot, paths), rows := [7, 60, 111])
    moved = robot.model_copy(deep=True)
    moved.tracker.position_mm = [400.0, -300.0, 200.0]
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(spikes.leaps(moved, table))), rows)


def test_incomplete_tables(robot, paths):
    """Tables without positions or a stated jitter."""
    table = struck(measured(robot, paths), [7])
    silent = robot.model_copy(update={"tracker": robot.tracker.model_copy(update={"jitter_mm": None})})
    assert spikes.left_out(silent, table) == (table, [])
    without = replace(table, position=None)
    assert spikes.left_out(robot, without) == (without, [])


def test_diagnosis(robot, paths):
    """A diagnosis finds the hidden effect in spite of spikes, and reports them."""
    table = measured(robot, paths, "softening")
    rows = interior(np.random.default_rng(5), 10)
    half = struck(table, rows).rows(table.run % 2 == 0)
    rows = np.flatnonzero(np.isin(half.row, table.row[rows]))
    result = ctcr.diagnose(robot, half)
    assert result.verdict.word == "identified" and [a.ids for a in result.accepted] == [["softening"]]
    assert result.rms_mm["with_effects"] < 1.2 * result.rms_mm["noise_floor"]
    assert not result.judged[rows].any()
    assert any("spikes of the tracker" in said for said in result.verdict.sentences)


def test_calibrate(robot, paths):
    """A calibration fits the readings that `ctcr compare` compares."""
    table = struck(measured(robot, paths), rows := [7, 60])
    fitted, compared = ctcr.calibrate(robot, table, hold_out=0, halves=False), ctcr.compare(robot, table)
    assert fitted.n_readings == compared.position_mm.count == len(table) - len(rows)
    assert any("spikes of the tracker" in notice for notice in fitted.notices)


def test_compare(robot, paths, tmp_path, capsys):
    """`ctcr compare` leaves spikes out and reports them."""
    table = struck(measured(robot, paths), [7, 60])
    header = measurements.column_names(3)
    rows = np.column_stack([table.t, table.run, table.beta, table.alpha, table.force, table.position, table.quaternion])
    np.savetxt(tmp_path / "table.csv", rows, delimiter=",", header=",".join(header), comments="")
    numbers, page = tmp_path / "numbers.json", tmp_path / "page.html"
    files = ["--json", str(numbers), "--report", str(page)]
    assert cli.run(["compare", str(TABLE2), str(tmp_path / "table.csv"), *files]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "2 readings leap" in said
    assert "rows 9, 62" in said
    found = json.loads(numbers.read_text())
    assert found["position_mm"]["maximum"] < 0.5
    assert found["rows"]["not_measured"] == [9, 62]
    assert found["notices"][0] in page.read_text(encoding="utf-8")
