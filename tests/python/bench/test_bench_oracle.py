"""The simulated bench around another program's robot: that of the independent oracle, or one that does not work."""

import os
import shutil
import sys

import numpy as np
import pytest
from ctcr import cli
from ctcr.bench.simulators.robot import Oracle, SimulatedRobot
from ctcr.errors import InputError
from ctcr.robot import robot_file
from simulated_bench import ROBOT, ROOT, ctcr, running

SERVE = [sys.executable, str(ROOT / "tools" / "oracle" / "serve.py")]


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


@pytest.fixture
def needs_compiler():
    compiler = os.environ.get("CXX", "g++")
    if not shutil.which(compiler):
        pytest.skip(f"the oracle is compiled when it is first used, and {compiler} is not installed")


def test_oracle_and_model(robot, needs_compiler):
    """Turned by the same motors, under the same weights, two independent programs are within a micrometre."""
    theirs, ours = (
        SimulatedRobot(robot, "none", oracle=Oracle([*SERVE, str(ROBOT)], robot)),
        SimulatedRobot(robot, "none"),
    )
    rng = np.random.default_rng(1)
    for k in range(8):
        turns = np.concatenate([rng.uniform(-15, 0, 3), rng.uniform(-0.5, 0.5, 3)])
        for simulated in (theirs, ours):
            simulated.force = np.array([0.0, -0.05 * (k % 2), 0.0])
            simulated.turn(k + 1.0, turns)
        (place, turn), (expected, expected_turn) = theirs.reading(), ours.reading()
        assert np.linalg.norm(place - expected) < 1e-6 and 1 - abs(turn @ expected_turn) < 1e-10


def test_oracle_friction(robot, needs_compiler):
    """The same joints, reached from both sides."""
    simulated = SimulatedRobot(robot, "none", oracle=Oracle([*SERVE, "--friction", "0.02", str(ROBOT)], robot))
    places = []
    for k, turn in enumerate((0.0, 0.2, 0.1, 0.0, 0.1)):
        simulated.turn(k + 1.0, [0, 0, 0, turn, 0, 0])
        places.append(simulated.reading()[0])
    assert np.linalg.norm(places[2] - places[4]) > 1e-4


def test_tracker_sees_oracle(robot, needs_compiler, tmp_path):
    """Through the serial line of the simulated tracker."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    from ctcr.bench.devices.aurora import Aurora

    command = ctcr(
        "sim", "aurora", ROBOT, "--noise", "none", "--folder", tmp_path / "wires", "--oracle", " ".join(SERVE)
    )
    with running(*command), Aurora(str(tmp_path / "wires" / "aurora")) as tracker:
        tracker.connect()
        place = next(r for r in tracker.read().readings if r.handle == 0x0A).position
        np.testing.assert_allclose(place, SimulatedRobot(robot, "none").reading()[0], atol=1e-6)


def test_broken_oracles(robot, capfd):
    """Programs that do not start or answer are named."""
    with pytest.raises(InputError, match="nowhere: does not start"):
        Oracle(["nowhere"], robot)
    for silent in ("true", "echo nonsense"):
        with pytest.raises(InputError, match="the oracle does not answer"):
            SimulatedRobot(robot, "none", oracle=Oracle(silent.split(), robot))
    assert cli.run(["sim", "bench", str(ROBOT), "--oracle", "true", "--hide", "friction.coefficient=0.01"]) == 2
    assert "let the --oracle hide it itself" in capfd.readouterr().err
