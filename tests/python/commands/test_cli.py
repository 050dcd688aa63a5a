"""The commands on a model that is always straight: output and files, one clear error, nothing half written."""

import inspect
import json
import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import pytest
from command_line import commands
from ctcr import cli, frames
from ctcr.commands import options
from ctcr.model import model, table_poses
from ctcr.robot import robot_file
from ctcr.robot.table_ii import table_ii
from ctcr.table import measurements

ROOT = Path(__file__).parents[3]
ROBOT = ROOT / "examples" / "robots" / "table2.yaml"
TABLE = ROOT / "examples" / "data" / "demo" / "measurements.csv"


class Straight:
    """A robot that stays straight: its tip is at (0, 0, deployed length), turned by alpha_1 about z."""

    def __init__(self, robot, steps=1, integrator="default"):
        self.lengths = np.array([tube.length for tube in robot.tubes])
        self.steps = steps

    def predict(self, beta, alpha, force=None, moment=None, *, derivatives=False, threads=0):
        length = self.lengths[0] + beta[:, 0]
        position = np.stack([force[:, 0], 0 * length, length], axis=1)
        turn = np.stack([0 * length, 0 * length, alpha[:, 0]], axis=1)
        quaternion = frames.quaternion_from_rotation_vector(turn)
        status = np.where(alpha[:, 0] > 3, 3, 0)
        return model.Prediction(position, quaternion, status, 0 * length + 1, None, None)

    def shape(self, beta, alpha, force=None, moment=None, *, points=200):
        length = np.linspace(0, self.lengths[0] + beta[0], points)
        position = np.outer(length, [0, 0, 1])
        nothing = np.zeros((points, 3))
        return model.Shape(1.0, length, position, np.tile([1.0, 0, 0, 0], (points, 1)), *5 * [nothing])


@pytest.fixture(autouse=True)
def straight(monkeypatch):
    monkeypatch.setattr(model, "Model", Straight)
    monkeypatch.setattr(table_poses, "Model", Straight)
    monkeypatch.setattr(model, "status_text", lambda code: {0: "ok", 3: "not converged"}[code])


@pytest.fixture
def table(tmp_path):
    """A table of 50 rows whose rows 11 and 40 have no solution."""
    rng = np.random.default_rng(6)
    lines = ["t_s,run,beta1_m,beta2_m,beta3_m,alpha1_rad,alpha2_rad,alpha3_rad,fx_N,fy_N,fz_N"]
    for row in range(2, 52):
        beta = np.sort(rng.uniform(-0.15, -0.05, 3))
        alpha = [3.1 if row in (11, 40) else rng.uniform(-3, 3), 0, 0]
        lines.append(",".join(str(x) for x in ["", 0, *beta, *alpha, *rng.normal(size=3)]))
    path = tmp_path / "table.csv"
    path.write_text("\r\n".join(lines) + "\r\n", newline="")
    return path


def test_info(run, tmp_path):
    """It shows the stiffnesses that follow from the file, and values in a wrong unit, with their field."""
    code, out, _ = run("info", ROBOT)
    assert code == 0 and "bending stiffness EI" in out and "Nothing looks wrong" in out
    doubtful = tmp_path / "robot.yaml"
    doubtful.write_text(ROBOT.read_text().replace("length_mm: 463.0", "length_mm: 463000"))
    code, out, _ = run("info", doubtful, "--json", tmp_path / "info.json")
    assert code == 0 and "463000 mm: is this um?" in out
    data = json.loads((tmp_path / "info.json").read_text())
    robot = robot_file.load(doubtful)
    assert [tube["bending_stiffness_N_m2"] for tube in data["derived"]] == [t.bending_stiffness for t in robot.tubes]
    assert data["robot"] == robot.model_dump(exclude_unset=True)
    assert [doubt["field"] for doubt in data["looks_wrong"]] == ["tubes[0].length_mm"]


