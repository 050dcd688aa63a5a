"""The procedures that measure a single tube: its stiffness as a cantilever, its shape in a picture."""

from math import nan

import numpy as np

from ctcr import _core
from ctcr.calibrate import procedure_figures as figures_of
from ctcr.calibrate.outcome import Outcome, Picture, Row, computed
from ctcr.calibrate.procedures import check_tube, outliers
from ctcr.calibrate.tables import Column, Table
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot
from ctcr.robot.yaml_document import FieldPath

CANTILEVER = (
    Column("load", "load"),
    Column("deflection", "length"),
    Column("free_length", "length"),
    Column("load_distance", "length", needed=False),
)
CURVATURE = (Column("x", "picture"), Column("y", "picture"))


def cantilever(
    table: Table,
    robot: Robot | None,
    tube: int | None,
    inner_mm: float | None,
    outer_mm: float | None,
    sds_mm: dict[str, float],
    fit_zero: bool,
) -> Outcome:
    """Young's modulus from the deflection of a tube that is clamped at one end and loaded across."""
    described = _described_tube(robot, tube)
    inner = inner_mm if inner_mm is not None else getattr(described, "inner_diameter_mm", None)
    outer = outer_mm if outer_mm is not None else getattr(described, "outer_diameter_mm", None)
    if inner is None or outer is None:
        raise InputError(Problem("needs the tube's diameters: give --inner-mm and --outer-mm, or --robot and --tube"))
    fit = computed(
        _core.fit_cantilever,
        table.file,
        load=table["load"],
        deflection=table["deflection"],
        free_length=table["free_length"],
        load_distance=table["load_distance"] if "load_distance" in table else None,
        inner_diameter=1e-3 * inner,
        outer_diameter=1e-3 * outer,
        fit_zero=fit_zero,
        **{name: 1e-3 * sd for name, sd in sds_mm.items()},
    )
    given_EI = described is not None and described.bending_stiffness_Nm2 is not None
    gpa = [1e-9 * x for x in (fit.youngs_modulus, fit.youngs_modulus_sd)]
    modulus = (nan, None) if given_EI else (_old(described, "youngs_modulus_GPa"), _path(tube, "youngs_modulus_GPa"))
    ei, old_ei = (fit.bending_stiffness, fit.bending_stiffness_sd), _old(described, "bending_stiffness")
    rows = [
        Row("Young's modulus", "GPa", *gpa, *modulus),
        Row("bending stiffness EI", "N m^2", *ei, old_ei, _path(tube, "bending_stiffness_Nm2") if given_EI else None),
        Row("distance from the readings, RMS", "mm", 1e3 * fit.rms),
    ]
    if fit_zero:
        rows.append(Row("zero of the readings", "mm", 1e3 * fit.zero, 1e3 * fit.zero_sd))
    details = {
        "rows": [
            {"row": row, "modulus_GPa": 1e-9 * modulus, "residual_mm": 1e3 * residual}
            for row, modulus, residual in zip(table.row, fit.row_modulus, fit.residuals, strict=True)
        ],
        "largest_slope_deg": float(np.degrees(np.max(np.abs(fit.slope_angle)))),
    }
    read = 1e3 * table["deflection"]
    caption = "What was read and what the fitted modulus gives; right, the difference."
    picture = Picture(figures_of.deflections, (table["load"], read, read - 1e3 * np.asarray(fit.residuals)), caption)
    notices, figures = [notice.text for notice in fit.notices], {"deflection_rms_mm": 1e3 * fit.rms}
    return Outcome("Cantilever", rows, notices, figures, details, picture)


def curvature(
    table: Table,
    robot: Robot | None,
    tube: int | None,
    scale_mm: float | None,
    scale_sd_percent: float,
    reference: tuple[float, float, float, float, float] | None,
    point_sd: float,
) -> Outcome:
    """Curvature and curved length from points along the picture of a tube."""
    described = _described_tube(robot, tube)
    unit = table.unit["x"]
    if table.unit["y"] != unit:
        raise InputError(Problem(f"x is in {unit} but y in {table.unit['y']}: give both in one unit", table.file))
    given = (scale_mm is not None) + (reference is not None)
    if unit == "px" and given != 1:
        raise InputError(Problem("points in px need their scale: give --mm-per-px, or --reference, not both"))
    if unit != "px" and given:
        raise InputError(Problem(f"points in {unit} have their scale: leave out --mm-per-px and --reference"))
    if reference is not None:
        scale = {"reference": np.array(reference[:4]).reshape(2, 2), "reference_length": 1e-3 * reference[4]}
    else:
        scale = {"scale": 1.0 if scale_mm is None else 1e-3 * scale_mm}
    fit = computed(
        _core.fit_tube_shape,
        table.file,
        points=np.ascontiguousarray(table.stacked("x", "y")),
        scale_sd=1e-2 * scale_sd_percent,
        point_sd=point_sd if unit == "px" else 1e-3 * point_sd,
        **scale,
    )
    sign = -1.0 if described is not None and described.curvature < 0 else 1.0  # a picture does not tell it
    curve = (sign * fit.curvature, fit.curvature_sd, _old(described, "curvature"))
    bent = (1e3 * fit.curved_length, 1e3 * fit.curved_length_sd, _old(described, "curved_length_mm"))
    rows = [
        Row("curvature", "1/m", *curve, _path(tube, "curvature_per_m")),
        Row("curved length", "mm", *bent, _path(tube, "curved_length_mm")),
        Row("radius", "mm", 1e3 * fit.radius),
        Row("straight length seen", "mm", 1e3 * fit.straight_length),
        Row("distance from the points, RMS", "mm", 1e3 * fit.rms),
    ]
    notices = [notice.text for notice in fit.notices] + outliers("", table.row[list(fit.outliers)])
    details = {"correlation": fit.correlation, "junction": fit.junction, "tip": fit.tip, "points_unit": unit}
    ends, bend = (np.asarray(fit.junction), np.asarray(fit.tip)), fit.curved_length / abs(fit.radius)
    caption = "The points on the fitted tube; the mark is where its curve starts."
    picture = Picture(figures_of.outline, (table.stacked("x", "y"), *ends, bend, list(fit.outliers)), caption, 5.0)
    return Outcome("Shape of the tube", rows, notices, {"shape_rms_mm": 1e3 * fit.rms}, details, picture)


def _old(described, name: str) -> float:
    """A value of the tube in the robot file; NaN where there is none."""
    value = getattr(described, name, None)
    return nan if value is None else value


def _path(tube: int | None, field: str) -> FieldPath | None:
    """The field of a tube in the robot file."""
    return None if tube is None else ("tubes", tube - 1, field)


def _described_tube(robot: Robot | None, tube: int | None):
    if robot is None:
        return None
    if tube is None:
        raise InputError(Problem(f"give --tube, 1 to {robot.n_tubes} from the innermost: which tube was measured"))
    check_tube(tube, robot, robot._source.file)
    return robot.tubes[tube - 1]
