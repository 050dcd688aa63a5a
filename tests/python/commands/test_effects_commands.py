"""ctcr effects, add, remove, simulate, history, and the effects of a robot in predict, compare and shape."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import ctcr
import numpy as np
import pytest
from ctcr.effects import catalogue
from ctcr.effects.settings import settings
from ctcr.errors import InputError
from ctcr.model import recording, simulation, table_poses
from ctcr.robot import history, robot_file
from ctcr.table import measurements

ROOT = Path(__file__).parents[3]
ROBOT = ROOT / "examples" / "robots" / "table2.yaml"
DEMO = ROOT / "examples" / "data" / "demo" / "measurements.csv"
CALIBRATION = ["tubes.*.curvature", "actuation.home_rotation.*", "tracker.position.*"]


@pytest.fixture
def table(plan, tmp_path):
    path = tmp_path / "plan.csv"
    simulation.write(replace(plan, position=None, quaternion=None), path)
    return path


# ---- ctcr effects


def test_list(run):
    """`ctcr effects` lists every effect of the library."""
    code, out, _ = run("effects")
    assert code == 0
    assert all(identity in out for identity in catalogue.catalogue(3))
    data = json.loads(run("effects", "--json", "-")[1])
    assert [effect["id"] for effect in data["effects"]] == list(catalogue.catalogue(3))


@pytest.mark.parametrize("name", ["friction", "softening", "frame_jump"])
def test_one_effect(run, name):
    """`ctcr effects ID` shows title, reference and parameters."""
    effect = catalogue.get(name, 3)
    code, out, _ = run("effects", name)
    shown = " ".join(out.split())
    assert code == 0
    for part in (effect.title, effect.reference, *(p.name for p in effect.parameters)):
        assert " ".join(part.split()) in shown
    data = json.loads(run("effects", name, "--json", "-")[1])
    assert [p["name"] for p in data["parameters"]] == [p.name for p in effect.parameters]
    assert data["look_alikes"] == list(effect.look_alikes)


def test_an_unknown_effect(run):
    """A misspelt effect is refused with the likely one."""
    code, _, err = run("effects", "fricton")
    assert code == 1 and "did you mean friction?" in err


# ---- values from the command line


def test_settings(robot):
    """Settings reach a parameter of a tube, of all tubes, and of an only effect without its name."""
    assert settings(["friction.coefficient.2=0.02"], robot) == {"effects.friction.coefficient.2": 0.02}
    assert settings(["backlash_rotation=0.02"], robot) == {
        f"effects.backlash_rotation.play.{i}": 0.02 for i in (1, 2, 3)
    }
    assert settings(["gamma=1e-3,0,0"], robot, ["softening"]) == {
        "effects.softening.gamma.1": 1e-3,
        "effects.softening.gamma.2": 0,
        "effects.softening.gamma.3": 0,
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("friction", "needs NAME=VALUE"),
        ("fricton=1", "did you mean friction?"),
        ("friction.coeficient=0", "did you mean coefficient?"),
        ("friction.coefficient.4=0", "a tube from 1 to 3"),
        ("delay.delay.1=0", "one value"),
        ("friction.coefficient=x", "is not a number"),
        ("friction.coefficient=-1", "is impossible"),
        ("friction.coefficient=nan", "is impossible"),
        ("friction.coefficient=0,0", "needs one number, or 3"),
        ("tip_load=1", "name one: mass, force_x"),
    ],
)
def test_faults_of_settings(text, message, robot):
    """Each fault of a setting is named."""
    with pytest.raises(InputError) as error:
        settings([text], robot)
    assert message in str(error.value)


# ---- models


def test_neutral_effects_change_nothing(robot, plan):
    """All effects of the catalogue at neutral values predict the readings of the plain robot."""
    everything = catalogue.with_values(robot, list(catalogue.catalogue(3)), {})
    assert set(everything.effects) == set(catalogue.catalogue(3))
    with_them, without = (recording.recording_of(r, plan, ()) for r in (everything, robot))
    np.testing.assert_allclose(with_them.residual(np.empty(0))[0], without.residual(np.empty(0))[0], atol=1e-12)


def test_model_and_recording(robot, plan, hidden):
    """Without history a model of single poses equals the recording."""
    model = ctcr.Model(robot, steps=4).predict(plan.beta, plan.alpha, plan.force)
    read = table_poses.readings(robot, plan, steps=4)
    np.testing.assert_allclose(read.position, model.position, atol=1e-9)
    bent = hidden(robot, softening="0.01", tip_load__mass="0.002")
    model = ctcr.Model(bent, steps=4).predict(plan.beta, plan.alpha, plan.force)
    with_effects = table_poses.readings(bent, plan, steps=4)
    np.testing.assert_allclose(with_effects.position, model.position, atol=1e-9)
    assert np.linalg.norm(with_effects.position - read.position, axis=1).max() > 1e-4


def test_model_has_no_sensor(robot, plan, hidden):
    """Effects of the sensor do not change the pose of the tube."""
    off = hidden(robot, sensor_offset__x="0.003")
    a, b = (ctcr.Model(r).predict(plan.beta, plan.alpha).position for r in (off, robot))
    np.testing.assert_array_equal(a, b)


def test_refusals_of_a_model(robot, hidden):
    """A model refuses effects that need a history, and other integrators for effects."""
    with pytest.raises(InputError, match="friction, delay need the rows in their order"):
        ctcr.Model(hidden(robot, friction__coefficient="0.01", delay="0.05"))
    with pytest.raises(InputError, match="default integrator, not with rk4"):
        ctcr.Model(hidden(robot, softening="0.01"), integrator="rk4")


def test_remove_undoes_add(run, robot, plan, table, tmp_path, hidden):
    """Removing effects in reverse order restores every parameter and every predicted reading."""
    data, first, second, third, last = (tmp_path / name for name in ("m.csv", "1.yaml", "2.yaml", "3.yaml", "4.yaml"))
    simulation.write(simulation.simulate(hidden(robot, sensor_offset__x="0.001"), plan), data)
    free = ("--free", ",".join(CALIBRATION))
    assert run("add", ROBOT, "sensor_offset", "--fit", data, "-o", first, *free)[0] == 0
    assert run("add", first, "tip_load", "--fit", data, "-o", second, *free)[0] == 0
    assert set(robot_file.load(second).effects) == {"sensor_offset", "tip_load"}
    assert run("remove", second, "tip_load", "-o", third)[0] == 0
    assert run("remove", third, "sensor_offset", "-o", last)[0] == 0
    for before, after in ((first, third), (ROBOT, last)):
        old, new = robot_file.load(before), robot_file.load(after)
        np.testing.assert_array_equal(recording.values(old), recording.values(new))
        np.testing.assert_allclose(
            table_poses.readings(old, plan).position, table_poses.readings(new, plan).position, atol=1e-12
        )
    assert [entry["command"] for entry in robot_file.load(last).history] == [
        "ctcr add sensor_offset",
        "ctcr add tip_load",
        "ctcr remove tip_load",
        "ctcr remove sensor_offset",
    ]


def test_remove_forgets_the_sensor(run, robot, plan, tmp_path, hidden):
    """A pose of the sensor that was not known is not known again once the effect that it was fitted with is gone."""
    given, data, added, last = (tmp_path / name for name in ("0.yaml", "m.csv", "1.yaml", "2.yaml"))
    unknown = "\n  sensor_position_mm: null\n  sensor_rotation_vector_rad: null\n"
    given.write_text(ROBOT.read_text().replace("\n  sensor_on_tube: 1\n", f"\n  sensor_on_tube: 1{unknown}"))
    simulation.write(simulation.simulate(hidden(robot, delay="0.05"), plan), data)
    free = ("--free", ",".join([*CALIBRATION, "tracker.sensor"]))
    assert run("add", given, "delay", "--fit", data, "-o", added, *free)[0] == 0
    assert robot_file.load(added).tracker.sensor_rotation_known
    assert re.search(
        r"The sensor's pose is unknown: .* fit the readings best\.( |$)", robot_file.load(added).history[0]["note"]
    )
    code, out, _ = run("remove", added, "delay", "-o", last)
    old, new = robot_file.load(given), robot_file.load(last)
    assert code == 0 and "changed since" not in out
    assert not new.effects and (old.tracker, old.uncertainty) == (new.tracker, new.uncertainty)


# ---- commands


def test_add_without_measurements(run, tmp_path, robot):
    """A value that is set is written without a fit, the others of the effect at their usual values."""
    target = tmp_path / "new.yaml"
    code, out, _ = run("add", ROBOT, "softening", "--set", "gamma.2=0.01", "-o", target)
    assert code == 0 and "not fitted" in out
    written = robot_file.load(target).effects
    assert written == {"softening": {"gamma": [0, 0.01, 0], "plateau": 0.25, "sharpness": 2}}


def test_add_diagnosis(run, tmp_path, robot):
    """`--diagnosis` adds the effects of an answer, with held choices and neutral amplitudes."""
    answer, target = tmp_path / "diagnosis.json", tmp_path / "new.yaml"
    found = [
        {"class": ["friction", "backlash_rotation"], "parameters": {"law": 1.0, "coefficient.1": 0.3}},
        {"class": ["frame_jump"], "parameters": {"when": 0.25}},
    ]
    answer.write_text(json.dumps({"effects": found}))
    code, _, err = run("add", ROBOT, "--diagnosis", answer, "--set", "delay=0.1", "delay", "-o", target)
    assert code == 0, err
    written = robot_file.load(target).effects
    assert list(written) == ["delay", "friction", "frame_jump"]
    assert written["friction"]["law"] == 1 and written["frame_jump"]["when"] == 0.25
    assert not any(written["friction"]["coefficient"])  # an amplitude is fitted, not taken over


def test_fit_of_a_diagnosis(run, tmp_path, robot, plan, hidden):
    """Only parameters of the answer are fitted: two constitutive laws of friction would share the error of one."""
    data, answer, target = tmp_path / "m.csv", tmp_path / "diagnosis.json", tmp_path / "new.yaml"
    simulation.write(simulation.simulate(hidden(robot, friction__coefficient="0.02"), plan), data)
    parameters = {"law": 1.0, **{f"coefficient.{i}": 0.01 for i in (1, 2, 3)}}
    answer.write_text(json.dumps({"effects": [{"class": ["friction"], "parameters": parameters}]}))
    fit = ("--fit", data, "--free", ",".join(CALIBRATION), "--json", tmp_path / "added.json")
    assert run("add", ROBOT, "--diagnosis", answer, "-o", target, *fit)[0] == 0
    fitted = json.loads((tmp_path / "added.json").read_text())["parameters"]
    assert list(fitted) == catalogue.get("friction", 3).names("coefficient")
    assert robot_file.load(target).effects["friction"]["law"] == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot read it"),
        ("[]", "is not an answer of ctcr diagnose"),
        ("{", "is not an answer"),
        ('{"effects": []}', "nothing was found to add"),
    ],
)
def test_faults_of_a_diagnosis(text, message, run, tmp_path):
    """A file that is no diagnosis is refused with its name."""
    answer = tmp_path / "diagnosis.json"
    if text:
        answer.write_text(text)
    code, _, err = run("add", ROBOT, "--diagnosis", answer, "-o", tmp_path / "x.yaml")
    assert code == 1 and message in err and str(answer) in err


@pytest.mark.parametrize(
    ("arguments", "message", "exits"),
    [
        (["-o", "x.yaml"], "name an effect", 2),
        (["softening"], "give -o", 2),
        (["soften", "-o", "x.yaml"], "did you mean softening?", 1),
        (["softening", "-o", "x.yaml", "--set", "friction=0.1"], "not among the effects to add", 2),
        (["softening", "-o", "x.yaml", "--fit", "none.csv"], "no such file", 1),
        (["softening", DEMO, "-o", "x.yaml"], "is a file and not an effect: --fit", 2),
        (["softening", "-o", "x.yaml", "--fit", "PLAN"], "no measured poses", 1),
        (["softening", "-o", "x.yaml", "--fit", DEMO, "--free", "tubes.9.length"], "no parameter is named", 2),
    ],
)
def test_faults_of_add(arguments, message, exits, run, table, tmp_path, monkeypatch):
    """A refused command says why, and writes nothing."""
    monkeypatch.chdir(tmp_path)
    before = ROBOT.read_bytes()
    code, _, err = run("add", ROBOT, *(table if word == "PLAN" else word for word in arguments))
    assert code == exits and message in err
    assert ROBOT.read_bytes() == before and not (tmp_path / "x.yaml").exists()


def test_output_is_input(run):
    """The robot file is changed with --in-place alone."""
    before = ROBOT.read_bytes()
    code, _, err = run("add", ROBOT, "softening", "-o", ROBOT)
    assert code == 2 and "or --in-place to change it" in err and ROBOT.read_bytes() == before


def test_remove_absent_effect(run, tmp_path):
    """An effect that the robot lacks cannot be removed."""
    code, _, err = run("remove", ROBOT, "friction", "-o", tmp_path / "x.yaml")
    assert code == 1 and "has no effect friction" in err


def test_effects_of_a_robot(run, robot, plan, table, tmp_path):
    """predict, compare and shape use the effects of the robot file."""
    true, made, poses = tmp_path / "true.yaml", tmp_path / "made.csv", tmp_path / "poses.csv"
    assert run("add", ROBOT, "friction", "--set", "coefficient=0.02", "-o", true)[0] == 0
    assert run("simulate", ROBOT, table, "--hide", "friction.coefficient=0.02", "--noise", "none", "-o", made)[0] == 0
    assert run("predict", true, made, "-o", poses, "--steps", 4)[0] == 0
    columns = np.genfromtxt(poses, delimiter=",", names=True)
    for axis in "xyz":
        np.testing.assert_allclose(columns[f"pred_{axis}_m"], columns[f"{axis}_m"], atol=1e-9)
    with_it = json.loads(run("compare", true, made, "--json", "-")[1])
    without = json.loads(run("compare", ROBOT, made, "--json", "-")[1])
    assert with_it["position_mm"]["rms"] < 1e-4 < 0.1 < without["position_mm"]["rms"]
    joints = ("--beta-mm", "-330,-240,-165", "--alpha-deg", "50,-40,-60")
    assert "Left out, as it depends on how the joints were reached: friction" in run("shape", true, *joints)[1]


def test_simulated_noise(robot, plan):
    """Simulated noise has the size of the tracker and follows its seed."""
    exact = simulation.simulate(robot, plan, "none")
    noisy = [simulation.simulate(robot, plan, "jitter", seed) for seed in range(6)]
    error = np.concatenate([made.position - exact.position for made in noisy])
    assert abs(error.std() / 35e-6 - 1) < 4 / np.sqrt(2 * error.size)
    again = simulation.simulate(robot, plan, "jitter", 3)
    np.testing.assert_array_equal(again.position, noisy[3].position)
    field = np.concatenate(
        [simulation.simulate(robot, plan, "realistic", seed).position - exact.position for seed in range(12)]
    )
    inliers = field[np.linalg.norm(field, axis=1) < 1.5e-3]
    assert 0.22e-3 < inliers.std() < 0.40e-3  # 0.31 mm of the field, correlated over the whole table


def test_simulate_round_trip(run, plan, table, tmp_path, robot):
    """`ctcr simulate` writes the table that `measurements.load` reads back."""
    made = tmp_path / "made.csv"
    assert run("simulate", ROBOT, table, "-o", made, "--noise", "jitter", "--seed", 7)[0] == 0
    read, expected = measurements.load(made, 3), simulation.simulate(robot, plan, "jitter", 7)
    for name in ("t", "run", "beta", "alpha", "force", "position", "quaternion"):
        np.testing.assert_allclose(getattr(read, name), getattr(expected, name), atol=1e-10)


# ---- ctcr history


def with_history(robot, *entries):
    return robot.model_copy(update={"history": list(entries)})


def test_waterfall(robot):
    """Each entry begins with the error that the one before ended with."""
    ledger = [
        {"nominal": 3.0, "frame_alone": 2.5, "calibrated": 1.5, "held_out": 1.6, "noise_floor": 0.1},
        {"nominal": 1.6, "calibrated": 1.6, "friction": 0.4, "noise_floor": 0.2},
        {"nominal": 0.4, "calibrated": 0.4, "delay": 0.3, "noise_floor": 0.2},
    ]
    stages = history.waterfall(with_history(robot, *({"figures": {"rms_mm": rms}} for rms in ledger)))
    assert [(stage.name, stage.rms_mm) for stage in stages] == [
        ("robot file", 3.0),
        ("calibrated", 1.6),
        ("friction", 0.4),
        ("delay", 0.3),
        ("expected error", 0.2),
    ]


def test_odd_ledger(robot):
    """Entries of another form are shown as far as they can be read."""
    odd = [{}, {"figures": 3}, {"figures": {"rms_mm": {"nominal": "x"}}}, {"sources": None, "changes": None}]
    made = with_history(robot, *odd)
    assert history.waterfall(made) == [] and len(history.entries(made)) == 4


def test_history_of_a_new_robot(run):
    """A file without a ledger has an empty history."""
    code, out, _ = run("history", ROBOT)
    assert code == 0 and "nothing was changed yet" in out


def test_history_report(run, tmp_path, robot, plan, hidden):
    """The report of a history shows its entries and loads nothing from elsewhere."""
    data, new, page = tmp_path / "m.csv", tmp_path / "new.yaml", tmp_path / "page.html"
    simulation.write(simulation.simulate(hidden(robot, sensor_offset__x="0.001"), plan), data)
    assert run("add", ROBOT, "sensor_offset", "--fit", data, "-o", new, "--free", "tracker.position.*")[0] == 0
    code, out, _ = run("history", new, "--report", page)
    assert code == 0 and "sensor offset" in out and "m.csv" in out and "expected error" in out
    text = page.read_text()
    assert "<svg" in text and 'src="http' not in text and 'href="http' not in text


@pytest.mark.parametrize("end", ["import os; os._exit(0)", "import ctypes; ctypes.string_at(0)"])
def test_end_in_own_effect(tmp_path, end):
    """A user's code that ends the process is an error that names the file, never a success."""
    file = tmp_path / "mine.py"
    file.write_text(end)
    main = f"from ctcr.cli import main; main(['effects', '--effects', {str(file)!r}])"
    ended = subprocess.run([sys.executable, "-c", main], capture_output=True, text=True)
    assert ended.returncode > 0 and f"Error: {file}: " in ended.stderr and ended.stdout == ""
