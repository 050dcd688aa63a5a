"""Recordings on the simulated bench: test_ethercat.py runs this in `ctcr sim bench` (see on_bench.py)."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from ctcr.bench.devices.motors import Motors
from ctcr.bench.shared.control import request
from ctcr.bench.shared.transmission import joints_of_turns
from ctcr.model import simulation
from ctcr.robot import robot_file
from ctcr.table import measurements
from simulated_bench import ctcr

ROBOT = os.environ["ROBOT_FILE"]
BENCH = os.environ["BENCH_FILE"]
OP = 8  # state of a terminal


@pytest.fixture
def at_known_joints(robot, bench, folder):
    """A fault before may have cost the power, and so the joints."""
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        if not motors.state["homed"]:
            motors.set_joints(joints_of_turns(robot, request(folder, "ethercat", {})["turns"][:6]))


def plan(path, rows, force=0.0):
    """`rows` positions around home; the second half under a weight."""
    robot = robot_file.load(ROBOT)
    home = np.array([*robot.actuation.home_translation_mm, 0, 0, 0]) * 1e-3
    rng = np.random.default_rng(3)
    lines = ["run,beta1_m,beta2_m,beta3_m,alpha1_rad,alpha2_rad,alpha3_rad,fx_N,fy_N,fz_N"]
    for i in range(rows):
        joints = home + np.concatenate([rng.uniform(-2e-3, 2e-3, 3), rng.uniform(-0.15, 0.15, 3)])
        load = -force if i >= rows // 2 else 0.0
        lines.append(",".join(f"{v:.9g}" for v in [i // 4, *joints, 0, load, 0]))
    path.write_text("\n".join(lines) + "\n")
    return path


def recorder(plan, target, *options):
    return ctcr("record", ROBOT, plan, "--bench", BENCH, "-o", target, "--dwell", 0.05, *options)


def record(plan, target, *options):
    command = recorder(plan, target, *options)
    return subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=120)


@pytest.mark.slow
@pytest.mark.usefixtures("at_known_joints")
def test_record(tmp_path, folder, robot):
    """The poses equal the model at the joints of the encoders, under the weight that was hung."""
    path, target = plan(tmp_path / "plan.csv", 4, force=0.1), tmp_path / "out"
    done = record(path, target, "--readings", 2, "--approach", "forward", "--json", "-")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["rms_mm"] < 0.1  # of the homing
    table = measurements.load(target / "measurements.csv", 3)
    assert len(table) == 4 * 3 and (np.diff(table.t) > 0).all()
    poses = table.position.reshape(4, 3, 3)
    assert np.isnan(poses[:, 0]).all() and np.isfinite(poses[:, 1:]).all()  # way point, two readings
    assert (table.alpha[0::3] < table.alpha[1::3]).all() and (table.beta[0::3] < table.beta[1::3]).all()
    np.testing.assert_array_equal(table.force[6:], np.tile([0, -0.1, 0], (6, 1)))
    assert request(folder, "aurora", {})["force"] == [0, 0, 0]  # the next recording begins without a weight
    wanted = measurements.load(path, 3)
    np.testing.assert_allclose(table.beta[1::3], wanted.beta, atol=2e-5)
    exact = simulation.simulate(robot, table, "none")
    error = (table.position - exact.position)[np.isfinite(table.position[:, 0])]
    assert np.abs(error - error.mean(axis=0)).max() < 3e-5
    about = json.loads((target / "session.json").read_text())
    assert about["sittings"][0]["ended"] == "finished" and "missed" in about["sittings"][0]["tracker"]
    assert about["versions"]["pysoem"] and (target / "robot.yaml").read_text() == Path(ROBOT).read_text()
    other = record(path, target, "--readings", 3)
    assert other.returncode == 1 and "holds a recording with readings 2, not 3; approach" in other.stderr


def wait_for_rows(process, table, rows):
    """Until the table holds so many rows below its header."""
    while process.poll() is None and (not table.exists() or table.read_bytes().count(b"\n") < 1 + rows):
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("at_known_joints")
def test_killed_recorder(tmp_path, folder):
    """A recorder killed at a random moment loses nothing, the motors stop, and the same command resumes."""
    path, target = plan(tmp_path / "plan.csv", 8), tmp_path / "out"
    table, rng, kept = target / "measurements.csv", np.random.default_rng(1), b""
    for _ in range(1):  # tools/bench_faults.py kills a hundred times
        process = subprocess.Popen(recorder(path, target), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        lines = kept.count(b"\n")
        wait_for_rows(process, table, lines + 1)
        time.sleep(rng.uniform(0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert table.read_bytes().startswith(kept)
        kept = table.read_bytes()
        end = time.monotonic() + 3
        while max(request(folder, "ethercat", {})["states"][1:]) == OP and time.monotonic() < end:
            time.sleep(0.02)
        assert max(request(folder, "ethercat", {})["states"][1:]) < OP
    done = record(path, target)
    assert done.returncode == 0, done.stderr
    assert "resuming after" in done.stdout and table.read_bytes().startswith(kept)
    read, wanted = measurements.load(table, 3), measurements.load(path, 3)
    assert len(read) == len(wanted) and (np.diff(read.t) > 0).all()
    np.testing.assert_allclose(read.alpha, wanted.alpha, atol=3e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("at_known_joints")
def test_tracker_lost(tmp_path, folder):
    """Unplugged and back, a third of the frames missing, garbage: rows wait, and all are measured."""
    path, target = plan(tmp_path / "plan.csv", 6), tmp_path / "out"
    request(folder, "aurora", {"faults": {"missing": 0.3, "garbage": 0.02}})
    process = subprocess.Popen(recorder(path, target), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    wait_for_rows(process, target / "measurements.csv", 1)
    request(folder, "aurora", {"faults": {"unplugged": True}})
    time.sleep(1.0)
    request(folder, "aurora", {"faults": {"unplugged": False}})
    assert process.wait(60) == 0, process.stderr.read()
    assert np.isfinite(measurements.load(target / "measurements.csv", 3).position).all()
    tracker = json.loads((target / "session.json").read_text())["sittings"][0]["tracker"]
    assert tracker["connections"] >= 2 and tracker["unseen"] > 0
    assert any("port is gone" in fault["text"] for fault in tracker["faults"])


@pytest.mark.slow
def test_blind_tracker(tmp_path, robot, bench, folder):
    """The recording ends after its patience."""
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        motors.set_joints(motors.settings.home)
    request(folder, "aurora", {"faults": {"out_of_volume": True}})
    done = record(plan(tmp_path / "plan.csv", 2), tmp_path / "out", "--patience", 0.5)
    assert done.returncode == 1
    assert "outside of the tracker's volume for 0.5 s" in done.stderr and "it resumes" in done.stderr
