"""Effects that users write in Python: neutral values, derivatives, fits, and messages on faults of their files."""

import hashlib
import html
import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import ctcr
import numpy as np
import pytest
from ctcr import cli, inputs, settings
from ctcr.diagnose import add
from ctcr.effects import catalogue, user_effects
from ctcr.effects.user_effects import Effect, Parameter
from ctcr.errors import InputError
from ctcr.frames import matrix_from_rotation_vector
from ctcr.model import recording, simulation, table_poses
from ctcr.model.user_recording import UserRecording
from ctcr.robot import robot_file
from ctcr.track import runs, scenario

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "05_own_effect.py"
JOINTS = ["--beta-mm", "-330,-240,-165", "--alpha-deg", "50,-40,-60"]
NAMES = ["tubes.2.curvature", "tubes.1.length", "actuation.home_rotation.1", "tracker.position.x", "tracker.rotation.y"]


class Everything(Effect):
    """Uses every hook of single rows."""

    id, title, physics = "everything", "t", "p"
    parameters = [Parameter("gain", sigma=0.1, per_tube=True), Parameter("size", unit="m", sigma=1e-3)]

    def joints(self, rows, values):
        return rows.beta + 0.1 * values.size * np.sin(rows.alpha), rows.alpha + values.gain * np.sin(2 * rows.alpha)

    def force(self, rows, values):
        return values.gain[0] * np.stack([rows.beta[:, 0], rows.force[:, 1], np.cos(rows.alpha[:, 1])], axis=1)

    def base(self, rows, values):
        return values.size * np.sin(rows.alpha), values.gain[1] * rows.alpha

    def reading(self, position, rotation, rows, values):
        turn = matrix_from_rotation_vector(values.gain[2] * position)
        return position + values.size * rotation[:, :, 0] + 20 * values.size * position**2, turn @ rotation


@pytest.fixture(scope="module")
def readings(plan):
    return plan