@pytest.mark.parametrize("frame", ["base", "tracker"])
@pytest.mark.parametrize("chunk", [7, 1 << 16])
def test_predict(run, tmp_path, table, monkeypatch, frame, chunk):
    """Each row is kept and gets the pose of the model in the asked frame, in chunks of any size."""
    monkeypatch.setattr(table_poses, "CHUNK_ROWS", chunk)
    code, out, _ = run("predict", ROBOT, table, "--frame", frame, "-o", tmp_path / "out.csv", "--steps", 3)
    assert code == 0 and "48 of 50 rows" in out
    assert "row 11: not converged" in out and "row 40: not converged" in out
    before, after = table.read_text().splitlines(), (tmp_path / "out.csv").read_text().splitlines()
    assert after[0] == before[0] + ",pred_x_m,pred_y_m,pred_z_m,pred_qw,pred_qx,pred_qy,pred_qz"
    robot, readings = robot_file.load(ROBOT), measurements.load(table, 3)
    answer = Straight(robot).predict(readings.beta, readings.alpha, readings.force)
    position, quaternion = answer.position, answer.quaternion
    if frame == "tracker":
        position, quaternion = frames.base_to_tracker(robot.tracker, position, quaternion)
    for i, (old, new) in enumerate(zip(before[1:], after[1:], strict=True)):
        assert new.startswith(old + ",")
        added = new.removeprefix(old + ",").split(",")
        if i + 2 in (11, 40):
            assert added == [""] * 7
        else:
            np.testing.assert_allclose([float(x) for x in added], [*position[i], *quaternion[i]], atol=1e-9)


def test_unsolved_rows(run, table, tmp_path):
    """predict lists rows without a solution as JSON."""
    predicted = tmp_path / "predicted.csv"
    code, out, err = run("predict", ROBOT, table, "-o", predicted, "--json", "-")
    summary = json.loads(out)
    assert code == 0 and summary["solved"] == 48 and "48 of 50" in err
    assert summary["unsolved"] == [{"row": 11, "status": "not converged"}, {"row": 40, "status": "not converged"}]
    assert "pred_qz" in predicted.read_text()


JOINTS = ["--beta-mm", "-330,-240,-165", "--alpha-deg", "90,0,-30"]


