"""Updated robot files: new values in the old layout, and a ledger that loses nothing."""

import hashlib
import os
import re
import sys
from datetime import date
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from ctcr.errors import InputError
from ctcr.robot import ledger as robot_update
from ctcr.robot import robot_file
from ctcr.robot.ledger import Change, Entry

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "robots" / "table2.yaml"
TABLE = ROOT / "examples" / "data" / "demo" / "measurements.csv"
LENGTH = Change(("tubes", 1, "length_mm"), "mm", 331.25, 0.123456)
HOME = Change(("actuation", "home_rotation_deg", 2), "deg", -1.5, 0.1)
ENTRY = Entry("ctcr calibrate fit", [TABLE], {"rms_mm": {"before": 1.25, "after": 0.5}}, "by hand: no")


@pytest.fixture
def robot():
    return robot_file.load(EXAMPLE)


def test_only_the_changed_lines_differ_and_comments_stay(robot, tmp_path):
    robot_update.write(robot, tmp_path / "new.yaml", [LENGTH], ENTRY)
    old, new = EXAMPLE.read_text().splitlines(), (tmp_path / "new.yaml").read_text().splitlines()
    ledger = new.index("history:")
    different = [after for before, after in zip(old, new[:ledger], strict=True) if before != after]
    assert different == ["  length_mm: 331.25"]


def test_the_layout_of_the_file_is_kept(tmp_path):
    """Lists indented, lists on one line, quoted text, a comment at the end."""
    text = re.sub(r"gravity:.*\n(- .*\n)+", "gravity: [0.0, -9.80665, 0.0]  # up\n", EXAMPLE.read_text())
    text = re.sub(r"(?m)^  - (.*)$", r"    - \1", text).replace("name: table2", 'name: "table2"')
    head, tubes = text.split("tubes:\n")
    tubes, tail = tubes.split("actuation:")
    tubes = re.sub(r"(?m)^", "  ", tubes).rstrip(" ")
    text = f"{head}tubes:\n{tubes}actuation:{tail}# the end\n"
    (tmp_path / "a.yaml").write_text(text)
    robot_update.write(robot_file.load(tmp_path / "a.yaml"), tmp_path / "b.yaml", [LENGTH], Entry("x"))
    new = (tmp_path / "b.yaml").read_text()
    assert new.startswith(text.replace("length_mm: 330.5", "length_mm: 331.25"))


def test_the_ledger_says_when_from_what_and_what_changed(robot, tmp_path):
    written = robot_update.write(robot, tmp_path / "new.yaml", [LENGTH, HOME], ENTRY)
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


def test_the_ledger_grows_and_old_values_can_be_followed_back(robot, tmp_path):
    rng = np.random.default_rng(3)
    values = [330.5, *rng.normal(330, 1, 5)]
    for value in values[1:]:
        robot = robot_update.write(
            robot, tmp_path / "a.yaml", [Change(LENGTH.path, "mm", value)], Entry("x"), in_place=True
        )
    assert robot.tubes[1].length_mm == pytest.approx(values[-1], rel=1e-7)
    changes = [entry["changes"][0] for entry in robot.history]
    assert [change["old"] for change in changes] == pytest.approx(values[:-1], rel=1e-7)
    assert [change["new"] for change in changes] == pytest.approx(values[1:], rel=1e-7)


