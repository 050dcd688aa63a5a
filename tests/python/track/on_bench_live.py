"""Tests on the simulated bench, of control and calibration: test_live.py runs them in `ctcr sim bench`."""

import json
import os
import re
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ctcr.bench.devices import bench_file, emergency_stop
from ctcr.bench.devices.axis_control import SETTLED
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.shared.control import request
from ctcr.cli import cli
from ctcr.robot import robot_file
from ctcr.table import measurements
from ctcr.track.live import track
from ctcr.track.result import errors_mm
from ctcr.track.runs import run_all
from ruamel.yaml import YAML
from simulated_bench import HOMES, ROOT, T_REF, ctcr, mended_bench

ROBOT = Path(os.environ["ROBOT_FILE"])
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


def test_tracking(tmp_path, folder):
    """Tracking on the bench is as good as that of the simulated robot."""
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
    # The tracker's noise alone is 0.056 mm. A busy computer loses frames: it may cost the mean, hardly the median.
    assert np.median(here) < 0.15 and here.mean() < 0.5 and there.mean() < 0.06
    assert len(said) == 2 and "10 g, run 1: done" in said[1]
    table = measurements.load(tmp_path / "out" / "measurements.csv", 3)
    assert set(table.run) == {1, 2} and (np.diff(table.t) > 0).all()
    np.testing.assert_allclose(table.force[table.run == 2], np.tile([0, -0.0980665, 0], (sum(table.run == 2), 1)))
    about = json.loads((tmp_path / "out" / "session.json").read_text())
    assert about["sittings"][0]["ended"] == "finished"


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
    "cable": ("ethercat", {"unplugged": True}, "no terminal answers"),
    "emergency stop": (None, None, "somebody stopped it"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_fault(tmp_path, folder, fault):
    """A fault stops the run, and the same command resumes it."""
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
def test_a_limit_of_rotation_stops_the_run(tmp_path, folder):
    """The controller knows no limits of rotation, the bench does."""
    bench = tmp_path / "bench.yaml"
    bench.write_text(BENCH.read_text().replace("[-400, 400]]", "[-3, 3]]"))
    with Motors(bench_file.load(BENCH), robot_file.load(ROBOT), folder) as motors:
        motors.connect()
        motors.move(motors.settings.home)
        motors.wait()
    with pytest.raises(DeviceFault, match="a limit of the bench file ended the motion"):
        track(tmp_path / "out", str(ROBOT), scenario(tmp_path / "s.yaml"), str(bench))
    turned = np.array(request(folder, "ethercat", {})["turns"])[5] * 360
    settled = SETTLED * bench_file.load(bench).motors.lag_deg
    assert at_rest(folder) and 2 < abs(turned) < 3 + settled


@pytest.mark.slow
def test_a_tip_that_strays_stops_the_run(tmp_path, folder):
    """Motors that turn the other way than the file says."""
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(ROBOT.read_text().replace("rotation_rev_per_rev: -1.0", "rotation_rev_per_rev: 1.0"))
    with pytest.raises(DeviceFault, match="its tip is .* mm from where it should be: compare transmission"):
        track(tmp_path / "out", str(wrong), scenario(tmp_path / "s.yaml"), str(BENCH), most_error_mm=5.0)
    assert at_rest(folder)


# ---- calibration


def calibrate(*arguments):
    command = ["calibrate", *arguments, "--live", "--bench", quick_bench(arguments[1].parent), "--json", "-"]
    done = CliRunner().invoke(cli, [str(word) for word in command])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def quick_bench(folder):
    text = BENCH.read_text().replace("  current_mA", "  speed_mm_s: 90\n  speed_deg_s: 600\n  current_mA")
    path = folder / "bench.yaml"
    path.write_text(text)
    return path


def test_registration(tmp_path, folder):
    new = tmp_path / "new.yaml"
    found = calibrate(
        "registration",
        tmp_path / "points.csv",
        "--cad",
        BENCH.parent / "cad.csv",
        "--robot",
        ROBOT,
        "-o",
        new,
        "--readings",
        8,
    )
    truth = [*T_REF[0], *T_REF[1]]
    rows = found["values"][:6]
    for row, true in zip(rows, truth, strict=True):
        assert abs(row["value"] - true) < 2 * row["sd"] < 1.0
    assert (tmp_path / "points.csv").read_text().count("\n") == 7
    again = calibrate("registration", tmp_path / "points.csv", "--cad", BENCH.parent / "cad.csv", "--robot", ROBOT)
    assert again["values"] == found["values"]  # nothing is measured anew


def real_frame(path):
    """The robot file with the tracker frame that it really has."""
    document = YAML().load(ROBOT)
    document["tracker"]["position_mm"], document["tracker"]["rotation_vector_rad"] = T_REF
    YAML().dump(document, path)
    return path


def check_offsets(found, folder):
    rows = [row for row in found["values"] if "rotation offset" in row["name"]]
    print("rotation offsets", *(f"{row['value']:.2f} +- {row['sd']:.2f}" for row in rows), "deg, truth", HOMES)
    for row, true in zip(rows, HOMES, strict=True):
        assert abs(row["value"] - true) < 2 * row["sd"] < 1.0
    deployed = request(folder, "aurora", {})["deployed"]
    np.testing.assert_allclose(deployed, [0.05, 0, 0], atol=2e-4)


@pytest.mark.slow
def test_rotation_offsets(tmp_path, folder):
    table, robot = tmp_path / "circles.csv", real_frame(tmp_path / "robot.yaml")
    found = calibrate("rotation-offset", table, "--robot", robot, "--step-deg", 90, "--readings", 4)
    check_offsets(found, folder)
    assert table.read_text().count("\n") == 1 + 3 * 2 * 5


@pytest.mark.slow
def test_interrupted_rotation_offsets(tmp_path, folder):
    """Killed with the second tube out alone, the same command goes on behind the last row."""
    table, robot = tmp_path / "circles.csv", real_frame(tmp_path / "robot.yaml")
    arguments = ["rotation-offset", table, "--robot", robot, "--readings", 4]
    command = ctcr("calibrate", *arguments, "--live", "--bench", quick_bench(tmp_path))
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for_rows(process, table, 50)
    process.kill()
    process.wait()
    kept = table.read_bytes()
    time.sleep(1.0)
    check_offsets(calibrate(*arguments), folder)
    assert table.read_bytes().startswith(kept) and table.read_text().count("\n") == 1 + 3 * 2 * 19