@pytest.fixture
def file(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "mine.py"
        path.write_text("from ctcr.user_effects import Effect, Parameter\nimport numpy as np\n" + text)
        return path

    yield write
    robot_file.user_effects.clear()
    inputs.shared.clear()


def own_names(effect):
    return effect.described(3).names()


def test_neutral_values_change_nothing(robot, readings):
    """An effect with every hook at neutral values predicts the readings of the library."""
    effect = Everything()
    mine = UserRecording(robot, readings, NAMES + own_names(effect), [effect])
    library = recording.recording_of(robot, readings, NAMES)
    x = library.nominal()
    ours, theirs = mine.residual(np.append(x, np.zeros(4)))[0], library.residual(x)[0]
    np.testing.assert_allclose(ours, theirs, atol=1e-12)
    for ours, theirs in zip(mine.predicted(), library.predicted(), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_derivatives(robot, readings):
    """Derivatives by all parameters agree with central differences."""
    effect = Everything()
    names = NAMES + own_names(effect)
    mine = UserRecording(robot, readings, names, [effect])
    x = mine.nominal() + np.array([0.05, 1e-3, 0.01, 1e-3, 0.02, 0.04, -0.03, 0.05, 2e-3])
    residual, jacobian, solved = mine.residual(x, True)
    assert solved and residual.shape == (6 * len(readings),) and jacobian.shape == (residual.size, len(x))
    for k, name in enumerate(names):
        step = 1e-6 if "tracker" in name or "length" in name else 1e-5
        up, down = (mine.residual(x + sign * step * np.eye(len(x))[k])[0] for sign in (1, -1))
        difference = (up - down) / (2 * step)
        scale = np.abs(difference).max()
        np.testing.assert_allclose(jacobian[:, k], difference, atol=2e-5 * scale, err_msg=name)


def test_python_and_library(robot, readings):
    """An effect of the library written in Python gives the same predictions."""

    class Offset(Effect):
        id, title, physics = "offset", "t", "p"
        parameters = [Parameter("x", unit="m", sigma=1e-3)]

        def reading(self, position, rotation, rows, values):
            return position + values.x * rotation[:, :, 0], rotation

    class Pull(Effect):
        id, title, physics = "pull", "t", "p"
        parameters = [Parameter("x", unit="N", sigma=1e-2)]

        def force(self, rows, values):
            return values.x * np.tile([1.0, 0, 0], (len(rows.run), 1))

    class Play(Effect):
        id, title, physics = "play", "t", "p"
        parameters = [Parameter("gap", unit="rad", sigma=1e-2)]

        def joints(self, rows, values):
            alpha = rows.alpha.copy()
            stands = np.zeros(alpha.shape[1])  # as in the library: the robot comes from home
            for i in range(len(alpha)):
                stands = np.clip(stands, rows.alpha[i] - values.gap, rows.alpha[i] + values.gap)
                alpha[i] = stands
            return rows.beta, alpha

    twins = {
        Offset: ("effects.sensor_offset.x", "effects.offset.x", 2e-3),
        Pull: ("effects.tip_load.force_x", "effects.pull.x", 0.02),
        Play: ("effects.backlash_rotation", "effects.play.gap", 0.01),
    }
    library_names = recording.names_of(3)
    for effect, (theirs, ours, value) in twins.items():
        names = [name for name in library_names if name.startswith(theirs)]
        library = recording.recording_of(robot, readings, names)
        mine = UserRecording(robot, readings, [ours], [effect()])
        a = library.residual(np.full(len(names), value), True)
        b = mine.residual(np.array([value]), True)
        np.testing.assert_allclose(b[0], a[0], atol=2e-9, err_msg=ours)
        scale = np.abs(a[1]).sum(axis=1).max()
        np.testing.assert_allclose(b[1][:, 0], a[1].sum(axis=1), atol=1e-5 * scale, err_msg=ours)


def test_base(robot, readings):
    """A moved base equals another tracker frame."""

    class Moved(Effect):
        id, title, physics = "moved", "t", "p"
        parameters = [Parameter("gain", sigma=1e-3)]

        def base(self, rows, values):
            shape = (len(rows.run), 1)
            return values.gain * np.tile([1.0, 2, 3], shape), values.gain * np.tile([0.0, 0, 5], shape)

    weightless = robot.model_copy(update={"gravity": None})
    unloaded = replace(readings, force=0 * readings.force)
    mine = UserRecording(weightless, unloaded, ["effects.moved.gain"], [Moved()])
    mine.residual(np.array([1e-3]))
    turned = matrix_from_rotation_vector([0, 0, 5e-3])
    tip, _ = _tips(weightless, unloaded)
    tracker = weightless.tracker
    expected = (tip @ turned.T + 1e-3 * np.array([1, 2, 3])) @ tracker.rotation.T + tracker.position
    np.testing.assert_allclose(mine.predicted()[0], expected, atol=1e-9)


def _tips(robot, readings):
    found = table_poses.readings(robot, readings, settings.STEPS)
    return found.position, found.quaternion


def test_unsolved_rows(robot, readings):
    """Rows without a solution are left out."""
    beta = readings.beta.copy()
    beta[5] = beta[5][::-1]  # tubes out of order
    mine = UserRecording(robot, replace(readings, beta=beta), own_names(Everything()), [Everything()])
    residual, jacobian, usable = mine.residual(np.zeros(4), True)
    assert usable and mine.unsolved() == [5]
    assert np.isnan(residual.reshape(-1, 6)[5]).all() and np.isfinite(jacobian).all()
    wanted = np.arange(len(readings)) < 3
    mine.activate(wanted.tolist())
    residual = mine.residual(np.zeros(4))[0].reshape(-1, 6)
    assert (np.isfinite(residual).all(axis=1) == wanted).all()


def test_fit(robot, readings, file):
    """A hidden effect of a user is fitted within its uncertainty."""
    (effect,) = user_effects.load(EXAMPLE)
    truth = {f"effects.rotation_pickup.gain.{i + 1}": value for i, value in enumerate((2.0, -1.0, 0.5))}
    hidden = catalogue.with_values(robot, [effect.id], truth)
    made = simulation.simulate(hidden, readings, "jitter", seed=3)
    added = add.add(robot, made, [effect.id], free=["tubes.*.curvature", "actuation.home_rotation.*"])
    for name, value in truth.items():
        found = added.parameters()[name]
        assert abs(found["value"] - value) < 3 * found["sd"], name
        assert found["sd"] < 0.1
    rms = added.rms("rms_mm")
    assert rms["rotation_pickup"] < 0.5 * rms["calibrated"] < rms["nominal"]
    position, _ = _tips(added.robot, made)
    plain, _ = _tips(robot, made)
    true, _ = _tips(hidden, made)
    assert np.linalg.norm(position - true, axis=1).max() < 0.05 * np.linalg.norm(plain - true, axis=1).max()


def test_commands(robot, readings, file, tmp_path, capsys):
    """Every command that loads a robot file takes `--effects FILE`, and without it says what is missing."""
    path = file(GOOD)
    plan, made, new, poses, old = (tmp_path / name for name in ("p.csv", "m.csv", "n.yaml", "q.csv", "o.yaml"))
    simulation.write(replace(readings, position=None, quaternion=None), plan)
    table2 = ROOT / "examples" / "robots" / "table2.yaml"

    def run(*words) -> str:
        code = cli.run([str(word) for word in words])
        printed = capsys.readouterr()
        assert code == 0, printed.err
        return printed.out

    own = ("--effects", path)
    assert "mine" in run("effects", "mine", *own)
    run("add", table2, "mine", "--set", "gain=0.02", "-o", new, *own)
    run("simulate", table2, plan, "--hide", "mine=0.02", "--noise", "none", "-o", made, *own)
    run("predict", new, made, "-o", poses, "--steps", 4, *own)
    columns = np.genfromtxt(poses, delimiter=",", names=True)
    np.testing.assert_allclose(columns["pred_x_m"], columns["x_m"], atol=1e-9)
    assert json.loads(run("compare", new, made, "--json", "-", *own))["position_mm"]["rms"] < 1e-4
    assert "added mine" in run("history", new, *own)
    run("remove", new, "mine", "-o", old, *own)
    assert robot_file.load(old).effects == {}
    run("info", new, *own)
    assert "rows of tables alone: mine" in run("shape", new, *JOINTS, *own)
    run("calibrate", "fit", new, made, "--free", "tubes.1.curvature", "--hold-out", 0, *own)
    run("calibrate", "home", ROOT / "examples/data/calibration/home.csv", "--robot", new, *own)
    run("import", made, "-o", tmp_path / "imported.csv", "--robot", new, *own)
    run("join", new, made, "-o", tmp_path / "joined.csv", *own)
    robot_file.user_effects.clear()
    for words in (["predict", new, made, "-o", poses], ["info", new], ["effects", "mine"]):
        assert cli.run(list(map(str, words))) == 1
        assert "give its file: --effects FILE.py" in capsys.readouterr().err


def test_compiled_code(robot, file, tmp_path, capsys):
    """Where compiled code alone runs, commands and functions say that an effect in Python cannot act there."""
    (effect,), new = user_effects.load(file(GOOD)), tmp_path / "new.yaml"
    mine = catalogue.with_values(robot, [effect.id], {})
    robot_file.save(mine, new)
    path = ROOT / "examples" / "data" / "scenarios" / "S1.yaml"
    plain = ROOT / "examples" / "robots" / "table2.yaml"
    for words in (
        ["export", new, "--cpp", tmp_path / "x.hpp"],
        ["track", new, path],
        ["track", plain, path, "--plant", new],
        ["sensitivity", new, "--open-loop", 1],
        ["bench", new],
        ["sim", "aurora", new, "--folder", tmp_path / "wires"],
    ):
        assert cli.run([str(word) for word in words]) == 1
        said = capsys.readouterr().err
        assert "effects.mine: is no effect of the library: effects written in Python cannot act here" in said
        assert "did you mean" not in said
    wanted = scenario.load(path, 3)
    for given in ((mine, robot), (robot, mine)):
        with pytest.raises(InputError, match="mine is written in Python"):
            runs.run_all(wanted, *given)


def test_next_command(robot, readings, file, tmp_path, capsys):
    """The command that a diagnosis proposes on the terminal and on its page does what it says when it is copied."""
    folder = tmp_path / "a b"
    folder.mkdir()
    mine = file(GOOD).rename(folder / "mine.py")
    table2, made, page = (folder / name for name in ("robot.yaml", "made.csv", "page.html"))
    table2.write_text((ROOT / "examples" / "robots" / "table2.yaml").read_text())
    (effect,) = user_effects.load(mine)
    hidden = catalogue.with_values(robot, [effect.id], {"effects.mine.gain": 0.02})
    simulation.write(simulation.simulate(hidden, readings, "jitter", seed=3), made)
    words = ["diagnose", table2, made, "--effects", mine, "--report", page]
    assert cli.run([str(word) for word in words]) == 0
    (typed,) = re.findall("^To add: (.*)$", capsys.readouterr().out, re.MULTILINE)
    (shown,) = re.findall(r"To add to the robot file what was found:</p>.*?<code>(.*?)</code>", page.read_text())
    assert html.unescape(shown) == typed
    robot_file.user_effects.clear()
    inputs.shared.clear()
    new = tmp_path / "new.yaml"
    command = shlex.split(typed.replace("new.yaml", str(new)))
    assert command[:2] == ["ctcr", "add"] and cli.run(command[1:]) == 0
    assert robot_file.load(new).effects["mine"]["gain"] == pytest.approx(0.02, abs=0.005)


def test_footer(robot, readings, file, tmp_path):
    """A page ends with the file of the user's effects, which decide its result, and its fingerprint."""
    path, page = file(GOOD), tmp_path / "page.html"
    (effect,) = user_effects.load(path)
    ctcr.compare(catalogue.with_values(robot, [effect.id], {}), readings).report(page)
    footer = page.read_text().partition("<footer>")[2]
    assert str(path) in footer and hashlib.sha256(path.read_bytes()).hexdigest()[:12] in footer


GOOD = """
class Mine(Effect):
    id, title, physics = "mine", "t", "p"
    parameters = [Parameter("gain", sigma=0.1)]
    def joints(self, rows, values):
        return rows.beta, rows.alpha + values.gain * rows.alpha
"""


def test_load(file, robot, tmp_path):
    """A loaded file adds its effects to the catalogue and leaves no other file behind."""
    (effect,) = user_effects.load(file(GOOD))
    assert effect.hooks == ["joints"] and "mine" in catalogue.all_effects(1)
    assert catalogue.get("mine", 3).amplitudes == ["effects.mine.gain"]
    assert "mine" not in catalogue.catalogue(3)
    assert not list(tmp_path.glob("__pycache__"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("class Mine(Effect):", "class Mine(Effect:"), "line 4"),
        (("id, title", "_id, title"), "needs an id"),
        (('"mine"', '"friction"'), "the library has an effect of this id"),
        (('"t"', '""'), "mine.title: needs a text"),
        (("sigma=0.1", "sigma=0"), "sigma = 0: needs a number above 0"),
        (("    parameters", "    form_error = 0\n    parameters"), "form_error: 0: needs a number above 0"),
        (("sigma=0.1", "sigma=1, bounds=(1, 2)"), "with the neutral value 0 between"),
        (("sigma=0.1", "sigma=1, shape=True"), "an amplitude of the effect"),
        (("def joints", "def other"), "needs at least one of the functions joints"),
        (("class Mine(Effect)", "class Mine"), "holds no effect"),
        (("import numpy as np", "import nonsense_module"), "nonsense_module"),
        (("import numpy as np", "raise SystemExit"), "line 2: ends the program"),
        (("import numpy as np", "print('loaded')"), "prints 'loaded"),
        (("    def joints", "    def __init__(self): raise SystemExit\n    def joints"), "line 7: ends the program"),
        (("parameters =", "measure = 5; parameters ="), "mine.measure: needs a text"),
    ],
)
def test_faults_of_a_file(change, message, file):
    """Each fault of a file of effects is named with the file."""
    path = file(GOOD)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError) as error:
        user_effects.load(path)
    assert message in str(error.value) and str(path) in str(error.value)


