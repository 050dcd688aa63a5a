"""The joint fit: the truth of the shipped session, its figures, its robot file and report; bad input in words."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import cli, frames, settings
from ctcr.calibrate import joint_fit, report
from ctcr.errors import InputError
from ctcr.fit import folds
from ctcr.fit.sessions import as_sessions
from ctcr.model import fields, table_poses
from ctcr.model.model import Model
from ctcr.robot import robot_file
from ctcr.table import measurements
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parents[3]
DATA = ROOT / "examples" / "data" / "calibration"
ROBOT, TABLE = DATA / "robot.yaml", DATA / "measurements.csv"
FEW = ["tracker.frame", "actuation.home_rotation.*"]


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


@pytest.fixture(scope="module")
def readings():
    return measurements.load(TABLE, 3)


@pytest.fixture(scope="module")
def calibration(robot, readings):
    return joint_fit.calibrate(robot, readings, ["standard"])


def truth(name: str) -> list[float]:
    (row,) = re.findall(rf"\| {name}, [^|]*\|(.*)\|", (DATA / "README.md").read_text())
    return [float(number) for number in row.split("|")]


def rms_mm(robot, readings) -> float:
    """RMS error of a robot file's model, as any other command computes it."""
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    answer = Model(robot, steps=4).predict(beta, alpha, readings.force)
    tip, _ = frames.base_to_tracker(robot.tracker, answer.position, answer.quaternion)
    return 1e3 * float(np.sqrt(np.mean(np.sum((readings.position - tip) ** 2, axis=1))))


def test_truth(calibration):
    """The truth is within its standard deviations."""
    fitted = {item.name: item for item in calibration.fitted}
    pulls = []
    for kind, name in (
        ("youngs_modulus", "Young's modulus"),
        ("length", "length"),
        ("curved_length", "curved length"),
        ("curvature", "curvature"),
        ("home_translation", "home translation"),
        ("home_rotation", "home rotation"),
    ):
        for i, true in enumerate(truth(name)):
            full = f"actuation.{kind}.{i + 1}" if kind.startswith("home") else f"tubes.{i + 1}.{kind}"
            pulls.append((fitted[full].value - true) / fitted[full].sd)
    assert np.max(np.abs(pulls)) < 3.2 and np.mean(np.square(pulls)) < 2


def test_held_out_error(calibration):
    """The held-out error is near the expected error of a right model."""
    held_out = calibration.held_out
    assert held_out.kind == "runs" and held_out.fits == 4 and held_out.readings == 120
    assert held_out.error.rms_mm < 2 * held_out.floor.rms_mm  # one smooth field error has few degrees of freedom
    nominal, alone, calibrated = calibration.stages
    assert nominal.rms_mm > alone.rms_mm > calibrated.rms_mm
    assert 0.7 < calibration.fit.reduced_chi_square < 1.3
    assert calibration.halves.rms_mm < 1.5 * calibration.halves.noise_mm


def test_written_file(calibration, readings, tmp_path):
    """Homes, turned frame and recorded homes together: the file's model has the error that the fit reports."""
    calibration.save(tmp_path / "new.yaml")
    written = robot_file.load(tmp_path / "new.yaml")
    assert rms_mm(written, readings) == pytest.approx(calibration.stages[-1].rms_mm, abs=2e-4)
    assert written.uncertainty == calibration.before.uncertainty
    figures = written.history[0]["figures"]["rms_mm"]
    assert figures["held_out"] == pytest.approx(calibration.held_out.error.rms_mm, rel=1e-6)
    assert list(figures) == ["nominal", "frame_alone", "calibrated", "held_out", "noise_floor"]


@pytest.mark.parametrize("effects", [{}, {"backlash_rotation": {"play": [0.001, 0.001, 0.001]}}])
def test_many_rows(robot, readings, effects, monkeypatch):
    """Where a part of the rows judges noise and held-out runs, all of them are fitted as before."""
    bench = robot.with_effects(effects)
    at_once = joint_fit.calibrate(bench, readings, FEW, noise="jitter", halves=False)
    monkeypatch.setattr(settings, "CROSS_VALIDATION_ROWS", 60)
    parted = joint_fit.calibrate(bench, readings, FEW, noise="jitter")
    assert parted.n_readings == at_once.n_readings > 60 >= parted.held_out.readings > 50
    np.testing.assert_array_less(np.abs(parted.fit.values - at_once.fit.values), 0.05 * at_once.fit.sd)
    assert parted.held_out.error.rms_mm == pytest.approx(at_once.held_out.error.rms_mm, rel=0.3)
    assert parted.halves.rms_mm < 5 * parted.halves.noise_mm


