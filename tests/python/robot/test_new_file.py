"""New robot files: valid, commented, with what was said in them."""

import io

import pytest
from click.testing import CliRunner
from ctcr.cli import cli
from ctcr.robot import robot_file

CURVED = "length_mm=420,outer_diameter_mm=0.88,inner_diameter_mm=0.65,curved_length_mm=60,radius_mm=80"


@pytest.mark.parametrize("tubes", [1, 2, 3, 4])
def test_examples(run, tmp_path, tubes):
    """Of every number of tubes, nothing in them looks wrong but gravity, which is not known."""
    path = tmp_path / "robot.yaml"
    assert run("init", "-o", path, "--example", tubes)[0] == 0
    robot = robot_file.load(path)
    assert robot.n_tubes == tubes and [doubt.field for doubt in robot_file.warnings(robot)] == ["gravity"]


def test_options(run, tmp_path):
    """A radius is a curvature; everything else may be said too; names may hold anything."""
    path, name = tmp_path / "robot.yaml", 'he said "[red]" \\ \n: # é'
    second = "length_mm=300,outer_diameter_mm=1.3,inner_diameter_mm=1,youngs_modulus_GPa=75,radius_mm=inf"
    arguments = ["--name", name, "--gravity", "-y", "--sensor-on-tube", 2, "--home-mm=-400,-290"]
    code, out, err = run("init", "-o", path, "--tube", CURVED, "--tube", second, *arguments)
    assert code == 0, err
    robot = robot_file.load(path)
    assert robot.tubes[0].curvature == pytest.approx(12.5) and robot.tubes[1].curvature == 0
    assert robot.tubes[1].youngs_modulus == 75e9 and robot.name == name
    assert robot.gravity == [0, -9.80665, 0]
    assert robot.tracker.sensor_on_tube == 2 and robot.actuation.home_translation_mm == [-400, -290]


@pytest.mark.parametrize(("said", "doubted"), [("", True), (",curved_length_mm=0,curvature_per_m=0", False)])
def test_straight(run, tmp_path, said, doubted):
    """A tube that counts as straight because nothing was said of it is named; one that was said to be so is not."""
    tube = "length_mm=300,outer_diameter_mm=1.3,inner_diameter_mm=1"
    code, out, err = run("init", "-o", tmp_path / "robot.yaml", "--tube", CURVED, "--tube", tube + said)
    assert code == 0 and ("tube 2 counts as straight" in out) == doubted and "tube 1 " not in out, err
    assert robot_file.load(tmp_path / "robot.yaml").tubes[1].curvature == 0


def test_questions(tmp_path):
    """Without options it asks; the answers are in the file, tips are flush at home."""
    path = tmp_path / "robot.yaml"
    answers = ["mine", "2", "420", "0.88", "0.65", "flat", "12.5/m", "60", "", "300", "1.3", "1", "0", "70", "-z", "1"]
    done = CliRunner().invoke(cli, ["init", "-o", str(path)], input="\n".join(answers) + "\n")
    assert done.exit_code == 0, done.output
    robot = robot_file.load(path)
    assert robot.name == "mine" and robot.tubes[0].curvature == pytest.approx(12.5)
    assert [tube.youngs_modulus for tube in robot.tubes] == [60e9, 70e9]
    assert robot.actuation.home_translation_mm == [-420, -300] and robot.gravity[2] < -9.8


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--tube", "length_mm=300"], ["outer_diameter_mm is missing", "inner_diameter_mm is missing"]),
        (["--tube", "lenght_mm=3"], ["did you mean length_mm"]),
        (
            ["--tube", CURVED + ",colour=3", "--tube", "length_mm=long"],
            ["--tube 1: colour is no field", "--tube 2: length"],
        ),
        (["--tube", CURVED + ",curvature_per_m=3"], ["say the same"]),
        (["--tube", CURVED.replace("0.88", "0,88")], ["'88' is not FIELD=VALUE; decimals have a point"]),
        (["--tube", CURVED.replace("420", "long")], ["long is not a number"]),
        (["--tube", CURVED, "--tube", CURVED], ["too narrow"]),
        (["--example", 2, "--home-mm=-3"], ["needs 2, one a tube"]),
        (["--example", 2, "--home-mm=400,300"], ["negative behind it"]),
        (["--tube", CURVED.replace("420", "inf")], ["inf is not a number"]),
        (["--example", 2, "--tube", CURVED], ["exclude each other"]),
        (["--example", 1, "--sensor-on-tube", 3], ["3 is not a tube"]),
    ],
)
def test_faults(run, tmp_path, arguments, words):
    """They are errors, and there is no file."""
    path = tmp_path / "robot.yaml"
    code, _, err = run("init", "-o", path, *arguments)
    assert code in (1, 2) and not path.exists()
    assert all(word in err for word in words), err


def test_no_answers(run, tmp_path, monkeypatch):
    """Without anybody who answers, the questions end in an error that points to the options."""
    monkeypatch.setattr("sys.stdin", io.StringIO("mine\n"))
    code, _, err = run("init", "-o", tmp_path / "robot.yaml")
    assert code == 1 and "give options instead" in err and not (tmp_path / "robot.yaml").exists()


def test_existing_files_are_kept(run, tmp_path):
    """A file that exists is not overwritten."""
    path = tmp_path / "robot.yaml"
    path.write_text("mine")
    code, _, err = run("init", "-o", path, "--example", 1)
    assert code == 1 and "exists already" in err and path.read_text() == "mine"