def test_all_faults(file):
    """All faults of an effect are reported at once."""
    text = GOOD.replace('"mine"', '"Mine!"').replace("sigma=0.1", "sigma=-1").replace('"p"', '""')
    with pytest.raises(InputError) as error:
        user_effects.load(file(text))
    assert len(error.value.problems) == 3


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return rows.beta, rows.alpha + 1e-6 + values.gain", "changes alpha by 1e-06 at its neutral values"),
        ("return rows.beta", "must return two arrays"),
        (
            "rows.beta[:] = 0; return rows.beta, rows.alpha",
            "line 8: Mine.joints fails: assignment destination is read-only",
        ),
        ("return rows.beta, rows.alpha[:2]", "it must be ("),
        ("return rows.beta, rows.alpha / (values.gain - values.gain)", "not finite, first in row 2"),
        ("return rows.beta, rows.nothing", "mine.py, line 8: Mine.joints fails"),
        ("return 'a', 'b'", "arrays of numbers"),
        ("raise SystemExit(0)", "mine.py, line 8: Mine.joints ends the program"),
        ("while True: pass", "mine.py, line 8: Mine.joints takes longer than 0.2 s"),
        ("raise GeneratorExit('x')", "mine.py, line 8: Mine.joints fails: x (GeneratorExit)"),
        ("print('seen'); return rows.beta, rows.alpha", "mine.py: Mine.joints prints 'seen\\n' to standard output"),
    ],
)
def test_faults_of_a_function(body, message, file, robot, readings, monkeypatch):
    """Wrong answers of a hook, exceptions and endless calls are named."""
    monkeypatch.setattr(user_effects, "HOOK_SECONDS", 0.2)
    path = file(GOOD)
    path.write_text(path.read_text().replace("return rows.beta, rows.alpha + values.gain * rows.alpha", body))
    own = user_effects.load(path)
    with pytest.raises(InputError) as error, np.errstate(all="ignore"):
        UserRecording(robot, readings, ["effects.mine.gain"], own)
    assert message in str(error.value)


