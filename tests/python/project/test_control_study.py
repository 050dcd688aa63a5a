"""The study behind docs/control_effects.md."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from ctcr.model import simulation
from ctcr.table import measurements
from ctcr.track import scenario

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("control_study", ROOT / "tools/control_study.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def path(robot):
    return scenario.load(ROOT / "examples/data/scenarios/S2.yaml", robot.n_tubes)


@pytest.mark.parametrize("hidden", [None, "friction", "softening"])
def test_open_loop(study, robot, path, hidden):
    """The joints that the controller planned period by period are right when the whole motion is simulated at once."""
    known = study.hidden_robot(robot, hidden, np.random.default_rng(study.SEED)) if hidden else robot
    assert study.open_loop(path, known, known).mean() < 0.05


@pytest.mark.slow
def test_known_friction(study, robot, path):
    """A controller whose model has friction follows the path more closely."""
    plant = study.hidden_robot(robot, "friction", np.random.default_rng(study.SEED))
    without = plant.model_copy(update={"effects": {}})
    lacking, knowing = (np.concatenate(study.closed_loop(path, known, plant)) for known in (without, plant))
    assert knowing.mean() < lacking.mean() < 0.1
    assert knowing.max() < 0.5 * lacking.max()


@pytest.mark.slow
def test_found_effect(study, robot, path):
    """With the effect that a diagnosis found, the tip comes nearer to the path."""
    plant = study.hidden_robot(robot, "softening", np.random.default_rng(study.SEED))
    joints = measurements.load(ROOT / "examples/data/plan.csv", robot.n_tubes)
    known, verdict = study.candidates(robot, simulation.simulate(plant, joints, "realistic", study.SEED))
    assert "softening" in verdict
    errors = [study.open_loop(path, controller, plant).mean() for controller in known.values()]
    assert errors == sorted(errors, reverse=True)
