"""What the tests of a diagnosis share: a robot, and diagnoses of small sets that several tests look at."""

from pathlib import Path

import numpy as np
import pytest
from ctcr.diagnose import diagnose
from ctcr.robot import robot_file
from hidden_sessions import measured


@pytest.fixture(scope="session")
def robot():
    return robot_file.load(Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml")


@pytest.fixture(scope="session")
def tip_load(robot):
    """The diagnosis of readings with jitter of a robot with a weight at its tip."""
    return diagnose(robot, measured(robot, np.random.default_rng(2), {"effects.tip_load.mass": 2e-3}))
