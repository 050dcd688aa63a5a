"""A sensor that is not the tip is taken for no wrong convention, and where the file is wrong on it, that is said."""

import numpy as np
import pytest
from conventions_bench import design, session
from ctcr.conventions import review
from markers import marked, mounted, unknown
from scipy.spatial.transform import Rotation

RIGHT_ANGLES = Rotation.create_group("O")


@pytest.mark.parametrize("n_tubes", [1, 2, 3])
def test_right_angles(n_tubes):
    """All turns by right angles: nothing is wrong where the file does not know them, and the turn where it does."""
    random = np.random.default_rng(n_tubes)
    robot = design(random, n_tubes)
    for turn in RIGHT_ANGLES:
        truth = mounted(robot, [0.0, 0.0, 0.0], turn)
        readings = session(truth, np.random.default_rng(5), runs=3)
        assert not review(unknown(truth), readings).findings
        found = [one.kind for one in review(robot, readings).findings]
        assert found == (["sensor_rotation"] if turn.magnitude() > 0.1 else [])


@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
def test_beside(n_tubes):
    """A marker centimetres beside the tip: the file that puts it at the tip is told so, and nothing else."""
    for seed in range(2):
        random = np.random.default_rng([seed, n_tubes])
        robot = design(random, n_tubes)
        way = random.normal(size=3)
        truth = mounted(robot, random.uniform(0.03, 0.05) * way / np.linalg.norm(way), Rotation.identity())
        readings = session(truth, random)
        assert [one.kind for one in review(robot, readings).findings] == ["sensor_position"]
        assert not review(unknown(truth), readings).findings


def test_both():
    """Its place and its turn are found together."""
    for seed in range(2):
        random = np.random.default_rng(seed)
        robot = design(random, 3)
        truth = marked(robot, random)
        kinds = {one.kind for one in review(robot, session(truth, random)).findings}
        far = np.linalg.norm(truth.tracker.sensor_position) > 0.025
        assert kinds <= {"sensor_position", "sensor_rotation"} and (not far or "sensor_position" in kinds)
