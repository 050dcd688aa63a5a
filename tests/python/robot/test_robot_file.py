"""The robot file: SI units, every fault at once with its line, and round trips."""

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest
from ctcr.errors import InputError
from ctcr.model import parameters
from ctcr.robot import defaults, ledger, new_file, robot_file, yaml_document
from ctcr.robot.description import Robot

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "robots" / "table2.yaml"
TEXT = EXAMPLE.read_text()
SHARED = ROOT.parent / "shared" / "data"


def parse(text: str) -> Robot:
    return robot_file.parse(text.encode(), "robot.yaml")


def faults(text: str) -> list:
    with pytest.raises(InputError) as caught:
        parse(text)
    return list(caught.value.problems)


def edited(text: str, key: str, value: str, occurrence: int = 0) -> tuple[str, int]:
    """The text with the value of the n-th `key` replaced, and the line (from 1) of that key."""
    lines = text.splitlines()
    line = [i for i, each in enumerate(lines) if re.match(rf"[ -]*{key}:", each)][occurrence]
    lines[line] = lines[line][: lines[line].index(":") + 1] + " " + value
    return "\n".join(lines) + "\n", line + 1


def test_si_units():
    """Properties are in SI units and follow from the fields."""
    robot = parse(TEXT)
    for tube in robot.tubes:
        inner, outer = 1e-3 * tube.inner_diameter_mm, 1e-3 * tube.outer_diameter_mm
        stiffness = 1e9 * tube.youngs_modulus_GPa * pi * (outer**4 - inner**4) / 64
        assert tube.bending_stiffness == pytest.approx(stiffness, rel=1e-12)
        assert tube.torsional_stiffness * (1 + tube.poisson_ratio) == pytest.approx(stiffness, rel=1e-12)
        area = pi * (outer**2 - inner**2) / 4
        assert tube.mass_per_length == pytest.approx(tube.density_kg_m3 * area, rel=1e-12)
        assert tube.length == pytest.approx(1e-3 * tube.length_mm)
    known = dict(zip(parameters.names_of(3), parameters.values(robot), strict=True))
    assert known["tubes.1.youngs_modulus"] == pytest.approx(58e9)
    assert known["tubes.2.length"] == pytest.approx(robot.tubes[1].length)
    assert known["tubes.3.bending_stiffness"] == 0


@pytest.mark.parametrize("key", ["-0.25", "true", "null", "2026-01-01"])
@pytest.mark.parametrize("name", ["accuracy_95_deg", "name", "length_mm", "translation_mm_per_rev", "tracker_frame_mm"])
def test_keys_that_are_no_text(name, key):
    """A key that is a number, a truth value, null or a date is a fault, not an exception."""
    assert faults(re.sub(rf"\b{name}:", f"{key}:", TEXT, count=1))


def test_a_date_for_a_name():
    """A value is shown as the file has it, not as Python calls it."""
    (problem,) = faults(re.sub(r"name: \w+", "name: 2026-01-01", TEXT, count=1))
    assert problem.message.startswith("2026-01-01 does not fit: needs text")


def test_bending_stiffness():
    """A given bending stiffness replaces modulus and diameters."""
    lines = [line for line in TEXT.splitlines() if "diameter_mm" not in line and "density" not in line]
    text = "\n".join(lines).replace("youngs_modulus_GPa: 58.0", "bending_stiffness_Nm2: 0.05")
    robot = parse(re.sub(r"gravity:.*\n(- .*\n)+", "gravity: null\n", text + "\n"))
    assert [tube.bending_stiffness for tube in robot.tubes] == [0.05] * 3
    assert parameters.values(robot, ["tubes.2.bending_stiffness", "tubes.2.outer_diameter"]).tolist() == [0.05, 0]
    assert not robot.gravity_vector.any()


def test_weight():
    """Gravity needs the densities of all tubes."""
    text = re.sub(r" +density_kg_m3:.*\n", "", TEXT, count=1)
    assert [problem.field for problem in faults(text)] == ["tubes[0].density_kg_m3"]


