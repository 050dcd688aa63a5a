"""No two commands contradict each other on one table: the floors, and what is left of the error."""

import json
from pathlib import Path

import pytest
from ctcr import cli

ROOT = Path(__file__).parents[3]
SHARED = ROOT.parent / "shared" / "data" / "hidden_effect"
FLOORS = ("sensor_jitter_mm", "expected_error_mm")
MISSING = "something is missing in the model"
# A hidden effect is found in a minute.
TABLES = [
    pytest.param(ROOT / "examples/data/demo", marks=pytest.mark.slow, id="demo"),
    pytest.param(ROOT / "examples/data/calibration", id="calibration"),
    pytest.param(SHARED / "set02", id="set02"),
    pytest.param(SHARED / "set07", marks=pytest.mark.slow, id="set07"),
]


def told(tmp_path, *arguments):
    """The JSON of a command."""
    target = tmp_path / "told.json"
    assert cli.run([*map(str, arguments), "--json", str(target)]) == 0
    return json.loads(target.read_text())


@pytest.mark.parametrize("folder", TABLES)
def test_agreement(folder, tmp_path, capsys):
    """All commands give the same floors; what a diagnosis calls noise, no fit of the same model calls an error of the
    model, and none says so of an error below its floor."""
    if not folder.exists():
        pytest.skip("the shared measurements are not here")
    table, robot = folder / "measurements.csv", folder / "robot.yaml"
    compared, fitted = told(tmp_path, "compare", robot, table), told(tmp_path, "calibrate", "fit", robot, table)
    assert [fitted[name] for name in FLOORS] == pytest.approx([compared[name] for name in FLOORS])
    found = told(tmp_path, "diagnose", robot, table)
    assert [found[name] for name in FLOORS] == pytest.approx([compared[name] for name in FLOORS], rel=0.05)
    noise = not found["leftover"]["structured"]
    fits = [] if found["effects"] else [fitted]
    if found["verdict"] in ("identified", "probable"):
        (tmp_path / "diagnosis.json").write_text(json.dumps(found))
        new = tmp_path / "new.yaml"
        options = ("--diagnosis", tmp_path / "diagnosis.json", "--fit", table, "-o", new)
        added = told(tmp_path, "add", robot, *options)
        assert [added[name] for name in FLOORS] == pytest.approx([found[name] for name in FLOORS], rel=0.05)
        fits = [added]
    for fit in fits:
        says_missing = MISSING in " ".join(fit["notices"])
        last = list(fit["rms_mm"].values())[-2]  # held out where anything is, before the floor
        assert not (noise and says_missing)
        assert not (last < fit["expected_error_mm"] and says_missing)
    text = capsys.readouterr().out
    assert "noise floor" not in text and "sensor jitter" in text and "expected error" in text