def test_shape(run, tmp_path):
    """The ends of the tubes and a picture."""
    code, out, err = run("shape", ROBOT, *JOINTS, "--force", "0,0.1,0", "--json", "-", "-o", tmp_path / "robot.png")
    assert code == 0 and "Where the tubes end" in err
    ends, data = [133.0, 90.5, 34.0], json.loads(out)
    np.testing.assert_allclose([1e3 * tube["tip_arc_length_m"] for tube in data["tubes"]], ends)
    np.testing.assert_allclose([1e3 * tube["tip_position_m"][2] for tube in data["tubes"]], ends)
    np.testing.assert_allclose(data["tip"]["quaternion_wxyz"], [0.5**0.5, 0, 0, 0.5**0.5])
    picture = (tmp_path / "robot.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 20_000


@pytest.mark.parametrize(
    "name, begins", [("a.svg", b"<?xml"), ("a.pdf", b"%PDF"), ("a.PNG", b"\x89PNG"), ("a", b"\x89PNG")]
)
def test_formats_of_pictures(run, tmp_path, name, begins):
    """The ending of a picture's name says its format."""
    code, _, err = run("shape", ROBOT, *JOINTS, "-o", tmp_path / name)
    assert code == 0 and (tmp_path / name).read_bytes().startswith(begins), err


def test_bench(run, monkeypatch):
    """Every combination of loads and derivatives is timed, and most configurations are solved."""
    from ctcr.commands import bench

    monkeypatch.setattr(bench, "ROWS", 200)
    code, out, _ = run("bench", "--json", "-")
    results = json.loads(out)["results"]
    assert code == 0 and {(r["load"], r["derivatives"]) for r in results} == {
        (load, derivatives) for load in ("none", "tip force") for derivatives in (False, True)
    }
    assert all(90 < result["solved_percent"] < 100 and result["per_second"] > 0 for result in results)


def test_bench_of_a_slow_robot(run, monkeypatch):
    """A robot that is slow to solve is timed on fewer configurations, in bounded time."""
    from ctcr.commands import bench

    predict, seen = Straight.predict, []

    def slow(self, beta, *others, **options):
        seen.append(len(beta))
        time.sleep(1e-4 * len(beta))
        return predict(self, beta, *others, **options)

    monkeypatch.setattr(Straight, "predict", slow)
    monkeypatch.setattr(bench, "SECONDS", 0.02)
    assert run("bench", "--json", "-")[0] == 0 and max(seen) <= 200


def test_bench_joints():
    """They keep the order of the tubes."""
    from ctcr.commands import bench

    lengths = np.array([tube.length for tube in table_ii().tubes])
    beta, alpha = bench.random_joints(table_ii(), 500, np.random.default_rng(2))
    tips = beta + lengths
    assert (np.diff(beta, axis=1) >= 0).all() and (beta <= 0).all() and alpha.shape == beta.shape
    assert (np.diff(tips, axis=1) <= 0).all() and (tips >= 0).all()


def test_built_in_robot():
    """It is the one of the examples."""
    assert table_ii().tubes == robot_file.load(ROBOT).tubes


def test_faulty_table(run, tmp_path, table):
    """The error names row, column and probable unit; nothing is written."""
    lines = table.read_text().splitlines()
    fields = lines[4].split(",")
    lines[4] = ",".join([*fields[:2], "-120", *fields[3:]])
    table.write_text("\n".join(lines))
    code, out, err = run("predict", ROBOT, table, "-o", tmp_path / "out.csv")
    assert (code, out) == (1, "")
    assert err == f"Error: {table}, row 5, beta1_m: -120 m: is this mm?\n"
    assert not (tmp_path / "out.csv").exists()


def test_faulty_robot(run, tmp_path):
    """All faults of the file are listed."""
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT.read_text().replace("poisson_ratio: 0.3", "poisson_ratio: x"))
    code, _, err = run("info", path)
    assert code == 1 and err.count("'x' is not a number") == 3 and "Traceback" not in err


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["info", "absent.yaml"], "absent.yaml: cannot read it: no such file or directory"),
        (["predict", ROBOT, ROBOT, "-o", "x.csv"], "is a robot file, not a table"),
        (["shape", ROBOT, "--beta-mm", "-300,-200,-100", "--alpha-deg", "178,0,0"], "at these joints: not converged"),
    ],
)
def test_errors(run, arguments, message):
    """One sentence and exit code 1."""
    code, out, err = run(*arguments)
    assert code == 1 and message in err and "Traceback" not in err and out == ""


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["info"], "Missing argument 'ROBOT'"),
        (["nonsense"], "No such command 'nonsense'"),
        (["compare", "r.yaml", "t.csv", "--json", "./r.yaml"], "r.yaml is also that of '--json'"),
        (["shape", ROBOT], "Missing option '--beta-mm'"),
        (["shape", ROBOT, "--beta-mm", "-300,-200,nan", "--alpha-deg", "0,0,0"], "is not a list of finite numbers"),
        (["shape", ROBOT, "--beta-mm", "-300,-200,-100", "--alpha-deg", "0,0"], "--alpha-deg: needs 3 numbers"),
        (["shape", ROBOT, "--beta-mm", "-3e5,-2e5,-1e5", "--alpha-deg", "0,0,0"], "--beta-mm: -300 m: is this mm?"),
        (["shape", ROBOT, "--beta-mm", "a,b", "--alpha-deg", "0,0,0"], "is not a list of finite numbers"),
        (["shape", ROBOT, "--beta-mm", "-330,5,-240,5,-165,5", "--alpha-deg", "0,0,0"], "such as -12.5"),
        (["shape", ROBOT, "--beta-mm", "-330,5;-240,5;-165,5", "--alpha-deg", "0,0,0"], "such as 90,0,-30.5: commas"),
        (["compare", "r.yaml", "t.csv", "--json", "a", "--report", "a"], "a is also that of '--json'"),
        (["predict", "r.yaml", "t.csv", "-o", "t.csv"], "t.csv is also that of"),
        (["devices", "--bench", "b.yaml", "--json", "b.yaml"], "b.yaml is also that of '--bench'"),
        (["sensitivity", "r.yaml", "--closed-loop", "s", "--report", "s"], "s is also that of '--closed-loop'"),
        (["sim", "aurora", ROBOT, "--oracle", "'"], "no closing quotation"),
        (["add", ROBOT, "friction"], "give -o"),
        (["add", ROBOT, "friction", "--set", "bla=1", "-o", "x.yaml"], "has no parameter bla"),
        (["calibrate", "fit", ROBOT, TABLE, "-o", "x.yaml", "--in-place"], "give either -o or --in-place"),
        (["calibrate", "fit", ROBOT, TABLE, "--free", "nonsense"], "no parameter is named nonsense"),
        (["calibrate", "fit", ROBOT, TABLE, "--hold-out", "1000"], "--hold-out 1000 needs more than 1000 runs"),
        (["next", ROBOT, TABLE, "--masses", "a"], "--masses a"),
        (["shape", ROBOT, *JOINTS, "-o", "s.txt"], "s.txt: this option writes .png or .svg or .pdf, not .txt"),
        (["compare", ROBOT, TABLE, "--report", "s.pdf"], "s.pdf: this option writes .html, not .pdf"),
        (["import", TABLE, "-o", "s.xlsx"], "s.xlsx: this option writes .csv or .txt, not .xlsx"),
        (["calibrate", "fit", ROBOT, TABLE, "-o", "s.csv"], "s.csv: this option writes .yaml or .yml, not .csv"),
        (["export", ROBOT, "--cpp", "s.py"], "s.py: this option writes .hpp or .h, not .py"),
        (["shape", ROBOT, "--beta-mm", "-300,-200,5", "--alpha-deg", "0,0,0"], "5 mm is in front of the plate"),
    ],
)
def test_usage(run, arguments, message):
    """Exit code 2 where the command line is wrong, also where it would write a file that it reads or writes already."""
    code, out, err = run(*arguments)
    assert code == 2 and message in err and out == ""