@pytest.mark.parametrize("ending", ["import sys; sys.exit(0)", "print(1)"])
@pytest.mark.parametrize("when", ["values.gain == 0", "values.gain != 0"])
def test_endings_of_a_command(ending, when, file, readings, tmp_path, capsys):
    """A function that would end the program or print, at once or in the middle of a fit, fails the command by name; no
    file is written and nothing printed."""
    path, made, new = file(GOOD), tmp_path / "m.csv", tmp_path / "new.yaml"
    path.write_text(path.read_text().replace("        return", f"        if {when}: {ending}\n        return"))
    table2 = ROOT / "examples" / "robots" / "table2.yaml"
    simulation.write(simulation.simulate(robot_file.load(table2), readings, "jitter"), made)
    fit = ["--fit", made, "--free", "tubes.1.curvature", "--json", "-", "-o", new, "--effects", path]
    assert cli.run([str(word) for word in ("add", table2, "mine", *fit)]) == 1
    printed = capsys.readouterr()
    assert str(path) in printed.err and "Mine.joints" in printed.err and "this should not happen" not in printed.err
    assert printed.out == "" and not new.exists()


def test_unknown_name(robot, readings):
    """A misspelt parameter is refused by its name."""
    with pytest.raises(InputError, match="no parameter is named effects.everything.gian"):
        UserRecording(robot, readings, ["effects.everything.gian"], [Everything()])


