"""A delay that is not the same throughout: told as such, not taken for hysteresis."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.diagnose import add, diagnose, figures, unsteady
from ctcr.diagnose.engine import Engine
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[3]
DELAYS = (0.5, 0.75)  # s: rows of the demonstration follow each other slowly


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROOT / "examples" / "robots" / "table2.yaml")


def late(robot, table, delays, later):
    """Readings with jitter, late by the first of two delays, or `later` (M,) by the second."""
    made = []
    for delay in delays:
        late = add.with_values(robot, ["delay"], {"effects.delay.delay": delay})
        made.append(simulation.simulate(late, table, "jitter", seed=1))
    choose = later[:, None]
    return replace(
        made[0],
        position=np.where(choose, made[1].position, made[0].position),
        quaternion=np.where(choose, made[1].quaternion, made[0].quaternion),
    )


@pytest.fixture(scope="module")
def steps(robot, recorded):
    """Each half of a run late by one of the delays, by chance."""
    random = np.random.default_rng(5)
    later = np.zeros(len(recorded), bool)
    for run in np.unique(recorded.run):
        for half in np.array_split(np.flatnonzero(recorded.run == run), 2):
            later[half] = random.random() < 0.5
    return diagnose(robot, late(robot, recorded, DELAYS, later))


@pytest.fixture(scope="module")
def steady(robot, recorded):
    return diagnose(robot, late(robot, recorded, DELAYS, np.zeros(len(recorded), bool)))


@pytest.mark.parametrize(("readings", "parts"), [(1, 1), (28, 2), (100, 8)])
def test_a_run_has_two_stretches_or_more_of_a_dozen_readings(robot, recorded, readings, parts):
    runs = np.repeat(np.arange(12), readings)
    there = np.arange(len(runs)) % len(recorded)
    columns = {name: value[there] for name, value in vars(recorded).items() if isinstance(value, np.ndarray)}
    engine = SimpleNamespace(measurements=replace(recorded, **columns | {"run": runs}))
    stretch = unsteady._stretches(engine)
    assert stretch.max() + 1 == 12 * parts == len(np.unique(stretch))
    assert all(len(np.unique(stretch[runs == run])) == parts for run in range(12))


def delay_of(found) -> tuple[float, float]:
    i = found.final.names.index("effects.delay.delay")
    return float(found.final.values[i]), float(found.final.sd[i])


def test_lags_that_jump_are_no_hysteresis(steps):
    assert [accepted.ids for accepted in steps.accepted] == [["delay"]]
    rivals = [entry.linear for entry in steps.rounds[1].entries]
    assert max(rivals) < steps.rounds[1].needed


def test_lags_that_jump_are_told(steps):
    (told,) = [line for line in steps.leftover.in_words if "not the same throughout" in line]
    spread = float(told.split(" varies by ")[1].split(" ms")[0])
    assert spread == pytest.approx(1e3 * (DELAYS[1] - DELAYS[0]) / 2, rel=0.4)


def test_the_delay_is_no_surer_than_its_lags(steps, steady):
    (value, sd), (one, sure) = delay_of(steps), delay_of(steady)
    assert DELAYS[0] - 2 * sd < value < DELAYS[1] + 2 * sd and sd > 0.01
    assert abs(one - DELAYS[0]) < 4 * sure and sure < 0.2 * sd


def test_nothing_is_told_of_a_steady_delay(steady):
    assert [accepted.ids for accepted in steady.accepted] == [["delay"]]
    assert steady.leftover.in_words == ["What is left is noise."]


def test_a_delay_is_drawn_over_the_speed_of_the_tip(steady):
    """What the report shows of it: the error along the motion, and the same explained."""
    picture = Figure()
    assert figures.before_after(picture, steady) is None
    (axes,) = [axes for axes in picture.axes if "speed of the tip" in axes.get_xlabel()]
    error, explained = (line.get_ydata() for line in axes.lines[:2])
    known = np.isfinite(error) & np.isfinite(explained)
    assert np.corrcoef(error[known], explained[known])[0, 1] > 0.98
    assert "along the motion" in axes.get_ylabel()


@pytest.fixture(scope="module")
def slipped(robot, recorded):
    """Late by the longer delay between two moments of the session, one of them in a run that is locked."""
    part = np.arange(len(recorded)) / len(recorded)
    return diagnose(robot, late(robot, recorded, DELAYS, (part > 0.3) & (part < 0.7)))


def test_what_lags_explain_is_no_leftover(slipped):
    assert [accepted.ids for accepted in slipped.accepted] == [["delay"]]
    assert not slipped.leftover.structured
    assert any("not the same throughout" in line for line in slipped.leftover.in_words)


def test_runs_that_no_fit_saw_are_as_late_as_their_neighbours(slipped):
    """One delay for all leaves far more of them beyond noise."""
    rms, one_delay = slipped.rms_mm, slipped.final.rms_mm(slipped.locked)
    noise = rms["noise_floor"] ** 2
    assert one_delay**2 - noise > 4 * (rms["with_effects"] ** 2 - noise)
    assert unsteady.FOLLOWED in slipped.leftover.in_words


def test_a_frame_of_the_tracker_is_told(robot, slipped):
    """A tracker whose frames come as slowly as the delays differ."""
    slow = robot.model_copy(deep=True)
    slow.tracker.rate_Hz = 1 / (DELAYS[1] - DELAYS[0])
    noise = noise_of_readings(slow, slipped.measurements)
    engine = Engine(slow, slipped.measurements, noise, ~slipped.locked)
    assert "about one frame of the tracker (250 ms)" in unsteady.followed(engine, slipped.final)[1][0]
    assert "frame" not in unsteady.followed(replace(engine, robot=robot), slipped.final)[1][0]
