"""Tests on the simulated bench, of control and calibration: test_live.py runs them in `ctcr sim bench`."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from ctcr import measurements, robot_file
from ctcr.devices import bench_file, emergency_stop
from ctcr.devices.fault import DeviceFault
from ctcr.devices.motors import Motors
from ctcr.simulators.control import request
from ctcr.track.live import track
from ctcr.track.runs import run_all
from ctcr.track.summary import errors_mm

sys.path.insert(0, str(Path(__file__).parent))
from simulated_bench import ROBOT, ROOT, ctcr, mended_bench  # noqa: E402

BENCH = ROOT / "examples" / "data" / "bench" / "bench.yaml"
SCENARIO = (BENCH.parent / "track.yaml").read_text()


@pytest.fixture
def folder():
    """Faults are mended and the joints are known."""
    place = mended_bench()
    with Motors(bench_file.load(BENCH), robot_file.load(ROBOT), place) as motors:
        motors.connect()
        if not motors.state["homed"]:
            motors.set_joints(motors.settings.home)
    return place


def scenario(path, **changes):
    """The example, shorter: one edge of its triangle."""
    text = SCENARIO.replace("[6, -52, 147], [3, -47, 147], [0, -52, 147]]", "[4, -52, 147]]")
    for old, new in changes.items():
        text = text.replace(old.replace("__", ": "), new)
    path.write_text(text.replace("settle_s: 3", "settle_s: 2"))
    return str(path)


def test_tracking_is_as_that_of_the_simulated_robot(tmp_path, folder):
    path = scenario(tmp_path / "s.yaml")
    said = []
    runs, within = track(tmp_path / "out", str(ROBOT), path, str(BENCH), said=said.append)
    robot = robot_file.load(ROBOT)
    simulated = run_all(within, robot, robot)
    for live, ideal in zip(runs, simulated, strict=True):
        assert (live.mass_g, live.repetition) == (ideal.mass_g, ideal.repetition)
        assert live.started and not live.failed and len(live.time) == len(ideal.time)
        np.testing.assert_allclose(live.wanted, ideal.wanted, atol=1e-9)
    here, there = errors_mm(runs), errors_mm(simulated)
    print(f"mean error on the bench {here.mean():.3f} mm, simulated {there.mean():.3f} mm")
    assert here.mean() < 0.15 and there.mean() < 0.06  # the tracker's noise alone is 0.056 mm
    assert len(said) == 2 and "10 g, run 1: done" in said[1]
    table = measurements.load(tmp_path / "out" / "measurements.csv", 3)
    assert set(table.run) == {1, 2} and (np.diff(table.t) > 0).all()
    np.testing.assert_allclose(
        table.force[table.run == 2], np.tile([0, -0.0980665, 0], (sum(table.run == 2), 1))
    )
    about = json.loads((tmp_path / "out" / "session.json").read_text())
    assert about["sittings"][0]["ended"] == "finished" and about["sittings"][0]["tracker"]["missed"] < 10


def tracking(path, target, *options):
    command = ctcr("track", ROBOT, path, "--live", "--bench", BENCH, "-o", target, *options)
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_rows(process, path, rows):
    while process.poll() is None and (not path.exists() or path.read_bytes().count(b"\n") < 1 + rows):
        time.sleep(0.01)


def at_rest(folder):
    time.sleep(0.3)
    turns = request(folder, "ethercat", {})["turns"]
    time.sleep(0.1)
    return np.allclose(request(folder, "ethercat", {})["turns"], turns, atol=1e-9)


FAULTS = {
    "unplugged": ("aurora", {"unplugged": True}, "the port is gone|cannot open the port|no answer"),
    "out of volume": ("aurora", {"out_of_volume": True}, "outside of the tracker's volume for 0.5 s"),
    "stall": ("ethercat", {"stall": 6}, "rotation of tube 3: it does not follow"),
    "cable": ("ethercat", {"unplugged": True}, "no frame came back|does not answer"),
    "emergency stop": (None, None, "somebody stopped it"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_stops_the_run_and_the_same_command_goes_on(tmp_path, folder, fault):
    device, change, says = FAULTS[fault]
    path, target = scenario(tmp_path / "s.yaml", mass_g__="mass_g: [0] #"), tmp_path / "out"
    process = tracking(path, target, "--patience", 0.5)
    wait_for_rows(process, target / "control.csv", 10)
    if device:
        request(folder, device, {"faults": change})
    else:
        emergency_stop.stop(folder, "somebody stopped it")
    assert process.wait(30) == 1
    assert re.search(says, process.stderr.read())
    assert at_rest(folder)
    kept = (target / "measurements.csv").read_bytes()
    mended_bench()
    with Motors(bench_file.load(BENCH), robot_file.load(ROBOT), folder) as motors:
        motors.connect()
        motors.set_joints(motors.joints)
    runs, _ = track(target, str(ROBOT), path, str(BENCH))
    assert len(runs) == 1 and not runs[0].failed
    assert (target / "measurements.csv").read_bytes().startswith(kept)
    about = json.loads((target / "session.json").read_text())
    assert [entry["ended"] for entry in about["runs"]] == ["interrupted", "finished"]


@pytest.mark.slow
def test_killed_while_tracking(tmp_path, folder):
    """The motors stop, what was written stays, and repetitions that were whole are not run again."""
    path, target = (
        scenario(tmp_path / "s.yaml", mass_g__="mass_g: [0] #", repetitions__1="repetitions: 2"),
        tmp_path / "out",
    )
    process = tracking(path, target)
    table = target / "control.csv"
    wait_for_rows(process, table, 1)
    while process.poll() is None and not table.read_text().splitlines()[-1].split(",")[1].startswith("2"):
        time.sleep(0.02)
    process.kill()
    process.wait()
    kept = table.read_bytes()
    assert at_rest(folder)
    runs, _ = track(target, str(ROBOT), path, str(BENCH))
    assert [run.repetition for run in runs] == [1, 2] and not any(run.failed for run in runs)
    assert table.read_bytes().startswith(kept[: kept.rindex(b"\n") + 1])


@pytest.mark.slow
def test_a_third_of_the_frames_may_be_missing(tmp_path, folder):
    path = scenario(tmp_path / "s.yaml", mass_g__="mass_g: [0] #")
    request(folder, "aurora", {"faults": {"missing": 0.3}})
    (run,), _ = track(tmp_path / "out", str(ROBOT), path, str(BENCH))
    print(f"mean error with 30 % of the frames missing {1e3 * run.counted.mean():.3f} mm")
    assert not run.failed and run.counted.mean() < 0.25e-3


@pytest.mark.slow
def test_a_tip_that_strays_stops_the_run(tmp_path, folder):
    """Motors that turn the other way than the file says."""
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(ROBOT.read_text().replace("rotation_rev_per_rev: -1.0", "rotation_rev_per_rev: 1.0"))
    with pytest.raises(DeviceFault, match="its tip is .* mm from where it should be: compare transmission"):
        track(tmp_path / "out", str(wrong), scenario(tmp_path / "s.yaml"), str(BENCH), most_error_mm=5.0)
    assert at_rest(folder)
