"""Sensors of unknown pose: a body of markers, centimetres beside the tip and turned anyhow."""

from dataclasses import replace

import numpy as np
import pytest
from conventions_bench import design, session
from ctcr import calibrate, compare, diagnose
from ctcr.audit import sensor_pose
from ctcr.calibrate.frame import tracker_frame
from ctcr.conventions.hypotheses import with_frame
from ctcr.fit import joint
from ctcr.model import parameters, simulation, user_recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from markers import marked, misses, mounted, unknown
from scipy.spatial.transform import Rotation

NAMES = [f"tracker.sensor_{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"]


@pytest.mark.parametrize("oriented", [True, False])
@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
def test_found(n_tubes, oriented):
    """A fit finds the sensor within its uncertainty, and is as good as one that knows it; axes need orientations."""
    for seed in range(3):
        random = np.random.default_rng([seed, n_tubes])
        truth = marked(design(random, n_tubes), random)
        readings = session(truth, random)
        readings = readings if oriented else replace(readings, quaternion=None)
        noise = noise_of_readings(truth, readings, field=False)
        found, known = (joint.fit(one, readings, noise=noise, starts=1) for one in (unknown(truth), truth))
        own = [name for name in NAMES if oriented or "position" in name]
        assert [name for name in found.names if name in NAMES] == own
        sd = np.array([found.sd[found.names.index(name)] for name in own])
        robot = found.apply(robot_of(found, unknown(truth), readings))
        assert (np.abs(misses(robot, truth)[: len(own)]) < 3 * sd).all()
        assert found.rms_mm() == pytest.approx(known.rms_mm(), rel=0.02)


def robot_of(fit, robot, readings):
    """The robot from which a fit counts."""
    return sensor_pose.usable(robot, readings)[0]


@pytest.mark.parametrize("turn_deg", [0.0, 60.0, 179.0])
def test_wide(turn_deg):
    """A fit finds the sensor within a wide uncertainty, far from where the file has it."""
    random = np.random.default_rng(7)
    axis = random.normal(size=3)
    way = Rotation.from_rotvec(np.radians(turn_deg) * axis / np.linalg.norm(axis))
    truth = mounted(design(random, 3), [0.03, -0.01, 0.02], way)
    stated = {"sensor_position_mm": 30.0, "sensor_rotation_deg": 100.0}
    robot = mounted(truth, np.zeros(3), Rotation.identity())
    robot = robot.model_copy(update={"uncertainty": robot.uncertainty.model_copy(update=stated)})
    readings = session(truth, random)
    fit = joint.fit(robot, readings, starts=1)
    sd = np.array([fit.sd[fit.names.index(name)] for name in NAMES])
    assert (np.abs(misses(fit.apply(robot), truth)) < 3 * sd).all()


def test_undetermined():
    """Where the tip never turns, the sensor's place is known no better than the tracker frame, and that is said."""
    random = np.random.default_rng(8)
    robot = marked(design(random, 1), random)
    straight = robot.tubes[0].model_copy(update={"curvature_per_m": 0.0})
    robot = robot.model_copy(update={"tubes": [straight], "gravity": [0.0, 0.0, 0.0]})
    plan = session(robot, random, weight=0.0)
    readings = simulation.simulate(robot, replace(plan, alpha=0 * plan.alpha))
    found = calibrate(unknown(robot), replace(readings, quaternion=None), halves=False, hold_out=0)
    said = " ".join([*found.glance().notes])
    assert "no orientation was measured" in said and "tracker.position.x" in said.split("do not determine")[1]
    sd = [item.sd for item in found.fitted if item.name.startswith("tracker.sensor_position")]
    assert len(sd) == 3 and min(sd) > 0.9 * robot.uncertainty.tracker_frame_mm


def test_derivatives():
    """Derivatives by the sensor's pose are those of differences, with effects of the tracker and without."""
    random = np.random.default_rng(9)
    robot = marked(design(random, 2), random)
    readings = session(robot, random, runs=2, stops=5)
    for effects in (
        {},
        {"sensor_offset": {"x": 1e-3, "turn_y": 0.02}, "field_distortion": {"scale": 0.01, "x_yz": 1e-3}},
    ):
        table = user_recording.recording_of(robot.with_effects(effects), readings, NAMES)
        at = np.array([0.01, -0.02, 0.03, 0.4, -0.7, 0.2])
        jacobian = table.residual(at, True)[1]
        for k, step in enumerate([1e-4] * 3 + [1e-4] * 3):
            move = step * np.eye(6)[k]
            slope = (table.residual(at + move)[0] - table.residual(at - move)[0]) / (2 * step)
            np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-6)


def test_frame_too():
    """Neither the tracker frame nor the sensor's pose need a start."""
    for seed, oriented in ((1, True), (2, False)):
        random = np.random.default_rng(seed)
        truth = marked(design(random, 3), random)
        readings = session(truth, random)
        turn = Rotation.random(random_state=seed).as_matrix()
        readings = readings if oriented else replace(readings, quaternion=None)
        lost = (with_frame(robot, turn, random.uniform(-2, 2, 3)) for robot in (unknown(truth), truth))
        found, known = (tracker_frame(robot, readings).figures["rms_mm"]["after"] for robot in lost)
        assert found < 1.5 * known  # centimetres where either was lost


def test_file(tmp_path):
    """The pose that was found is written, and stays as uncertain as it was; an older file has its roll instead."""
    random = np.random.default_rng(10)
    truth = marked(design(random, 2), random)
    readings = session(truth, random)
    robot_file.save(unknown(truth), tmp_path / "robot.yaml")
    found = calibrate(robot_file.load(tmp_path / "robot.yaml"), readings, halves=False, hold_out=0)
    found.save(tmp_path / "new.yaml")
    written = robot_file.load(tmp_path / "new.yaml")
    assert set(NAMES) <= set(parameters.of_sensor(written))
    np.testing.assert_allclose(misses(written, found.after), 0, atol=1e-6)
    again = joint.fit(written, readings, starts=1)
    assert again.nominal_rms_mm() == pytest.approx(found.fit.rms_mm(), rel=1e-3)


def test_compare_and_diagnose():
    """Of a table of a right robot whose file does not know the marker, nothing is wrong and no effect is missing."""
    random = np.random.default_rng(11)
    truth = marked(design(random, 2), random)
    readings = session(truth, random)
    compared = compare(unknown(truth), readings)
    assert not compared.conventions and compared.position_mm.rms < 5
    assert not diagnose(unknown(truth), readings).accepted