def test_fixed_point(calibration, readings):
    """A calibrated file is a fixed point."""
    again = joint_fit.calibrate(calibration.after, readings, FEW, hold_out=0, halves=False)
    assert again.stages[0].rms_mm == pytest.approx(calibration.stages[-1].rms_mm, abs=1e-6)
    assert np.max(np.abs(again.fit.shift)) < 1


def test_report(calibration):
    """The report is one page that needs nothing else."""
    page = report.page(calibration)
    shown = page.split("<script>")[0]
    for title in (
        "What calibration brings",
        "The parameters",
        "What the data cannot tell apart",
        "Two halves of the data",
    ):
        assert f"<h2>{title}</h2>" in shown
    assert shown.count("<svg") == 6 and "expected error" in shown
    assert not re.search(r"""(?:src|href)=["']https?:""", shown)
    drawing = json.loads(re.search(r'<script type="application/json">(.*)</script>', page)[1])
    assert [layer.get("choice") for layer in drawing["layers"]] == [None, 0, 1] and len(drawing["choices"]) == 2


def test_headline(calibration):
    """The line on a calibration compares errors of the same readings and says which way they went; the error on
    held-out readings stands beside them."""
    first, last = calibration.stages[0].rms_mm, calibration.stages[-1].rms_mm
    held = calibration.held_out.error.rms_mm
    assert f"{first:.3g} to {last:.3g} mm RMS, {held:.3g} mm held out" in repr(calibration)
    assert "falls from" in report.headline(calibration)
    assert "rises from" in report.headline(replace(calibration, stages=calibration.stages[::-1]))


def test_json(capsys):
    """JSON holds the figures; standard output holds nothing else."""
    code = cli.run(
        ["calibrate", "fit", str(ROBOT), str(TABLE), "--free", ",".join(FEW), "--hold-out", "3", "--json", "-"]
    )
    printed = capsys.readouterr()
    data = json.loads(printed.out)
    assert code == 0 and "6 parameters" not in printed.out and "9 parameters fitted" in printed.err
    assert data["held_out"]["readings"] == 30 and len(data["parameters"]) == 9
    assert set(data["rms_mm"]) == {"nominal", "frame_alone", "calibrated", "held_out", "noise_floor"}


def outcome(robot, readings, free=None, **options):
    return joint_fit.calibrate(robot, readings, free or FEW, halves=False, **{"hold_out": 0} | options)


def some(readings, keep):
    """The readings at some rows."""
    parts = {name: value[keep] for name, value in vars(readings).items() if isinstance(value, np.ndarray)}
    return replace(readings, **parts)


def said(calibration) -> str:
    return " ".join([*calibration.notices, *report.undetermined(calibration), *calibration.doubts])


def test_one_run(robot, readings):
    """With one run a warning says so, and regions of joint space are held out instead."""
    one = replace(readings, run=np.zeros_like(readings.run))
    found = outcome(robot, one, hold_out=None)
    assert "only one run" in said(found) and found.held_out.kind == "places"
    with pytest.raises(InputError, match="--hold-out 1 needs more than 1 runs: the table has 1"):
        outcome(robot, one, hold_out=1)


def test_no_orientation(robot, readings):
    """A table without orientations gets a warning."""
    found = outcome(robot, replace(readings, quaternion=None))
    assert "no orientation was measured" in said(found).lower() and np.isnan(found.stages[-1].rms_deg)
    assert "look like outliers" not in said(found)


@pytest.fixture(scope="module")
def loose():
    """The robot before anyone has found how its sensor is glued in, by a file that says so of its roll alone."""
    text = ROBOT.read_text()
    assert text.count("tracker:\n") == 1
    return robot_file.parse(text.replace("tracker:\n", "tracker:\n  sensor_roll: unknown\n").encode())


def spun(readings, roll):
    """The readings of a sensor with other rolls [rad], of all rows or of each."""
    turn = np.multiply.outer(np.broadcast_to(roll, len(readings)), [0.0, 0.0, 1.0])
    turned = frames.product(readings.quaternion, frames.quaternion_from_rotation_vector(turn))
    return replace(readings, quaternion=turned)


