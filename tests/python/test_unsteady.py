"""A delay that is not the same throughout: told as such, not taken for hysteresis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr import effect_fit, robot_file, simulation
from ctcr.diagnose import diagnose, figures
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
DELAYS = (0.5, 0.75)  # s: rows of the demonstration follow each other slowly


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROOT / "examples" / "robots" / "table2.yaml")


def late(robot, table, delays):
    """Readings with jitter, each half of a run late by one of the delays in turn of chance."""
    made = []
    for delay in delays:
        late = effect_fit.with_values(robot, ["delay"], {"effects.delay.delay": delay})
        made.append(simulation.simulate(late, table, "jitter", seed=1))
    random = np.random.default_rng(5)
    later = np.zeros(len(table), bool)
    for run in np.unique(table.run):
        for half in np.array_split(np.flatnonzero(table.run == run), 2):
            later[half] = random.random() < 0.5
    choose = later[:, None]
    return replace(
        made[0],
        position=np.where(choose, made[1].position, made[0].position),
        quaternion=np.where(choose, made[1].quaternion, made[0].quaternion),
    )


@pytest.fixture(scope="module")
def steps(robot, recorded):
    return diagnose(robot, late(robot, recorded, DELAYS))


@pytest.fixture(scope="module")
def steady(robot, recorded):
    return diagnose(robot, late(robot, recorded, (DELAYS[0], DELAYS[0])))


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
