"""`ctcr calibrate frame`: the tracker frame from a table alone, wherever the robot file says that it is."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conventions_bench import design, session
from ctcr.calibrate.frame import registered, rms_mm, tracker_frame
from ctcr.conventions.hypotheses import with_frame
from ctcr.errors import InputError
from ctcr.model import simulation
from ctcr.robot import robot_file
from scipy.spatial.transform import Rotation


def somewhere(robot, random):
    """The robot with a tracker frame that has nothing to do with the right one."""
    turn = Rotation.random(random_state=int(random.integers(2**31))).as_matrix()
    return with_frame(robot, turn, random.uniform(-2, 2, 3))


@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
def test_found(n_tubes):
    """The truth lies within the stated uncertainty, wherever the file's frame is, with orientations and without."""
    errors = []
    for seed in range(3):
        random = np.random.default_rng([seed, n_tubes])
        robot = design(random, n_tubes)
        measured = simulation.simulate(robot, session(robot, random), seed=seed)
        readings = replace(measured, quaternion=None) if seed == 2 else measured
        found = tracker_frame(somewhere(robot, random), readings)
        value, sd = np.array([(row.value, row.sd) for row in found.rows[:6]]).T
        turn = Rotation.from_rotvec(value[3:]) * Rotation.from_matrix(robot.tracker.rotation).inv()
        errors.append(np.r_[value[:3] - robot.tracker.position_mm, turn.as_rotvec()] / sd)
        assert found.figures["rms_mm"]["after"] < 0.01 * found.figures["rms_mm"]["before"]
    assert np.abs(errors).max() < 4
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


def test_wrong_file():
    """Where homes and tubes of the file are wrong by many of their deviations, the frame is still the best one with
    these: homes that are not written move none of it."""
    random = np.random.default_rng(9)
    robot = design(random, 2)
    readings = replace(session(robot, random), quaternion=None)
    homes = {"recorded_home_translation_mm": robot.actuation.home_translation_mm}
    homes["home_translation_mm"] = [home + 25.0 for home in robot.actuation.home_translation_mm]
    inner, outer = robot.tubes
    tubes = [inner.model_copy(update={"curvature_per_m": 1.3 * inner.curvature_per_m}), outer]
    wrong = robot.model_copy(update={"tubes": tubes, "actuation": robot.actuation.model_copy(update=homes)})
    found = tracker_frame(wrong, readings)
    assert found.figures["rms_mm"]["after"] < 1.01 * rms_mm(registered(wrong, readings), readings)


def test_unknown_turn():
    """A straight tube that only moves along itself does not tell the turn about it, and this is said."""
    random = np.random.default_rng(4)
    robot = design(random, 1)
    straight = robot.tubes[0].model_copy(update={"curvature_per_m": 0.0})
    robot = robot.model_copy(update={"tubes": [straight], "gravity": [0.0, 0.0, 0.0]})
    plan = session(robot, random, weight=0.0)
    readings = simulation.simulate(robot, replace(plan, alpha=0 * plan.alpha))
    [said] = tracker_frame(somewhere(robot, random), replace(readings, quaternion=None)).notices[:1]
    axis = np.array([float(part) for part in said.split("(")[1].split(")")[0].split(", ")])
    assert "the turn about" in said
    np.testing.assert_allclose(abs(axis @ robot.tracker.rotation[:, 2]), 1, atol=0.02)


def test_too_few():
    """Two positions are no frame."""
    random = np.random.default_rng(5)
    robot = design(random, 2)
    with pytest.raises(InputError, match="2 of the measured positions"):
        tracker_frame(robot, session(robot, random).rows([0, 1]))


def test_command(run, tmp_path):
    """The new robot file has the frame and its sd, and fits the table; another wrong convention is an error."""
    random = np.random.default_rng(6)
    robot = design(random, 2)
    readings = session(robot, random)
    wrong, table, new = (tmp_path / name for name in ("robot.yaml", "measurements.csv", "new.yaml"))
    robot_file.save(somewhere(robot, random), wrong)
    simulation.write(readings, table)
    code, out, error = run("calibrate", "frame", wrong, table, "-o", new, "--json", "-")
    assert code == 0, error
    found = json.loads(out)
    assert robot_file.load(new).tracker.position_mm == pytest.approx([row["value"] for row in found["values"][:3]])
    assert json.loads(run("compare", new, table, "--json", "-")[1])["conventions"] == []
    simulation.write(replace(readings, alpha=readings.alpha * [1, -1]), table)
    code, _, error = run("calibrate", "frame", new, table)
    assert code != 0
    assert "alpha2 counts the other way" in error
