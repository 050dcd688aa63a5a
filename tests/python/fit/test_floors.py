"""The expected error against what calibrations of right models leave."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr.fit import joint
from ctcr.fit.floors import floors
from ctcr.fit.sessions import as_sessions
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from hidden_sessions import measured
from scipy.spatial.transform import Rotation

EXAMPLE = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"


def with_field(robot, readings, random):
    """The readings with a smooth error of the tracker's field."""
    noise, positions = noise_of_readings(robot, readings), readings.position
    apart = np.sum((positions[:, None] - positions) ** 2, axis=2)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * apart / noise.correlation_length**2))
    root = noise.position_field * vectors * np.sqrt(np.maximum(values, 0.0))
    return replace(readings, position=positions + root @ random.normal(size=positions.shape), quaternion=None)


def each_moved(readings, random):
    """The readings of a tracker that was placed anew before each run."""
    runs, index = np.unique(readings.run, return_inverse=True)
    shift, turn = 4e-3 * random.normal(size=(len(runs), 3))[index], 0.05 * random.normal(size=(len(runs), 3))[index]
    return replace(readings, position=Rotation.from_rotvec(turn).apply(readings.position) + shift)


@pytest.mark.parametrize("own_frames", [False, True])
def test_expected_error(own_frames):
    """The calibration of a right model leaves the expected error on average, with one frame and with one of each run:
    what frames take up of the smooth field is no error."""
    robot = robot_file.load(EXAMPLE)
    robot = robot.model_copy(update={"tracker": robot.tracker.model_copy(update={"accuracy_95_mm": 2.0})})
    left, expected = [], []
    for seed in range(8):
        random = np.random.default_rng(seed)
        readings = with_field(robot, measured(robot, random, {}), random)
        if own_frames:
            readings = as_sessions(robot, each_moved(readings, random))
        alone = noise_of_readings(robot, readings, field=False)
        left.append(joint.fit(robot, readings, noise=alone).rms_mm() ** 2)
        expected.append(floors(robot, readings).expected_error_mm ** 2)
    assert np.sqrt(np.mean(left) / np.mean(expected)) == pytest.approx(1, abs=0.15)