@pytest.mark.parametrize("roll_deg", [-175.0, 57.0])
def test_unknown_roll(robot, loose, readings, roll_deg, tmp_path):
    """The fit finds an unknown sensor roll and writes it to the robot file."""
    plain, turned = outcome(robot, readings), spun(readings, np.radians(roll_deg))
    found = outcome(loose, turned)
    (roll,) = (item for item in found.fitted if item.name == "tracker.sensor_rotation.z")
    x, y, z = np.degrees(found.after.tracker.sensor_rotation_vector)
    assert x == y == 0 and abs((z - roll_deg + 180) % 360 - 180) < 3 * roll.sd < 2 and roll.ratio < 0.01
    assert "pose is unknown" in said(found) and found.fit.observations == plain.fit.observations
    others = [item for item in found.fitted if item is not roll]
    assert max(abs(a.value - b.value) / a.sd for a, b in zip(others, plain.fitted, strict=True)) < 1
    found.save(tmp_path / "new.yaml")
    written = robot_file.load(tmp_path / "new.yaml")
    assert written.tracker.sensor_rotation_vector_rad[2] == pytest.approx(np.radians(z), abs=1e-6)
    assert "sensor_roll" not in (tmp_path / "new.yaml").read_text().split("history:")[0]
    again = outcome(written, turned)
    assert again.stages[0].rms_deg == pytest.approx(found.stages[-1].rms_deg, abs=1e-4)


def test_varying_roll(loose, readings):
    """Where the roll differs from reading to reading, positions alone are fitted."""
    rolls = np.random.default_rng(3).uniform(-np.pi, np.pi, len(readings))
    found = outcome(loose, spun(readings, rolls))
    assert "differs from reading to reading" in said(found) and np.isnan(found.stages[-1].rms_deg)
    assert found.fit.observations == 3 * len(readings) and np.max(np.abs(found.fit.shift)) < 4
    found = outcome(loose, replace(readings, quaternion=None))
    assert "rotation is unknown" not in said(found) and np.isnan(found.stages[-1].rms_deg)


def test_constant_joints(robot, readings):
    """Constant joints leave most undetermined."""
    noise = np.random.default_rng(1).normal(0, 3.5e-5, (30, 3))
    one = some(readings, np.zeros(30, int))
    one = replace(one, t=np.arange(30.0), position=one.position + noise)
    found = outcome(robot, one, ["standard"], noise="jitter")
    assert "all joints are the same" in said(found).lower()
    assert sum(item.undetermined for item in found.fitted) > 10


def test_frame_too_far(robot, readings):
    """A frame that is further off than the robot file allows is found all the same, and a notice says so."""
    plain, moved = outcome(robot, readings), robot.model_copy(deep=True)
    moved.tracker.position_mm = [value + 12.0 for value in robot.tracker.position_mm]
    found = outcome(moved, readings)
    assert found.stages[-1].rms_mm < 1.01 * plain.stages[-1].rms_mm
    assert "stated uncertainty of the position of the tracker frame, 0.5 mm, is contradicted" in said(found)
    assert "contradicted" not in said(plain) and plain.as_dict()["widened"] == []


def test_few_rows(robot, readings):
    """Warnings say where the prior decides because few numbers were measured."""
    found = outcome(robot, some(readings, np.arange(2)), ["standard"], hold_out=None)
    assert "for 24 parameters: the prior decides" in said(found) and found.held_out is None
    found = outcome(robot, some(readings, np.arange(5)), ["standard"])
    assert "only 30 numbers were measured for 24 parameters: few are left" in said(found).lower()
    assert "numbers were measured" not in said(outcome(robot, some(readings, np.arange(20)), ["standard"]))


def test_at_a_bound(robot, readings):
    """A value that ends at a bound is a doubt, and its note says so in the table."""
    found = outcome(robot, readings, [*FEW, "tubes.*.poisson_ratio"], sd={"tubes.*.poisson_ratio": 5.0})
    stopped = [item for item in found.fitted if item.flag == "at a bound"]
    assert stopped and all(item.value == 0.5 for item in stopped)
    assert any(text.startswith("Ended at a bound") and stopped[0].name in text for text in found.doubts)
    assert found.as_dict()["notices"] == [*found.doubts, *found.notices]
    assert "bound" not in " ".join(found.notices)


def test_outlying_run(robot, readings):
    """A run that is off as a whole is named, not only its rows."""
    position = readings.position + 0.01 * (readings.run == 2)[:, None] * np.array([0.0, 1.0, 0.0])
    notices = outcome(robot, replace(readings, position=position)).notices
    [text] = [text for text in notices if "look like outliers" in text]
    assert text.endswith("hardly counted: 10 of 10 in run 2.")


def test_frame_refused(robot, readings):
    """A frame that is metres off is refused."""
    with pytest.raises(InputError, match="the measured tips lie [0-9]+ mm from those predicted.*calibrate frame"):
        outcome(robot, replace(readings, position=readings.position + [2.0, 0, 0]))