def test_new_homes_keep_the_meaning_of_tables(robot, tmp_path):
    """The joints of a table are those of its controller: what the homes have changed by since is added."""
    beta, alpha = np.full((2, 3), -0.1), np.zeros((2, 3))
    assert np.array_equal(robot.joints_of_table(beta, alpha)[0], beta)
    changes = [HOME, Change(("actuation", "home_translation_mm", 0), "mm", -299.0)]
    for scale in (1, 2):  # the second calibration starts from the first; the recorded homes stay
        changes = [Change(c.path, c.unit, c.new + (scale - 1)) for c in changes]
        robot = robot_update.write(robot, tmp_path / "a.yaml", changes, Entry("x"), in_place=True)
    corrected = robot.joints_of_table(beta, alpha)
    np.testing.assert_allclose(corrected[0], beta + [0.0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(corrected[1], alpha + np.radians([0, 0, -0.5]), atol=1e-12)
    assert "recorded_home_rotation_deg: [0.0, 0.0, 0.0]" in (tmp_path / "a.yaml").read_text()
    assert robot.actuation.recorded_home_translation_mm == [-298.0, -220.5, -145.0]


def test_recorded_homes_need_one_value_a_tube():
    text = EXAMPLE.read_text().replace("actuation:", "actuation:\n  recorded_home_rotation_deg: [1.0]", 1)
    with pytest.raises(InputError, match="recorded_home_rotation_deg: has 1 values: needs 3, one a tube"):
        robot_file.parse(text.encode())


def test_the_input_is_not_overwritten_unless_told(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_bytes(EXAMPLE.read_bytes())
    (tmp_path / "link.yaml").symlink_to(path)
    robot = robot_file.load(path)
    for target in (path, tmp_path / "link.yaml"):
        with pytest.raises(InputError, match="is the input: give another name to -o, or --in-place"):
            robot_update.write(robot, target, [LENGTH], Entry("x"))
    assert path.read_bytes() == EXAMPLE.read_bytes()
    robot_update.write(robot, path, [LENGTH], Entry("x"), in_place=True)
    assert robot_file.load(path).tubes[1].length_mm == 331.25


def test_values_that_make_no_robot_and_sources_that_are_gone_write_nothing(robot, tmp_path):
    bad = Change(("tubes", 0, "poisson_ratio"), "", 0.7)
    with pytest.raises(InputError, match=r"tubes\[0\].poisson_ratio: the new value 0.7 is impossible"):
        robot_update.write(robot, tmp_path / "new.yaml", [bad], Entry("x"))
    with pytest.raises(InputError, match="absent.csv: cannot read it"):
        robot_update.write(robot, tmp_path / "new.yaml", [LENGTH], Entry("x", [tmp_path / "absent.csv"]))
    assert os.listdir(tmp_path) == []


def test_effects_come_go_and_stand_before_the_ledger(robot, tmp_path, monkeypatch):
    monkeypatch.setattr(robot_file, "known_effects", lambda: ("friction",))
    effects = {"friction": {"coefficient": [0.1, 0.2], "slip": 0.35}}
    first = robot_update.write(robot, tmp_path / "a.yaml", [], Entry("ctcr add"))
    second = robot_update.write(first, tmp_path / "b.yaml", [], Entry("ctcr add"), effects=effects)
    assert second.effects == effects
    text = (tmp_path / "b.yaml").read_text()
    assert "\neffects:\n  friction:\n    coefficient: [0.1, 0.2]\n    slip: 0.35\nhistory:\n" in text
    third = robot_update.write(second, tmp_path / "c.yaml", [], Entry("ctcr remove"), effects={})
    assert third.effects == {} and "effects:" not in (tmp_path / "c.yaml").read_text()
    assert [entry["command"] for entry in third.history] == ["ctcr add", "ctcr add", "ctcr remove"]


def test_an_unknown_effect_is_refused_where_there_is_a_catalogue(monkeypatch):
    catalogue = ModuleType("ctcr.effects.catalogue")
    catalogue.known_effects = lambda: ("friction", "softening")
    monkeypatch.setitem(sys.modules, "ctcr.effects.catalogue", catalogue)
    text = EXAMPLE.read_text() + "effects:\n  frction: {coefficient: 0.1}\n"
    with pytest.raises(InputError, match=r"line 68, effects.frction: unknown effect: did you mean friction\?"):
        robot_file.parse(text.encode())
    assert robot_file.parse(text.replace("frction", "friction").encode()).effects["friction"] == {"coefficient": 0.1}


def test_a_robot_made_in_memory_can_be_written(robot, tmp_path):
    made = type(robot).model_validate(robot.model_dump())
    robot_update.write(made, tmp_path / "new.yaml", [LENGTH], Entry("x"))
    assert robot_file.load(tmp_path / "new.yaml").tubes[1].length_mm == 331.25


def test_a_tube_at_the_plate_stays_there():
    """A home that is corrected by less than the fit can tell does not put a tube in front of the plate."""
    text = EXAMPLE.read_text().replace(
        "actuation:", "actuation:\n  recorded_home_translation_mm: [-298, -220.5, -145.001]"
    )
    beta, _ = robot_file.parse(text.encode()).joints_of_table(np.array([[-0.2, -0.1, 0.0]]), np.zeros((1, 3)))
    assert beta.tolist() == [[-0.2, -0.1, 0.0]]