SINGLE_FAULTS = [
    ("length_mm", ".nan", "tubes[0].length_mm", "not finite"),
    ("length_mm", ".inf", "tubes[0].length_mm", "not finite"),
    ("length_mm", "-463", "tubes[0].length_mm", "in mm, > 0"),
    ("length_mm", "long", "tubes[0].length_mm", "is not a number"),
    ("length_mm", "463 mm", "tubes[0].length_mm", "in mm"),
    ("length_mm", "true", "tubes[0].length_mm", "is not a number"),
    ("length_mm", "", "tubes[0].length_mm", "is empty"),
    ("length_mm", "[463]", "tubes[0].length_mm", "is not a number"),
    ("length_mm", "180", "tubes[1].length_mm", "no joints fit both"),
    ("curved_length_mm", "500", "tubes[0].curved_length_mm", "length of the tube, 463 mm"),
    ("youngs_modulus_GPa", "0", "tubes[0].youngs_modulus_GPa", "in GPa, > 0"),
    ("poisson_ratio", "0.7", "tubes[0].poisson_ratio", "<= 0.5"),
    ("inner_diameter_mm", "1.6", "tubes[0].outer_diameter_mm", "inner diameter, 1.6 mm"),
    ("outer_diameter_mm", "1.75", "tubes[1].inner_diameter_mm", "tube 1 inside it"),
    ("outer_diameter_mm", "5.1", "tubes[1].inner_diameter_mm", "tube 1 inside it"),
    ("sensor_on_tube", "4", "tracker.sensor_on_tube", "the robot has 3"),
    ("sensor_on_tube", "0", "tracker.sensor_on_tube", "number of a tube"),
    ("sensor_on_tube", "1.5", "tracker.sensor_on_tube", "number of a tube"),
    ("rate_Hz", "0", "tracker.rate_Hz", "in Hz, > 0"),
    ("rate_Hz", "fast", "tracker.rate_Hz", "is not a number"),
    ("home_translation_mm", "[1, 2]", "actuation.home_translation_mm", "one a tube"),
    ("tracker_frame_mm", "-1", "uncertainty.tracker_frame_mm", ">= 0"),
    ("tracker_frame_mm", "[1, 2]", "uncertainty.tracker_frame_mm", "needs 3, one for each axis"),
    ("curvature_percent", "[1, 2]", "uncertainty.curvature_percent", "needs 3, one for each tube"),
    ("length_mm", "[1, one, 2]", "tubes[0].length_mm", "needs a number in mm"),
    ("name", "3", "name", "needs text"),
]


def drop_list(text: str, key: str) -> str:
    """The text with a list of numbers below `key` removed, so that a value can follow on the line."""
    return re.sub(rf"({key}:)[^\n]*\n( *- [^\n:]*\n)+", r"\1\n", text)


@pytest.mark.parametrize("key, value, field, message", SINGLE_FAULTS)
def test_fault(key, value, field, message):
    """A fault is reported once, with its field and line."""
    text, _ = edited(drop_list(TEXT, key) if value.startswith("[1") else TEXT, key, value)
    (problem,) = [problem for problem in faults(text) if problem.field == field]
    assert message in problem.message
    occurrence = int((re.findall(r"\[(\d)\]", field) or ["0"])[0])
    assert problem.line == edited(text, field.split(".")[-1], "", occurrence)[1]


def test_all_faults():
    """All faults of a file are reported at once."""
    rng = np.random.default_rng(7)
    independent = [
        ("poisson_ratio", 0, "tubes[0].poisson_ratio"),
        ("density_kg_m3", 1, "tubes[1].density_kg_m3"),
        ("curvature_per_m", 2, "tubes[2].curvature_per_m"),
        ("rate_Hz", 0, "tracker.rate_Hz"),
        ("jitter_mm", 0, "tracker.jitter_mm"),
        ("curvature_percent", 0, "uncertainty.curvature_percent"),
        ("translation_mm_per_rev", 0, "actuation.translation_mm_per_rev"),
    ]
    for _ in range(20):
        chosen = [independent[i] for i in rng.choice(len(independent), rng.integers(1, 8), replace=False)]
        text, lines = TEXT, {}
        for key, occurrence, field in chosen:
            text, lines[field] = edited(text, key, "wrong", occurrence)
        assert {problem.field: problem.line for problem in faults(text)} == lines


