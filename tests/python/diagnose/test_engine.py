"""Fits of a diagnosis: derivatives by fitted and by neutral parameters, released memory, the history before row 1."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr.diagnose.engine import Engine, values_of
from ctcr.effects import catalogue
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from ctcr.table import measurements

DEMO = Path(__file__).parents[3] / "examples" / "data" / "demo"
ADDED = ["effects.tip_load.force_z", "effects.sensor_offset.x"]


@pytest.fixture(scope="module")
def engine():
    robot = robot_file.load(DEMO / "robot.yaml")
    readings = measurements.load(DEMO / "measurements.csv", robot.n_tubes)
    rows = np.arange(len(readings)) % 3 > 0
    return Engine(robot, readings, noise_of_readings(robot, readings), rows, threads=1)


@pytest.fixture(scope="module")
def fit(engine):
    return engine.fit(ADDED[:1], max_iterations=3)


@pytest.mark.parametrize("names", [ADDED, ADDED[::-1], ["tracker.position.x", ADDED[1]]])
def test_derivatives(engine, fit, names):
    """Derivatives are those of the residual, in units of prior sd, in fitted rows alone."""
    columns = engine.derivatives(fit, names)
    everything = list(dict.fromkeys([*fit.names, *names]))
    neutral, sd, _, _ = engine.priors(everything)
    at = dict(zip(everything, neutral, strict=True)) | values_of(fit)
    table = engine.recording(everything)
    values = np.array([at[name] for name in everything])
    for k, name in enumerate(names):
        step = np.zeros(len(everything))
        step[everything.index(name)] = 1e-3 * sd[everything.index(name)]
        there = [table.residual(values + side * step)[0].reshape(-1, 6) for side in (-1, 1)]
        difference = (there[1] - there[0]) / 2e-3
        np.testing.assert_allclose(columns[engine.rows, :, k], difference[engine.rows], rtol=1e-4, atol=1e-8)
        assert np.abs(difference).max() > 1e-5
    assert (columns[~engine.rows] == 0).all()


def test_released_memory(fit):
    """A fit at rest holds no large array, and computes the same again."""
    before = fit.jacobian_all.copy()
    assert any(np.size(part) >= before.size for part in fit.__dict__["_report"])
    rested = replace(fit)
    assert "_report" not in rested.__dict__
    np.testing.assert_array_equal(rested.jacobian_all, before)
    np.testing.assert_array_equal(rested.residual, fit.residual)


@pytest.mark.parametrize("from_home", [True, False])
def test_initial_history(engine, plan, from_home):
    """The readings say whether the robot came to its first row from home or was at rest there."""
    play = [f"effects.backlash_translation.play.{i}" for i in (1, 2, 3)]
    made = catalogue.with_values(engine.robot, ["backlash_translation"], dict.fromkeys(play, 2e-4))
    readings = simulation.simulate(made, replace(plan, from_home=from_home), "jitter", seed=3)
    noise = noise_of_readings(engine.robot, readings)
    taken = Engine(engine.robot, replace(readings, from_home=True), noise, np.ones(len(readings), bool))
    fit = taken.fit(play)
    assert taken.revise_initial_history(fit) is not from_home
    assert taken.measurements.from_home is from_home
    assert not taken.revise_initial_history(taken.fit(play))


def test_jitter_is_no_field(engine):
    """What the field error may explain as well as an effect does not draw the effect to the jitter: over some sessions
    its z-scores are those of noise. At measured positions their mean is 2.5."""
    robot, readings = engine.robot, engine.measurements
    distortion = ["effects.field_distortion.scale"]
    scores = []
    for seed in range(6):
        noisy = simulation.simulate(robot, readings, "jitter", seed=seed)
        one = Engine(robot, noisy, noise_of_readings(robot, noisy), noisy.measured, threads=1)
        fit = one.fit_with_field([], {})
        full = one.fit([], start=values_of(fit), near=True)
        column, (left, jacobian) = full.whiten(one.derivatives(full, distortion))[:, 0], full.whitened()
        column -= jacobian @ np.linalg.lstsq(jacobian, column)[0]
        scores.append(column @ left / np.linalg.norm(column))
    assert abs(np.mean(scores)) < 3 / np.sqrt(len(scores))