def test_bad_news(run, tmp_path):
    """What a command finds is an answer, with exit code 0: values that contradict the robot file are in its JSON, first
    among the notices. A fit that a wrong convention stops gives none."""
    demo, short, long = TABLE.with_name("robot.yaml"), tmp_path / "short.csv", tmp_path / "long.yaml"
    with TABLE.open() as rows:
        short.write_text("".join(row for number, row in enumerate(rows) if not number or number % 20 == 1))
    long.write_text(demo.read_text().replace("length_mm: 330.5", "length_mm: 340.5"))
    free = ["--free", "tubes.2.length,tracker.frame", "--hold-out", 0, "--json", "-", "--anyway"]
    code, out, err = run("calibrate", "fit", long, short, *free)
    found = json.loads(out)
    assert code == 0 and "lengths of the tubes, 1 mm, is contradicted" in found["notices"][0], err
    assert next(p["shift"] for p in found["parameters"] if p["name"] == "tubes.2.length") < -2
    exchanged = tmp_path / "exchanged.csv"
    exchanged.write_text(short.read_text().replace("x_m,y_m", "y_m,x_m"))
    assert run("compare", demo, exchanged)[0] == 0 and run("diagnose", demo, exchanged)[0] == 0
    assert run("calibrate", "fit", demo, exchanged)[0] == 1


@pytest.mark.parametrize("arguments", [["info", str(ROBOT)], ["info", str(ROBOT), "--json", "-"], ["--help"]])
@pytest.mark.parametrize("to, says", [(">/dev/full", "cannot be written: no space left"), (">&-", "")])
def test_output_that_takes_nothing(arguments, to, says):
    """A full standard output is an error of one sentence; a closed one is none: its reader wants nothing."""
    main = [sys.executable, "-c", f"from ctcr.cli import main; main({arguments})"]
    ended = subprocess.run(f"{shlex.join(main)} {to}", shell=True, stderr=subprocess.PIPE, text=True)
    assert bool(ended.returncode) == bool(says) and says in ended.stderr and ended.stderr.count("\n") == bool(says)


def test_interrupt(run, monkeypatch):
    """Exit code 130 after Ctrl+C, as shells have it."""

    def interrupted(path):
        raise KeyboardInterrupt

    monkeypatch.setattr(robot_file, "load", interrupted)
    code, out, err = run("info", ROBOT)
    assert code == 130 and out == "" and err.endswith("Error: stopped\n")


@pytest.mark.parametrize(
    "arguments",
    [("info", "PIPE"), ("import", "PIPE", "-o", "OUT"), ("add", ROBOT, "--diagnosis", "PIPE", "-o", "OUT")]
    + [("predict", ROBOT, "TABLE", "-o", "PIPE"), ("sensitivity", ROBOT, "--open-loop", 1, "--resume", "PIPE")],
)
def test_pipe(run, tmp_path, table, arguments):
    """A pipe is refused and not waited for: as an input, and as an output that nothing reads."""
    files = {"PIPE": tmp_path / "pipe", "OUT": tmp_path / "out", "TABLE": table}
    os.mkfifo(files["PIPE"])
    code, _, err = run(*(files.get(word, word) for word in arguments))
    assert code == 1 and ("is a pipe or a device" in err or "nothing reads this pipe" in err)
    assert not files["OUT"].exists()