class Profile(Effect):
    """A curvature over the curved part and another stiffness, as the robot file may have them."""

    id, title, physics = "profile", "t", "p"
    parameters = [Parameter("bend", unit="1/m", sigma=0.5, per_tube=True), Parameter("stiff", sigma=0.1, per_tube=True)]
    lengths, curved = (0.463, 0.3305, 0.199), 0.05

    def curvature(self, tube, along, values):
        part = np.clip((along - self.lengths[tube - 1] + self.curved) / 1e-6, 0, 1)
        return np.stack([values.bend[tube - 1] * part, 0 * along], axis=1)

    def stiffness(self, tube, along, values):
        return np.full(len(along), 1 + values.stiff[tube - 1])


def test_profiles(robot, readings):
    """Constant profiles equal another curvature and stiffness of the robot file."""
    mine = UserRecording(robot, readings, own_names(Profile()), [Profile()])
    kinds = ("curvature", "youngs_modulus", "poisson_ratio")
    library = recording.recording_of(
        robot, readings, [f"tubes.{i}.{kind}" for kind in kinds for i in (1, 2, 3)], steps=16
    )
    file = library.nominal()
    bend, stiff = np.array([0.5, -0.3, 0.4]), np.array([0.1, -0.05, 0.08])
    np.testing.assert_allclose(mine.residual(np.zeros(6))[0], library.residual(file)[0], atol=1e-12)
    # EI grows with the torsional stiffness EI / (1 + nu) as it is.
    x = np.concatenate([file[:3], file[3:6] * (1 + stiff), (1 + file[6:]) * (1 + stiff) - 1])
    softer = mine.residual(np.append(np.zeros(3), stiff))[0]
    np.testing.assert_allclose(softer, library.residual(x)[0], atol=1e-8)
    assert np.abs(softer - library.residual(file)[0]).max() > 1e-4
    # The step at the start of the curved part lies between two samples of the profile.
    bent, file[:3] = mine.residual(np.append(bend, np.zeros(3)))[0], file[:3] + bend
    change = np.abs(bent - mine.residual(np.zeros(6))[0]).max()
    np.testing.assert_allclose(bent, library.residual(file)[0], atol=0.02 * change)


