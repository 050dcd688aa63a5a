"""Tables of the calibration procedures: any unit of a kind, every fault with its row and column."""

import re

import numpy as np
import pytest
from ctcr.calibrate import tables
from ctcr.calibrate.procedures import CANTILEVER, HOME, REGISTRATION, ROTATION_OFFSETS
from ctcr.errors import InputError


@pytest.fixture
def table(tmp_path):
    def write(text: str):
        path = tmp_path / "table.csv"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize(
    "heading, value, si", [("x_mm", "12.5", 0.0125), ("x_m", "0.0125", 0.0125), ("x_um", "12500", 0.0125)]
)
def test_lengths(table, heading, value, si):
    """Every unit of length is read in SI."""
    data = tables.read(table(f"motor_angle_deg,{heading},y_mm,z_mm\n90,{value},1,2\n"), ROTATION_OFFSETS)
    assert data["x"] == pytest.approx([si], rel=1e-12) and data.unit["x"] == heading[2:]
    assert data["motor_angle"] == pytest.approx([np.pi / 2])
    assert data.stacked("x", "y", "z").shape == (1, 3)


@pytest.mark.parametrize("heading, factor", [("load_N", 1), ("load_mN", 1e-3), ("load_g", 9.80665e-3)])
def test_loads(table, heading, factor):
    """Every unit of a load is read in N; a column that may be absent is."""
    data = tables.read(table(f"{heading},deflection_mm,free_length_mm\n2,1,80\n"), CANTILEVER)
    assert data["load"] == pytest.approx([2 * factor]) and "load_distance" not in data


def test_empty_fields(table):
    """Optional fields may be empty, blank lines are passed over, names are text."""
    data = tables.read(table("tube,distance_mm,length_mm\n1,,463\n\n2,220.5,\n"), HOME)
    assert data["tube"].tolist() == [1, 2] and data.row.tolist() == [2, 4]
    assert np.isnan(data["distance"]).tolist() == [True, False]
    text = "point,cad_x_mm,cad_y_mm,cad_z_mm,x_mm,y_mm,z_mm\nleft hole,1,2,3,,,\n"
    assert tables.read(table(text), REGISTRATION)["point"] == ["left hole"]


@pytest.mark.parametrize(
    "text, faults",
    [
        ("motor_angle_deg,x_mm,y_mm\n1,2,3\n", [r"row 1, z_mm: this column is missing \(or as z_m, z_um\)"]),
        ("motor_angle_deg,x_mm,y_mm,z_mn\n1,2,3,4\n", ["z_mn: unknown column: did you mean z_mm?"]),
        ("motor_angle_deg,x_mm,x_m,y_mm,z_mm\n1,2,3,4,5\n", ["x_m: this column is there twice, also as x_mm"]),
        ("motor_angle_deg,x_mm,y_mm,z_mm\n1,2,3\n", ["row 2: has 3 fields: the header has 4"]),
        (
            "motor_angle_deg,x_mm,y_mm,z_mm\n1,,3,4\n1,two,3,inf\n",
            ["row 2, x_mm: is empty: needs a number in mm", "row 3, x_mm: 'two' is not a", "z_mm: is not finite"],
        ),
        (
            "tube,direction,motor_angle_deg,x_mm,y_mm,z_mm\n0,2,1,2,3,4\n1.5,-1,1,2,3,4\n1e300,1,1,2,3,4\n",
            [
                "row 2, tube: '0' does not fit: needs a whole number from 1",
                "row 3, tube: '1.5'",
                "row 4, tube: '1e300'",
                "row 2, direction: '2' does not fit: needs 1 or -1",
            ],
        ),
        ("motor_angle_deg;x_mm;y_mm;z_mm\n1;2;3;4\n", ["by semicolons or tabs"]),
        ("motor_angle_deg,x_mm,y_mm,z_mm\n", ["has no rows below the header"]),
        ("", ["is empty"]),
    ],
)
def test_faults(table, text, faults):
    """Every fault names its row and column."""
    with pytest.raises(InputError) as caught:
        tables.read(table(text), ROTATION_OFFSETS)
    for fault in faults:
        assert re.search(fault.replace("?", r"\?"), str(caught.value)), caught.value


def test_no_table(tmp_path):
    """A file that is no table is refused with its kind."""
    for content, message in (
        (b"PK\x03\x04", "is a spreadsheet"),
        (b"\xff\xfea", "is text in UTF-16"),
        (b"tube\n\xe4", "not text"),
        (b"a\0b", "not text"),
    ):
        (tmp_path / "a").write_bytes(content)
        with pytest.raises(InputError, match=message):
            tables.read(tmp_path / "a", HOME)
    with pytest.raises(InputError, match="cannot read it"):
        tables.read(tmp_path / "absent.csv", HOME)
