"""The study behind docs/real_data.md, and the page as it stands."""

import re
import sys
from pathlib import Path

import ctcr
import numpy as np
import pytest
import real_data_study as study

ROOT = Path(__file__).parents[3]
DATA = ROOT.parent / "shared" / "data" / "real"


@pytest.fixture(scope="module")
def told():
    """Cells of the page by robot and row."""
    text = study.PAGE.read_text(encoding="utf-8").split(study.BEGIN)[1].split(study.END)[0]
    (_, *robots), _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines())
    return {robot: {row[0]: row[i] for row in rows} for i, robot in enumerate(robots, start=1)}


def test_page(told):
    """Every robot of the table has all rows, a section that tells what it means, and a source."""
    page = study.PAGE.read_text(encoding="utf-8")
    sections = re.findall(r"^### .*`(\w+)`$", page, re.MULTILINE)
    assert sections == [*told]
    for cells in told.values():
        assert [*cells] == [*study.ROWS] and all(cells.values())
    assert page.count("github.com/") >= len({robot.split("_")[0] for robot in told})


def test_picture(told):
    """The picture shows the robots of the table, and is small enough for a page."""
    picture = study.PICTURE.read_text(encoding="utf-8")
    assert study.PICTURE.name in study.PAGE.read_text(encoding="utf-8")
    assert all(robot in picture for robot in told)
    assert len(picture) < 100_000


def test_kept_table():
    """A new table takes the place of the old one, and nothing else of the page changes."""
    page = f"before\n{study.BEGIN}old\n{study.END}after\n"
    assert study.kept(page, "new\n") == page.replace("old", "new")


def test_no_data(tmp_path, monkeypatch, capsys):
    """A folder without robots is refused with what it should hold."""
    monkeypatch.setattr(sys, "argv", ["real_data_study.py", str(tmp_path)])
    with pytest.raises(SystemExit):
        study.main()
    assert "robot.yaml and measurements.csv" in capsys.readouterr().err


@pytest.mark.parametrize("robot", ["boston_2016", "western_2023", "wpi_optitrack_2023", "wpi_polaris_2023"])
def test_figures(told, robot):
    """The counts and the error of the robot file, as predictions row by row give them."""
    if not DATA.exists():
        pytest.skip("the measurements of real robots are not here")
    found = study.corrected(DATA / robot)
    table = found.readings
    error = ctcr.predict(found.robot, table, frame="tracker").position - table.positions
    square = np.sum(error**2, axis=1)
    assert len(np.unique(table.run)) == int(told[robot]["runs"])
    # A few readings are left out as spikes or as poses that the tracker repeated.
    assert np.isfinite(square).sum() == pytest.approx(int(told[robot]["readings"]), rel=0.01)
    assert 1e3 * np.sqrt(np.nanmean(square)) == pytest.approx(float(told[robot]["robot file, all readings"]), rel=0.01)