@pytest.mark.parametrize(
    "key, misspelt, hint",
    [
        ("length_mm", "lenght_mm", "did you mean length_mm?"),
        ("length_mm", "length_m", "did you mean length_mm, in mm?"),
        ("youngs_modulus_GPa", "youngs_modulus_MPa", "did you mean youngs_modulus_GPa, in GPa?"),
        ("gravity", "gravty", "did you mean gravity?"),
        ("tracker", "traker", "did you mean tracker?"),
        ("poisson_ratio", "colour", "the fields here are"),
    ],
)
def test_misspelt_field(key, misspelt, hint):
    """A misspelt field is reported once, with the right name."""
    problems = faults(re.sub(rf"\b{key}:", f"{misspelt}:", TEXT, count=1))
    assert hint in problems[0].message or any(hint in problem.message for problem in problems)
    if "did you mean" in hint:
        assert len(problems) == 1


@pytest.mark.parametrize("field", sorted({*re.findall(r"^[ -]*(\w+):", TEXT, re.M)} - {*defaults.SAID}))
def test_missing_field(field):
    """A missing field is named."""
    text = re.sub(rf"\b{field}:", f"zz{field[::-1]}:", TEXT, count=1)
    assert any(problem.field.endswith(field) and "missing" in problem.message for problem in faults(text))


def test_tubes_in_reverse_order():
    """Tubes in the wrong order are a fault."""
    head, *rest = TEXT.split("- youngs_modulus_GPa")
    body, tail = rest[-1].split("actuation:")
    reordered = [body, *rest[:-1][::-1]]
    text = head + "".join("- youngs_modulus_GPa" + tube for tube in reordered) + "actuation:" + tail
    assert "innermost first" in " ".join(problem.message for problem in faults(text))


@pytest.mark.parametrize(
    "key, value, hint",
    [
        ("length_mm", "463000", "is this um?"),
        ("length_mm", "4", "unusual"),
        ("youngs_modulus_GPa", "58.0e9", "is this Pa?"),
        ("youngs_modulus_GPa", "58000", "is this MPa?"),
        ("density_kg_m3", "6.45", "is this g/cm^3?"),
        ("curvature_per_m", "0.01", "is this 1/mm?"),
        ("curvature_per_m", "150", "strains it by"),
        ("curvature_per_m", "130", "is this the radius in mm?"),
        ("jitter_mm", "9", "accuracy"),
        ("curved_length_mm", "0", "counts as straight"),
        ("home_translation_mm", "[420, -330.5, -199]", "in front of the plate"),
        ("home_translation_mm", "[-100, -330.5, -199]", "behind tube 1 inside it"),
    ],
)
def test_warnings(key, value, hint):
    """Unusual values are reported with the unit that was probably meant."""
    text, line = edited(drop_list(TEXT, key) if value.startswith("[") else TEXT, key, value, occurrence=0)
    if key == "length_mm" and value == "4":
        text, line = edited(TEXT, key, value, occurrence=2)
        text, _ = edited(text, "curved_length_mm", "3", occurrence=2)
    assert (line, True) in [(p.line, hint in p.message) for p in robot_file.warnings(parse(text))]


def test_nothing_uncertain():
    """Where all is known exactly, a doubt says that nothing can be fitted."""
    exact = re.sub(r"(\n  \w+): .*", r"\1: 0", TEXT[TEXT.index("uncertainty:") :])
    doubts = robot_file.warnings(parse(TEXT[: TEXT.index("uncertainty:")] + exact))
    assert [doubt.field for doubt in doubts] == ["uncertainty"] and "no fit" in doubts[0].message


def test_impossible_values():
    """A negative number is one fault: nothing is compared with it."""
    problems = faults(edited(TEXT, "length_mm", "-463", 0)[0])
    assert [problem.field for problem in problems] == ["tubes[0].length_mm"]


def test_compiled_for_other_tubes(monkeypatch):
    """A robot of a number of tubes that the compiled module does not model: the file is right, and ctcr lacks it."""
    monkeypatch.setattr(robot_file._core, "TUBES", (1, 2))
    with pytest.raises(InputError, match="compiled here for robots of 1 or 2 tubes"):
        parse(TEXT)