def test_effects(robot, readings, tmp_path):
    """Effects of the robot file act in the fit, with fixed or fitted values."""
    beside = robot.model_copy(update={"effects": {"sensor_offset": {"x": 2e-3}}})
    beside._source = robot._source
    seen = table_poses.readings(beside, readings)
    position, quaternion = frames.base_to_tracker(robot.tracker, seen.position, seen.quaternion)
    noise = np.random.default_rng(1).normal(0, 3.5e-5, position.shape)
    made = replace(readings, position=position + noise, quaternion=quaternion)

    fixed = outcome(beside, made, noise="jitter")
    assert fixed.stages[0].rms_mm < 0.1 and np.max(np.abs(fixed.fit.shift)) < 1
    assert outcome(robot, made, noise="jitter").stages[-1].rms_mm > 0.5

    neutral = beside.model_copy(update={"effects": {"sensor_offset": {"x": 0.0}}})
    freed = outcome(neutral, made, [*FEW, "effects.sensor_offset.x"], noise="jitter")
    (found,) = [item for item in freed.fitted if item.name.startswith("effects.")]
    assert found.unit == "m" and abs(found.value - 2e-3) < 4 * found.sd < 1e-3
    assert freed.stages[0].rms_mm > 1 > 0.1 > freed.stages[-1].rms_mm
    freed.save(tmp_path / "new.yaml")
    assert robot_file.load(tmp_path / "new.yaml").effects["sensor_offset"]["x"] == pytest.approx(found.value)
    with pytest.raises(InputError, match=r"effects.friction.coefficient.1"):
        outcome(beside, made, ["effects.friction.coefficient.1"])


def test_nothing_measured(robot, readings):
    """Nothing measured is refused."""
    with pytest.raises(InputError, match="no position is measured"):
        outcome(robot, replace(readings, position=None, quaternion=None))


def test_outliers(robot, readings):
    """Outliers are named and hardly move the result."""
    rng = np.random.default_rng(5)
    bad = rng.choice(120, 12, replace=False)
    position = readings.position.copy()
    position[bad] += rng.normal(0, 1, (12, 3)) * 8e-3
    found, clean = outcome(robot, replace(readings, position=position)), outcome(robot, readings)
    named = {int(row) for row in re.search(r"([0-9]+) rows \(([0-9, ]+)", said(found))[2].split(",")}
    assert len(named & set((bad + 2).tolist())) >= 10
    assert np.max(np.abs(found.fit.values - clean.fit.values) / clean.fit.sd) < 1.5


@pytest.mark.parametrize(
    "free, message",
    [
        (["tubes.1.youngs_modulos"], "no parameter is named .*youngs_modulos: did you mean tubes.1.youngs_modulus"),
        (["tracker.frme"], "did you mean tracker.frame"),
        (["tubes.4.length"], "no parameter is named tubes.4.length"),
        (["tubes.1.poisson_ratio"], "tubes.1.poisson_ratio: the robot file does not state the uncertainty"),
    ],
)
def test_bad_names(robot, readings, free, message):
    """Names that do not exist, or lack a prior, are refused."""
    with pytest.raises(InputError, match=message):
        outcome(robot, readings, free)


def test_zero_width(readings):
    """A prior of zero width is refused."""
    text = re.sub(r"rotation_offset_deg: .*", "rotation_offset_deg: 0.0", ROBOT.read_text())
    with pytest.raises(InputError, match=r"home_rotation.\*: the prior standard deviation must be above 0"):
        outcome(robot_file.parse(text.encode()), readings)


@pytest.mark.parametrize("option", ["-o", "--json", "--report"])
def test_refused_input(tmp_path, capsys, option):
    """Refused input writes nothing."""
    lines = [",".join(line.split(",")[:11]) for line in TABLE.read_text().splitlines()]  # nothing is measured
    (tmp_path / "table.csv").write_text("\n".join(lines))
    arguments = ["calibrate", "fit", str(ROBOT), str(tmp_path / "table.csv"), option, str(tmp_path / "out")]
    assert cli.run(arguments) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"] and "Traceback" not in capsys.readouterr().err


def moved_runs(readings) -> tuple:
    """The readings with each run seen in a frame of its own, and those frames' shifts [m] and turns [rad]."""
    rng = np.random.default_rng(8)
    shift, turn = rng.normal(0, 0.02, (12, 3)), rng.normal(0, 0.05, (12, 3))
    origin, index = np.array([-60.0, 20.0, -180.0]) * 1e-3, readings.run
    position = origin + Rotation.from_rotvec(turn[index]).apply(readings.position - origin) + shift[index]
    quaternion = frames.product(frames.quaternion_from_rotation_vector(turn[index]), readings.quaternion)
    return replace(readings, position=position, quaternion=quaternion), shift, turn


