"""Updated robot files: new values in the old layout, and a ledger of all changes."""

import hashlib
import os
import re
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from ctcr.errors import InputError
from ctcr.robot import history, ledger, new_file, robot_file
from ctcr.robot.ledger import Change, Entry

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "robots" / "table2.yaml"
TABLE = ROOT / "examples" / "data" / "demo" / "measurements.csv"
LENGTH = Change(("tubes", 1, "length_mm"), "mm", 331.25, 0.123456)
HOME = Change(("actuation", "home_rotation_deg", 2), "deg", -1.5, 0.1)
ENTRY = Entry("ctcr calibrate fit", [TABLE], {"rms_mm": {"before": 1.25, "after": 0.5}}, "by hand: no")


def test_changed_lines(robot, tmp_path):
    """Only the changed lines differ, and comments stay."""
    ledger.write(robot, tmp_path / "new.yaml", [LENGTH], ENTRY)
    old, new = EXAMPLE.read_text().splitlines(), (tmp_path / "new.yaml").read_text().splitlines()
    before_ledger = new[: new.index("history:")]
    different = [after for before, after in zip(old, before_ledger, strict=True) if before != after]
    assert different == ["  length_mm: 331.25"]


def test_layout(tmp_path):
    """Lists indented, lists on one line, quoted text, a comment at the end."""
    text = re.sub(r"gravity:.*\n(- .*\n)+", "gravity: [0.0, -9.80665, 0.0]  # up\n", EXAMPLE.read_text())
    text = re.sub(r"(?m)^  - (.*)$", r"    - \1", text).replace("name: table2", 'name: "table2"')
    head, tubes = text.split("tubes:\n")
    tubes, tail = tubes.split("actuation:")
    tubes = re.sub(r"(?m)^", "  ", tubes).rstrip(" ")
    text = f"{head}tubes:\n{tubes}actuation:{tail}# the end\n"
    (tmp_path / "a.yaml").write_text(text)
    ledger.write(robot_file.load(tmp_path / "a.yaml"), tmp_path / "b.yaml", [LENGTH], Entry("x"))
    new = (tmp_path / "b.yaml").read_text()
    assert new.startswith(text.replace("length_mm: 330.5", "length_mm: 331.25"))


def test_defaults_of_a_new_file(tmp_path):
    """What is a default is said beside it alone, so that it is not said of what a command changes there."""
    text = new_file.text(new_file.example(2))
    assert not any("default" in line for line in text.splitlines() if line.startswith("#"))
    (tmp_path / "a.yaml").write_text(text)
    sd = Change(("uncertainty", "length_mm"), "mm", [0.5, 0.6])
    ledger.write(robot_file.load(tmp_path / "a.yaml"), tmp_path / "b.yaml", [sd], Entry("x"))
    written = (tmp_path / "b.yaml").read_text()
    assert re.search(r"length_mm: \[0.5, 0.6\] +# default \(written for an earlier value\)\n", written)


@pytest.mark.parametrize("n", range(1, 5))
def test_new_file_changed(tmp_path, n):
    """A file of `ctcr init` stays as it is but for new homes: what is not known stays `null`, the comment above a
    section stays directly above it, and the one beside the homes says that it speaks of others."""
    text = new_file.text(new_file.example(n))
    (tmp_path / "a.yaml").write_text(text)
    home = Change(("actuation", "home_rotation_deg", 0), "deg", -1.5)
    ledger.write(robot_file.load(tmp_path / "a.yaml"), tmp_path / "b.yaml", [home], Entry("x"))
    new = re.sub(r"  recorded_home_.*\n", "", (tmp_path / "b.yaml").read_text().partition("history:")[0])
    expected = text.replace("home_rotation_deg: [0", "home_rotation_deg: [-1.5")
    expected = expected.replace("alpha at home\n", f"alpha at home {robot_file.EARLIER}\n")
    assert [line.split() for line in new.splitlines()] == [line.split() for line in expected.splitlines()]


COMMENTED = """\
name: mine
gravity: null
tubes:  # the innermost first
  - length_mm: 420  # by caliper
    curved_length_mm: 60
    curvature_per_m: 12  # data sheet
    inner_diameter_mm: 0.65
    outer_diameter_mm: 0.88
    youngs_modulus_GPa: 60
    poisson_ratio: 0.3
    density_kg_m3: 6450
tracker:
  sensor_on_tube: 1
  rate_Hz: null
  jitter_mm: 0.1
  jitter_deg: null
  accuracy_95_mm: null
  accuracy_95_deg: null
  position_mm: [0, 0, 0]  # unknown
  # Mounted upside down.
  rotation_vector_rad:  # of the maker
    - 0  # x
    - 0  # y
  # below
    - 0  # z
  sensor_position_mm: [0, 0, 3]  # by ruler
"""