@pytest.mark.parametrize(
    "arguments", [("info", "BIG"), ("compare", ROBOT, "BIG"), ("add", ROBOT, "--diagnosis", "BIG", "-o", "OUT")]
)
def test_large_file(run, tmp_path, arguments):
    """A large file that is something else is refused before it is read to its end."""
    files = {"BIG": tmp_path / "big", "OUT": tmp_path / "out"}
    files["BIG"].touch()
    os.truncate(files["BIG"], 1 << 40)
    code, _, err = run(*(files.get(word, word) for word in arguments))
    assert code == 1 and re.search("this is not|is not text", err)


def test_unexpected_error(run, monkeypatch):
    """A sentence too, or with CTCR_DEBUG the traceback."""
    monkeypatch.setattr(robot_file, "load", lambda path: 1 / 0)
    code, _, err = run("info", ROBOT)
    assert code == 1 and "division by zero (ZeroDivisionError" in err and "Traceback" not in err
    monkeypatch.setenv("CTCR_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        cli.run(["info", str(ROBOT)])


def test_missing_core(run, monkeypatch, table, tmp_path):
    """The error says what to install."""

    class Absent:
        def find_spec(self, name, *_):
            if name == "ctcr.model.model":
                raise ModuleNotFoundError("No module named 'ctcr._core'", name="ctcr._core")

    monkeypatch.delitem(sys.modules, "ctcr.model.model")
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])
    code, _, err = run("predict", ROBOT, table, "-o", tmp_path / "out.csv")
    assert code == 1 and "the compiled part of ctcr is missing" in err


def test_help():
    """It names every command and loads no heavy package."""
    code = "import sys; from ctcr.cli import run; run(['--help'])\n"
    code += "print([name for name in ('numpy', 'pydantic', 'rich', 'matplotlib', 'ctcr._core') if name in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert all(f"\n  {name} " in out for name in ("bench", "info", "predict", "shape"))
    assert out.splitlines()[-1] == "[]"


@pytest.mark.parametrize("command", [pytest.param(found, id=" ".join(path)) for path, found in commands()])
def test_options_meet_the_function(command):
    """Every option and argument of a command is a parameter of its function; shared ones arrive as `out`."""
    function = command.callback
    given = {parameter.name for parameter in command.params if parameter.expose_value}
    if "json_target" in given:
        given = given - {"json_target", "report"} | {"out"}
    inspect.signature(function).bind(**dict.fromkeys(given))


COMPILED = {("bench",), ("sensitivity",), ("track",), ("sim", "aurora"), ("sim", "bench")}  # cannot call Python


def test_own_effects():
    """Every command that loads a robot file takes effects of the user's own, but for those of compiled code alone."""
    for path, command in commands():
        names = {parameter.name for parameter in command.params}
        assert ("effects" in names) == (path not in COMPILED and ("robot" in names or path == ("effects",))), path


FILES = {"ROBOT", "ROBOT2", "MEASUREMENTS", "SCENARIO", "LOG", "TABLE", "NEW", "FILE"}


def test_files_are_guarded():
    """Every option and argument that names a file takes part in the search for outputs that are inputs too."""
    for path, command in commands():
        for parameter in command.params:
            name = (parameter.metavar or parameter.name).upper().removesuffix("...")
            if name in FILES or re.search(r"\.\w+$", name):
                assert isinstance(parameter.type, options.File), (path, parameter.opts)


def units(text: str) -> list[str]:
    """The units in brackets."""
    return re.findall(r"\[([^\]]+)\]", text)


def test_one_unit():
    """Lengths are in mm and angles in deg, in the options of all commands; a unit in a name is the one of the help."""
    seen = {}
    for path, command in commands():
        for option in command.params:
            if not isinstance(option, click.Option) or option.is_flag:
                continue
            said, name = units(option.help or ""), max(option.opts, key=len)
            assert not {"m", "rad"} & set(said), (path, name)
            named = [unit for unit in ("mm", "deg") if name.endswith(f"-{unit}")]
            assert not named or not said or said == named, (path, name)
            assert seen.setdefault(name, said) == said, (path, name)


def test_help_points_to_the_formats(run):
    """Commands that read a robot or a table, those of groups too, say where their files are described."""
    for words in (["compare"], ["import"], ["init"], ["calibrate", "fit"]):
        assert "docs/formats.md" in run(*words, "--help")[1]
    assert (ROOT / "docs" / "formats.md").exists()