def test_no_warnings():
    """The example has none."""
    assert robot_file.warnings(parse(TEXT)) == []


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "is empty"),
        (b"\n  \n", "is empty"),
        (b"- 1\n- 2\n", "does not describe a robot"),
        (b"t_s,run\n1,2\n", "is this the table"),
        (b"a: [1, 2\n", "not valid YAML"),
        (b"a: 1\na: 2\n", "not valid YAML"),
        (b"a:\n\tb: 1\n", "indent by spaces"),
        (b"\xff\xfe\x00n", "UTF-8"),
        (b"a: \x00", "not valid YAML"),
        (b"[" * 1200, "nested too deeply"),
        (b"a" * (yaml_document.MAX_BYTES + 1), "over 1 MB"),
        (b"a: !!python/object/apply:os.getcwd []", "not valid YAML"),
    ],
)
def test_other_files(content, message, tmp_path):
    """A file that is no robot file is one clear sentence."""
    path = tmp_path / "robot.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        robot_file.load(path)
    (problem,) = caught.value.problems
    assert message in problem.message and "\n" not in str(problem)


def test_absent_file(tmp_path):
    """A missing file, or a folder."""
    for path in (tmp_path / "absent.yaml", tmp_path):
        with pytest.raises(InputError, match="cannot read it"):
            robot_file.load(path)


def test_save(tmp_path):
    """Saving keeps comments, and changes only the lines of changed values."""
    robot_file.save(robot_file.load(EXAMPLE), tmp_path / "same.yaml")
    same = (tmp_path / "same.yaml").read_text()
    assert parse(same).model_dump() == parse(TEXT).model_dump()
    assert re.findall(r"#.*", same) == re.findall(r"#.*", TEXT)
    robot = robot_file.load(tmp_path / "same.yaml")
    robot.tubes[1].length_mm = 331.25
    robot.tracker.position_mm[2] = -1.5
    robot_file.save(robot, tmp_path / "changed.yaml")
    changed = (tmp_path / "changed.yaml").read_text()
    different = [new for old, new in zip(same.splitlines(), changed.splitlines(), strict=True) if old != new]
    assert [line.split("#")[0].strip() for line in different] == ["length_mm: 331.25", "- -1.5"]


def test_save_robot_without_file(tmp_path):
    """A robot that came from no file is written whole."""
    robot = Robot.model_validate(parse(TEXT).model_dump())
    robot_file.save(robot, tmp_path / "new.yaml")
    assert robot_file.load(tmp_path / "new.yaml").model_dump() == robot.model_dump()


def test_shared_robots():
    """Every shared robot loads, with as many tubes as its table has columns of translations."""
    files = [*SHARED.rglob("robot.yaml")]
    if not files:
        pytest.skip("the shared data are not here")
    for path in files:
        with open(path.with_name("measurements.csv"), encoding="utf-8") as table:
            columns = table.readline().split(",")
        assert robot_file.load(path).n_tubes == sum(name.startswith("beta") for name in columns), path


@pytest.mark.parametrize("n", range(1, 5))
@pytest.mark.parametrize("absent", ["", "actuation: null\ntracker:\nuncertainty: null\n"])
def test_sections_left_out(n, absent, tmp_path):
    """Sections that a file leaves out, or leaves at null, are those that `ctcr init` writes; each is said, and a change
    of a value in one of them is written."""
    stated = new_file.text(new_file.example(n))
    short = stated[: stated.index("actuation:")] + absent
    whole, robot = robot_file.parse(stated.encode()), robot_file.parse(short.encode())
    assert robot.model_dump() == whole.model_dump()
    assert {"actuation", "tracker", "uncertainty"} <= {doubt.field for doubt in robot_file.warnings(robot)}
    change = ledger.Change(("tracker", "position_mm", 0), "mm", 3.5)
    changed = ledger.write(robot, tmp_path / "new.yaml", [change], ledger.Entry("ctcr calibrate frame"))
    assert changed.tracker.position_mm == [3.5, 0, 0] and changed.actuation == whole.actuation
    assert not {"actuation", "tracker", "uncertainty"} & {doubt.field for doubt in robot_file.warnings(changed)}
    robot_file.save(robot, tmp_path / "saved.yaml")
    assert robot_file.load(tmp_path / "saved.yaml").uncertainty == whole.uncertainty