def test_run_frames(robot, readings):
    """Where runs are sessions, each has its frame: the calibration is that of the runs in one frame."""
    moved, shift, turn = moved_runs(readings)
    plain, framed = outcome(robot, moved), outcome(robot, as_sessions(robot, moved), ["tubes.*.curvature"])
    assert framed.stages[-1].rms_mm < 0.5 < 10 < plain.stages[-1].rms_mm
    assert framed.stages[0].rms_mm == pytest.approx(plain.stages[0].rms_mm)  # as the readings were taken
    found = framed.readings.sessions
    own = (Rotation.from_rotvec(found.turn[0]).inv() * Rotation.from_rotvec(found.turn)).as_rotvec()
    true = (Rotation.from_rotvec(turn[0]).inv() * Rotation.from_rotvec(turn)).as_rotvec()
    np.testing.assert_allclose(own, true, atol=np.radians(1.0))
    np.testing.assert_allclose(found.shift - found.shift[0], shift - shift[0], atol=2e-3)
    assert len(framed.as_dict()["frames"]) == 12 and "each run has of its own" in report.page(framed)
    with pytest.raises(InputError, match="the frames of the runs are fitted by themselves"):
        outcome(robot, framed.readings, ["tracker.frame"])


def test_split_places(readings):
    """A region of joint space holds every pass through it."""
    there = np.r_[0:120, 119:-1:-1]
    both_ways = replace(some(readings, there), run=np.zeros(240, int))
    split = folds.parts_of(both_ways, lever=0.05, parts=4)
    assert split.kind == "places" and np.mean(split.part[:120] == split.part[120:][::-1]) == 1
    assert np.bincount(split.part).min() > 30


def test_split_runs(readings):
    """Runs left out are spread."""
    for count in range(1, 12):
        split = folds.runs_left_out(readings, count)
        assert len(np.unique(readings.run[split.part == 1])) == count


def test_given_sd(robot, readings):
    """Prior standard deviations that the file does not state can be given."""
    sd = {"tubes.*.poisson_ratio": 0.05, "tubes.1.length": 0.25}
    found = outcome(robot, readings, ["tubes.*.poisson_ratio", "tubes.1.length", *FEW], sd=sd)
    fitted = {item.name: item for item in found.fitted}
    assert [fitted[f"tubes.{i}.poisson_ratio"].prior_sd for i in (1, 2, 3)] == [0.05] * 3
    assert fitted["tubes.1.length"].prior_sd == pytest.approx(0.25)


def test_malformed_sd(capsys):
    """A malformed width is one sentence."""
    assert cli.run(["calibrate", "fit", str(ROBOT), str(TABLE), "--sd", "tubes.1.length"]) == 2
    assert "'tubes.1.length' is not NAME=SD" in capsys.readouterr().err


def doubtful(name: str, value: float, shift: float = 0.0, ratio: float = 0.5) -> list[fields.Fitted]:
    """A fitted parameter by itself; `value` in SI."""
    one = {"prior_mean": 0.3, "values": value, "sd": 0.05, "shift": shift, "ratio": ratio}
    priors = SimpleNamespace(stated=np.array([0.1]), scale=np.ones(1), low=np.array([-0.5]), high=np.array([np.inf]))
    fit = SimpleNamespace(names=[name], priors=priors, **{key: np.array([number]) for key, number in one.items()})
    return fields.fitted(fit)


@pytest.mark.parametrize(
    "item, flag, words",
    [
        (("tubes.2.poisson_ratio", -0.1), "implausible", "tubes.2.poisson_ratio: -0.10 is negative, which no tube is"),
        (("tubes.1.youngs_modulus", 400e9), "implausible", "tubes.1.youngs_modulus: 400 GPa is unusual"),
        (("tubes.1.length", 0.3, -2.4), "moved far", "tubes.1.length (-2.4)"),
        (("tracker.position.x", -0.5), "at a bound", "at a bound of the possible values"),
        (("tracker.position.x", 0.3, 0.1, 0.95), "unknown", "The data do not determine tracker.position.x."),
        (("tracker.position.x", 0.3), "", ""),
    ],
)
def test_doubts(item, flag, words):
    """Implausible values, far moves and silent data are flagged and put into words."""
    fitted = doubtful(*item)
    assert fitted[0].flag == flag and words in " ".join(fields.doubts(fitted))
    assert bool(words) == bool(fields.doubts(fitted))