def test_comments_of_earlier_values(tmp_path):
    """A comment beside a value that changes says, once, that it was written for another; all others stay."""
    path = tmp_path / "b.yaml"
    path.write_text(COMMENTED)
    robot = robot_file.load(path)
    for step in (1, 2):
        values = {("tubes", 0, "curvature_per_m"): 12, ("tubes", 0, "length_mm"): 420 + step}
        values |= {("tracker", "position_mm", 1): step, ("tracker", "rotation_vector_rad", 1): 0.1 * step}
        changes = [Change(field, "", value) for field, value in values.items()]
        robot = ledger.write(robot, path, changes, Entry("x"), in_place=True)
    unknown = Change(("tracker", "sensor_position_mm"), "mm", None)
    robot = ledger.write(robot, path, [unknown], Entry("x"), in_place=True)
    robot.tubes[0].curvature_per_m = 13
    for file, others in ((path, ["by ruler"]), (tmp_path / "c.yaml", ["by ruler", "data sheet"])):
        robot_file.save(robot, tmp_path / "c.yaml")
        expected = COMMENTED
        for comment in ("by caliper", "unknown", "y", *others):
            expected = expected.replace(f"# {comment}\n", f"# {comment} {robot_file.EARLIER}\n")
        assert re.findall("#.*", file.read_text()) == re.findall("#.*", expected)


def test_comments_of_effects(tmp_path):
    """An effect that is added leaves what is written beside and below the others."""
    effects = "effects:\n  friction: {coefficient: [0.02]}  # guess\n# the end\n"
    (tmp_path / "a.yaml").write_text(COMMENTED + effects)
    robot = robot_file.load(tmp_path / "a.yaml")
    added = robot.effects | {"tip_load": {"mass": 0.1}}
    ledger.write(robot, tmp_path / "b.yaml", [], Entry("x"), effects=added)
    assert f"{effects}  tip_load: {{mass: 0.1}}\n" in (tmp_path / "b.yaml").read_text()


def test_entry(robot, tmp_path):
    """An entry holds date, command, sources, changes, figures and note."""
    written = ledger.write(robot, tmp_path / "new.yaml", [LENGTH, HOME], ENTRY)
    assert robot_file.load(tmp_path / "new.yaml").model_dump() == written.model_dump()
    (entry,) = written.history
    assert entry == {
        "date": date.today().isoformat(),
        "command": "ctcr calibrate fit",
        "sources": [{"file": "measurements.csv", "sha256": hashlib.sha256(TABLE.read_bytes()).hexdigest()}],
        "changes": [
            {"field": "tubes[1].length_mm", "unit": "mm", "old": 330.5, "new": 331.25, "sd": 0.123},
            {"field": "actuation.home_rotation_deg[2]", "unit": "deg", "old": 0.0, "new": -1.5, "sd": 0.1},
        ],
        "figures": {"rms_mm": {"before": 1.25, "after": 0.5}},
        "note": "by hand: no",
    }


def test_chain(robot, tmp_path):
    """Old and new values form a chain back to the first file."""
    rng = np.random.default_rng(3)
    values = [330.5, *rng.normal(330, 1, 5)]
    for value in values[1:]:
        robot = ledger.write(robot, tmp_path / "a.yaml", [Change(LENGTH.path, "mm", value)], Entry("x"), in_place=True)
    assert robot.tubes[1].length_mm == pytest.approx(values[-1], rel=1e-7)
    changes = [entry["changes"][0] for entry in robot.history]
    assert [change["old"] for change in changes] == pytest.approx(values[:-1], rel=1e-7)
    assert [change["new"] for change in changes] == pytest.approx(values[1:], rel=1e-7)