def test_derivatives_by_profiles(robot, readings):
    """Derivatives by profiles along a tube agree with central differences."""
    names = ["tubes.2.length", *own_names(Profile())]
    mine = UserRecording(robot, readings, names, [Profile()])
    mine.activate((np.arange(len(readings)) % 8 == 0).tolist())
    x = np.array([0.3305, 0.2, -0.1, 0.1, 0.05, 0.02, -0.04])
    jacobian = mine.residual(x, True)[1]
    for k, name in enumerate(names):
        step = 1e-6 if k == 0 else 1e-4
        up, down = (mine.residual(x + sign * step * np.eye(7)[k])[0] for sign in (1, -1))
        difference = np.nan_to_num(up - down) / (2 * step)
        np.testing.assert_allclose(jacobian[:, k], difference, atol=1e-5 * np.abs(difference).max(), err_msg=name)


@pytest.mark.parametrize(
    ("hook", "answer", "message"),
    [
        ("curvature", "np.zeros(len(along))", "must be (201, 2)"),
        ("curvature", "np.ones((len(along), 2))", "changes a tube by 1 at its neutral values"),
        ("stiffness", "0 * along + values.gain", "factor that is not above 0"),
        ("stiffness", "1 / along", "first in sample 1 along the tube"),
    ],
)
def test_faults_of_a_profile(hook, answer, message, file, robot, readings):
    """Wrong answers of a hook along a tube are named."""
    text = GOOD.replace("joints(self, rows, values)", f"{hook}(self, tube, along, values)")
    text = text.replace("rows.beta, rows.alpha + values.gain * rows.alpha", answer)
    with pytest.raises(InputError) as error, np.errstate(divide="ignore"):
        UserRecording(robot, readings, ["effects.mine.gain"], user_effects.load(file(text)))
    assert message in str(error.value)
