"""Motion that a table leaves out is found where readings return to joints, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr.audit import missing_motion
from ctcr.diagnose import add, diagnose
from ctcr.effects import catalogue
from ctcr.model import simulation
from ctcr.table.measurements import Measurements

STOPS, RUNS = 7, 12
FRICTION = {f"effects.friction.coefficient.{i}": 0.03 for i in (1, 2, 3)}


def sweeps(plan: Measurements) -> tuple[Measurements, np.ndarray]:
    """Out, back, to the end once more and back to the middle, run by run; and which rows are that way to the end."""
    rng = np.random.default_rng(5)
    out = np.linspace(0, 1, STOPS)
    way = np.r_[out, out[-2::-1], 1.0, 0.5]
    starts = rng.choice(len(plan), RUNS, replace=False)
    turn = rng.uniform(0.5, 1.2, (RUNS, 3)) * rng.choice([-1, 1], (RUNS, 3))
    alpha = np.concatenate([plan.alpha[k] + way[:, None] * t for k, t in zip(starts, turn, strict=True)])
    count = len(way)
    hidden = np.tile(np.arange(count) == count - 2, RUNS)
    beta, run = np.repeat(plan.beta[starts], count, axis=0), np.repeat(np.arange(RUNS), count)
    return Measurements.of_joints(beta, alpha, t=2.0 * np.arange(RUNS * count), run=run), hidden


@pytest.fixture(scope="module")
def rubbing(robot):
    return catalogue.with_values(robot, ["friction"], FRICTION)


@pytest.fixture(scope="module")
def left_out(rubbing, plan):
    """Readings of a robot with friction whose detours were not recorded, and the whole table."""
    whole, hidden = sweeps(plan)
    made = simulation.simulate(rubbing, whole, "realistic", seed=2)
    return made.rows(~hidden), made


def test_completed(robot, left_out):
    """Every detour without a reading is added to the table as rows without a pose."""
    table, whole = left_out
    found, said = missing_motion.completed(robot, table)
    assert len(said) == 1
    assert f"{RUNS} readings" in said[0]
    assert len(found) == len(whole)
    np.testing.assert_allclose(found.alpha, whole.alpha, atol=1e-12)
    np.testing.assert_array_equal(found.run, whole.run)
    assert np.isnan(found.position[15::16]).all() == np.isnan(found.quaternion[15::16]).all()
    assert np.sum(np.isnan(found.position).any(axis=1)) == RUNS
    assert (np.diff(found.t) > 0).all()
    assert (np.diff(found.row) >= 0).all()
    again, nothing = missing_motion.completed(robot, found)
    assert len(again) == len(found)
    assert not nothing


def test_stuck_readings(robot, left_out):
    """Readings that stay where the recorded motion would leave them, if the visits differ least there, do not hide what
    the others say."""
    table, whole = left_out
    direct, beyond, again = (np.arange(RUNS) * (2 * STOPS) + k for k in (STOPS // 2, STOPS + 2, 2 * STOPS - 1))
    position = table.position.copy()
    stuck = np.argsort(np.linalg.norm(position[direct] - position[beyond], axis=1))[:2]
    position[again[stuck]] = position[direct[stuck]]
    found, said = missing_motion.completed(robot, replace(table, position=position))
    assert len(said) == 1
    assert len(found) == len(whole)


def test_fit(robot, left_out):
    """A fit comes near the noise and near that of the whole table; without the detours, readings at their end miss by
    millimetres."""
    table, whole = left_out
    added = add.add(robot, table, ["friction"])
    assert any("without a reading" in notice for notice in added.notices)
    rms = added.rms("rms_mm")
    assert rms["friction"] < 2 * rms["noise_floor"] < 0.1 * rms["calibrated"]
    assert rms["friction"] < 1.15 * add.add(robot, whole, ["friction"]).rms("rms_mm")["friction"]


def test_diagnosis(robot, left_out):
    """A diagnosis reports the added motion and finds friction."""
    result = diagnose(robot, left_out[0])
    assert result.accepted[0].ids[0] == "friction"
    assert any("without a reading" in notice for notice in result.notices)
    assert 0 < result.judged.sum() < result.held_out.sum()  # an added row is no reading


@pytest.mark.parametrize("noise", ["jitter", "realistic"])
def test_direct_motion(robot, rubbing, plan, noise):
    """Readings that were reached directly stay."""
    whole, hidden = sweeps(plan)
    table = simulation.simulate(rubbing, whole.rows(~hidden), noise, seed=3)
    assert missing_motion.completed(robot, table) == (table, [])


def test_without_history(robot, plan):
    """A robot without history shows no missing motion."""
    whole, hidden = sweeps(plan)
    table = simulation.simulate(robot, whole, "realistic", seed=4).rows(~hidden)
    assert missing_motion.completed(robot, table) == (table, [])


def test_incomplete_tables(robot, left_out):
    """Tables without poses, times or a stated jitter."""
    table = left_out[0]
    silent = robot.model_copy(update={"tracker": robot.tracker.model_copy(update={"jitter_mm": None})})
    assert missing_motion.completed(silent, table) == (table, [])
    assert missing_motion.completed(robot, replace(table, position=None))[1] == []
    found, said = missing_motion.completed(robot, replace(table, t=np.full(len(table), np.nan)))
    assert len(said) == 1
    assert np.isnan(found.t).all()