def test_recorded_homes(robot, tmp_path):
    """A table holds the joints of its controller: later changes of the homes are added to them."""
    beta, alpha = np.full((2, 3), -0.1), np.zeros((2, 3))
    assert np.array_equal(robot.joints_of_table(beta, alpha)[0], beta)
    changes = [HOME, Change(("actuation", "home_translation_mm", 0), "mm", -299.0)]
    for scale in (1, 2):  # the second calibration starts from the first; the recorded homes stay
        changes = [Change(c.path, c.unit, c.new + (scale - 1)) for c in changes]
        robot = ledger.write(robot, tmp_path / "a.yaml", changes, Entry("x"), in_place=True)
    corrected = robot.joints_of_table(beta, alpha)
    np.testing.assert_allclose(corrected[0], beta + [0.0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(corrected[1], alpha + np.radians([0, 0, -0.5]), atol=1e-12)
    assert "recorded_home_rotation_deg: [0.0, 0.0, 0.0]" in (tmp_path / "a.yaml").read_text()
    assert robot.actuation.recorded_home_translation_mm == [-298.0, -220.5, -145.0]


def test_number_of_recorded_homes():
    """Recorded homes need one value for each tube."""
    text = EXAMPLE.read_text().replace("actuation:", "actuation:\n  recorded_home_rotation_deg: [1.0]", 1)
    with pytest.raises(InputError, match="recorded_home_rotation_deg: has 1 values: needs 3, one a tube"):
        robot_file.parse(text.encode())


def test_input_stays(tmp_path):
    """The input is overwritten only in place, by a link too."""
    path = tmp_path / "robot.yaml"
    path.write_bytes(EXAMPLE.read_bytes())
    (tmp_path / "link.yaml").symlink_to(path)
    robot = robot_file.load(path)
    for target in (path, tmp_path / "link.yaml"):
        with pytest.raises(InputError, match="is the input: .*--in-place; in_place=True"):
            ledger.write(robot, target, [LENGTH], Entry("x"))
    assert path.read_bytes() == EXAMPLE.read_bytes()
    ledger.write(robot, path, [LENGTH], Entry("x"), in_place=True)
    assert robot_file.load(path).tubes[1].length_mm == 331.25


def test_nothing_written(robot, tmp_path):
    """Impossible values and absent sources write nothing."""
    bad = Change(("tubes", 0, "poisson_ratio"), "", 0.7)
    with pytest.raises(InputError, match=r"tubes\[0\].poisson_ratio: the new value 0.7 is impossible"):
        ledger.write(robot, tmp_path / "new.yaml", [bad], Entry("x"))
    with pytest.raises(InputError, match="absent.csv: cannot read it"):
        ledger.write(robot, tmp_path / "new.yaml", [LENGTH], Entry("x", [tmp_path / "absent.csv"]))
    assert os.listdir(tmp_path) == []


def test_effects(robot, tmp_path):
    """Effects are added to a file and removed; their section stands before the ledger."""
    effects = {"friction": {"coefficient": [0.1, 0.2], "slip": 0.35}}
    first = ledger.write(robot, tmp_path / "a.yaml", [], Entry("ctcr add"))
    second = ledger.write(first, tmp_path / "b.yaml", [], Entry("ctcr add"), effects=effects)
    assert second.effects == effects
    text = (tmp_path / "b.yaml").read_text()
    assert "\neffects:\n  friction:\n    coefficient: [0.1, 0.2]\n    slip: 0.35\nhistory:\n" in text
    third = ledger.write(second, tmp_path / "c.yaml", [], Entry("ctcr remove"), effects={})
    assert third.effects == {} and "effects:" not in (tmp_path / "c.yaml").read_text()
    assert [entry["command"] for entry in third.history] == ["ctcr add", "ctcr add", "ctcr remove"]


def test_unknown_effect():
    """An effect that is in no catalogue is a fault with its line and the name that was probably meant."""
    text = EXAMPLE.read_text() + "effects:\n  frction: {coefficient: 0.1}\n"
    with pytest.raises(InputError, match=r"line 68, effects.frction: unknown effect: did you mean friction\?"):
        robot_file.parse(text.encode())
    assert robot_file.parse(text.replace("frction", "friction").encode()).effects["friction"] == {"coefficient": 0.1}


def test_expected_error_alone(robot):
    """A ledger that holds no error but the expected one has no waterfall, and a page."""
    entry = {"command": "mine", "figures": {"rms_mm": {"noise_floor": 0.5}}}
    alone = robot.model_copy(update={"history": [entry]})
    assert not history.waterfall(alone) and "mine" in history.page(alone)


def test_robot_without_file(robot, tmp_path):
    """A robot made in memory can be written."""
    made = type(robot).model_validate(robot.model_dump())
    ledger.write(made, tmp_path / "new.yaml", [LENGTH], Entry("x"))
    assert robot_file.load(tmp_path / "new.yaml").tubes[1].length_mm == 331.25


def test_tube_at_the_plate():
    """A correction below the resolution of a fit does not put a tube in front of the plate."""
    text = EXAMPLE.read_text().replace(
        "actuation:", "actuation:\n  recorded_home_translation_mm: [-298, -220.5, -145.001]"
    )
    beta, _ = robot_file.parse(text.encode()).joints_of_table(np.array([[-0.2, -0.1, 0.0]]), np.zeros((1, 3)))
    assert beta.tolist() == [[-0.2, -0.1, 0.0]]
