"""A reading in another equilibrium than the one that the model predicts is called a snap, any other an outlier."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import Model
from ctcr.audit import snaps
from ctcr.compare import analysis
from ctcr.compare.summary import findings
from ctcr.diagnose.outliers import messages
from ctcr.frames import base_to_tracker
from ctcr.model.table_poses import predict
from ctcr.robot import robot_file
from ctcr.table.measurements import Measurements

TABLE2 = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"
BETA = np.array([-0.36, -0.23, -0.10])
OPPOSED, ALIGNED = np.array([0.3, 0.3 + np.pi, 0.2]), np.array([0.3, 0.3, 0.2])


@pytest.fixture(scope="module")
def robot():
    """Table II with four times the curvature: where tubes are opposed it rests in several shapes."""
    robot = robot_file.load(TABLE2)
    tubes = [tube.model_copy(update={"curvature_per_m": 4 * tube.curvature_per_m}) for tube in robot.tubes]
    return robot.model_copy(update={"tubes": tubes})


def readings(robot, alpha, position):
    """A table of one reading, at the joints of the robot."""
    beta, alpha = BETA - robot.actuation.translation_correction, alpha - robot.actuation.rotation_correction
    quaternion = np.array([[1.0, 0.0, 0.0, 0.0]])
    return Measurements.of_joints(beta[None], alpha[None], position=position[None], quaternion=quaternion)


def in_tracker(robot, position):
    return base_to_tracker(robot.tracker, position[None], np.array([[1.0, 0.0, 0.0, 0.0]]))[0][0]


def test_all_shapes(robot):
    """The first is the one that the model predicts; all are stable, differ, and begin at the plate."""
    model = Model(robot)
    shapes = model.all_shapes(BETA, OPPOSED)
    assert len(shapes) > 1 and all(0 < shape.stability for shape in shapes)
    np.testing.assert_allclose(shapes[0].position, model.shape(BETA, OPPOSED).position, atol=1e-12)
    tips = np.array([shape.position[-1] for shape in shapes])
    apart = np.linalg.norm(tips[:, None] - tips, axis=2)
    assert apart[~np.eye(len(tips), dtype=bool)].min() > 1e-3
    for shape in shapes:
        np.testing.assert_allclose(shape.position[0], 0, atol=1e-9)
        tangent = np.diff(shape.position, axis=0) / np.diff(shape.arc_length)[:, None]
        np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1, atol=1e-3)
    assert len(model.all_shapes(BETA, ALIGNED)) == 1


def test_snap_or_outlier(robot):
    """Noise-free readings of the other equilibria are snaps; none is where the robot has one shape."""
    first, *others = Model(robot).all_shapes(BETA, OPPOSED)
    for other in others:
        table = readings(robot, OPPOSED, in_tracker(robot, other.position[-1]))
        assert np.linalg.norm(snaps.other_tips(robot, table, 0) - table.position[0], axis=1).min() < 1e-5
        assert "a snap: another stable equilibrium" in said(robot, table, first)
        beside = first.position[-1] - (other.position[-1] - first.position[-1])
        table = readings(robot, OPPOSED, in_tracker(robot, beside))
        assert "an outlier of the tracker: the nearest other equilibrium" in said(robot, table, first)
    table = readings(robot, ALIGNED, in_tracker(robot, first.position[-1]))
    assert len(snaps.other_tips(robot, table, 0)) == 0
    assert "no other stable equilibrium there" in said(robot, table, Model(robot).shape(BETA, ALIGNED))


def test_comparison(robot):
    """Of a robot that rests elsewhere in one reading, and is noisy in all, that reading is said to be a snap."""
    random = np.random.default_rng(3)
    first, other, *_ = Model(robot).all_shapes(BETA, OPPOSED)
    tips = np.array([in_tracker(robot, shape.position[-1]) for shape in [first] * 9 + [other]])
    table = readings(robot, OPPOSED, tips[0]).rows(np.zeros(10, int))
    table = replace(table, t=np.arange(10.0), position=tips + 1e-3 * random.normal(size=tips.shape), quaternion=None)
    prediction = predict(robot, table)
    assert snaps.snapped(robot, table, prediction).tolist() == [9]
    compared = analysis.compare(robot, table, prediction, snapped=[11])
    assert any("1 reading (11) lies at another stable equilibrium" in one.text for one in findings(compared))
    spike = replace(table, position=np.where(np.arange(10)[:, None] == 9, tips[0] + 0.05, table.position))
    assert len(snaps.snapped(robot, spike, prediction)) == 0


def said(robot, table, predicted):
    """What is said of the one reading of a table, if the fit predicts this shape."""
    residual = np.zeros((1, 6))
    residual[0, :3] = in_tracker(robot, predicted.position[-1]) - table.position[0]
    square = np.full((1, 2), 3 * 3.5e-5**2)
    fit = SimpleNamespace(apply=lambda _: robot, residual=residual, expected_square=square, inflation=np.ones(2))
    (message,) = messages(robot, table, fit, np.ones(1, bool))
    size = 1e3 * np.linalg.norm(residual[0, :3])
    assert message.startswith(f"The reading in row 2 is {size:.2g} mm off") and message.endswith(
        "The errors are without it"
    )
    return message


def test_command(robot, run, tmp_path):
    """`ctcr shape --all` lists and draws all, and says so where there is one."""
    file = tmp_path / "robot.yaml"
    robot_file.save(robot, file)
    beta = ",".join(str(1e3 * value) for value in BETA)
    joints = ["--beta-mm", beta, "--all", "--json", "-", "-o", tmp_path / "robot.png", "--alpha-deg"]
    code, out, err = run("shape", file, *joints, ",".join(map(str, np.rad2deg(OPPOSED))))
    shapes = Model(robot).all_shapes(BETA, OPPOSED)
    found = json.loads(out)["other_equilibria"]
    assert code == 0 and "Tips of the stable equilibria" in err
    np.testing.assert_allclose(
        [one["samples"]["position_m"][-1] for one in found], [shape.position[-1] for shape in shapes[1:]], atol=1e-9
    )
    code, out, err = run("shape", file, *joints, ",".join(map(str, np.rad2deg(ALIGNED))))
    assert code == 0 and json.loads(out)["other_equilibria"] == [] and "No other stable equilibrium" in err
