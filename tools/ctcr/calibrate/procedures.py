"""The procedures that measure one quantity each, of the whole robot or of a single tube: from a table to an Outcome.

The numbers come from the core.
"""

from collections.abc import Sequence
from math import cos, degrees, hypot, inf, isfinite, nan, sin

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import _core, settings
from ctcr.arrays import Array
from ctcr.calibrate import procedure_figures as figures_of
from ctcr.calibrate.outcome import Outcome, Picture, Row, by_robot, computed, frame_rows, in_file, row_of
from ctcr.calibrate.tables import Column, Table
from ctcr.errors import ArgumentError, InputError, Problem
from ctcr.frames import points_to_base
from ctcr.robot.description import Robot
from ctcr.robot.yaml_document import FieldPath
from ctcr.show.wording import listed

AXES = "xyz"
LONGEST_MM = 10e3  # of a tube, as the core demands of lengths that are measured by hand

SCATTER = (  # where a row is a mean: the standard deviation of one reading per axis, and their number
    Column("scatter", "length", needed=False, filled=False),
    Column("readings", "count", needed=False, filled=False),
)
ROTATION_OFFSETS = (
    Column("tube", "count", needed=False),
    Column("motor_angle", "angle"),
    Column("direction", "sign", needed=False),
    *(Column(axis, "length") for axis in AXES),
    *SCATTER,
)
CAD_POINTS = (Column("point", "text"), *(Column(f"cad_{axis}", "length") for axis in AXES))
REGISTRATION = (*CAD_POINTS, *(Column(axis, "length", filled=False) for axis in AXES), *SCATTER)
HOME = (
    Column("tube", "count"),
    Column("home_angle", "angle", needed=False, filled=False),
    Column("distance", "length", needed=False, filled=False, positive=True),
    Column("flush_angle", "angle", needed=False, filled=False),
    Column("length", "length", needed=False, filled=False, positive=True),
)
CANTILEVER = (
    Column("load", "load"),
    Column("deflection", "length"),
    Column("free_length", "length", positive=True),
    Column("load_distance", "length", needed=False),
)
CURVATURE = (Column("x", "picture"), Column("y", "picture"))


def tracker_noise(robot: Robot | None, table: Table | None = None) -> dict[str, float]:
    """Jitter and smooth field error of a reading per axis [m], as the robot file states them; 0: not known.

    Where the rows of the table are means, their jitter follows from their scatter.
    """
    noise = {}
    if robot is not None:
        jitter_mm, accuracy_95_mm = robot.tracker.jitter_mm or 0.0, robot.tracker.accuracy_95_mm or 0.0
        noise["jitter"] = 1e-3 * jitter_mm
        noise["field_error"] = 1e-3 * _core.field_of_accuracy(accuracy_95_mm, jitter_mm)
    if table and "scatter" in table and "readings" in table:
        known = (table["readings"] > 0) & np.isfinite(table["scatter"])
        if known.any():
            variance = table["scatter"][known] ** 2 / table["readings"][known]
            noise["jitter"] = float(np.sqrt(variance.mean()))
    return noise


def rotation_offsets(
    table: Table, robot: Robot | None, ratio: float | None, deployed_mm: float | None = None
) -> Outcome:
    """Home rotations from circles of the tip, one tube alone at a time. Ref: Boyer et al., eq. (5).

    `deployed_mm`: how far the tube stands out; None: all that is curved of it.
    """
    tubes = table["tube"] if "tube" in table else np.ones(len(table), np.int64)
    if ratio is None and robot is not None:
        ratio = robot.actuation.rotation_rev_per_rev
    if ratio is None:
        raise ArgumentError(Problem("give --ratio, turns of a tube in one turn of its motor, or --robot"))
    pose = np.eye(4)
    if robot:
        pose[:3, :3], pose[:3, 3] = robot.tracker.rotation, robot.tracker.position
    rows, notices, details, circles = [], [], {}, []
    for tube in np.unique(tubes).tolist():
        mine, name = np.flatnonzero(tubes == tube), f"tube {tube}"
        check_tube(tube, robot, table.file, int(table.row[mine[0]]))
        position, angle = np.ascontiguousarray(table.stacked(*AXES)[mine]), table["motor_angle"][mine]
        direction = table["direction"][mine].astype(np.int8) if "direction" in table else None
        fit = computed(
            _core.fit_rotation_offset,
            table,
            name,
            motor_angle=angle,
            position=position,
            direction=direction,
            ratio=ratio,
            T_ref=pose if robot else None,
            bend_angle=-np.pi / 2 if robot is None or robot.tubes[tube - 1].curvature >= 0 else np.pi / 2,
            **tracker_noise(robot, table),
        )
        path = ("actuation", "home_rotation_deg", tube - 1)
        offset = degrees(fit.offset)
        if robot:
            offset = _nearest_turn(offset, in_file(robot, path))
        rows.append(row_of(robot, f"{name}: rotation offset", "deg", offset, degrees(fit.offset_sd), path))
        for way in ("forward", "backward"):
            value, sd = getattr(fit, f"offset_{way}"), getattr(fit, f"offset_{way}_sd")
            if isfinite(value):
                rows.append(Row(f"    turning {way}", "deg", _nearest_turn(degrees(value), offset), degrees(sd)))
        radius, radius_sd = (1e3 * size for size in radius_of_circle(robot, tube, deployed_mm))
        rows.append(
            Row("    radius of the circle", "mm", 1e3 * fit.radius, 1e3 * fit.radius_sd, radius, old_sd=radius_sd)
        )
        rows.append(Row("    distance from the circle, RMS", "mm", 1e3 * fit.rms))
        notices += [f"{name}: {notice.text}" for notice in fit.notices]
        notices += outliers(name, table.row[mine[list(fit.outliers)]])
        turned = np.diff(angle)
        forward = (np.append(turned[:1], turned) if direction is None else direction) > 0
        if fit.in_base_frame:
            position = points_to_base(robot.tracker, position)
        circles.append(figures_of.Circle(name, position, ratio * angle, forward, fit))
        details[f"tube_{tube}"] = {
            "centre_mm": 1e3 * np.asarray(fit.centre),
            "normal": fit.normal,
            "arc_deg": degrees(fit.arc),
            "in_base_frame": fit.in_base_frame,
            "rms_mm": 1e3 * fit.rms,
            "used": fit.used,
            "direction_difference_deg": degrees(fit.direction_difference),
            "direction_difference_sd_deg": degrees(fit.direction_difference_sd),
        }
    figures = {f"radius_rms_mm_{name}": detail["rms_mm"] for name, detail in details.items()}
    caption = (
        "Left: the readings on the circle fitted to them. Right: the angle of the tip less that of its motor; where "
        "the two directions differ, friction or backlash holds the tip back."
    )
    picture = Picture(figures_of.circles, circles, caption, figures_of.ROW_HEIGHT * len(circles))
    suspects = "the order of the tubes, how far each stood out (--deployed-mm), the unit of x, y, z, the tracker frame"
    return Outcome("Rotation offsets", rows, notices, figures, {"tubes": details}, picture, suspects=suspects)


def radius_of_circle(robot: Robot | None, tube: int, deployed_mm: float | None = None) -> tuple[float, float]:
    """The radius of the circle of the sensor on a tube that turns alone [m], and its standard deviation, by the robot
    file; NaN where the file does not say them."""
    if robot is None or robot.tracker.sensor_position_mm is None:
        return nan, nan
    out = inf if deployed_mm is None else 1e-3 * deployed_mm

    def radius(values: Array) -> float:
        curvature, curved, x, y, z = values
        bend = curvature * min(curved, out)
        away = (1 - cos(bend)) / curvature if curvature else 0.0
        return hypot(x, y * cos(bend) - z * sin(bend) - away)

    names = [f"tubes.{tube}.{kind}" for kind in ("curvature", "curved_length")]
    return by_robot(robot, radius, *names, *(f"tracker.sensor_position.{axis}" for axis in AXES))


def _nearest_turn(angle: float, other: float) -> float:
    """The same angle [deg], on the turn nearest to the other."""
    return angle + 360 * round((other - angle) / 360)


def registration(table: Table, robot: Robot | None, placement_sd_mm: float) -> Outcome:
    """T_ref from named points: CAD coordinates in the base frame, probe readings in the tracker frame."""
    names = list(dict.fromkeys(table["point"]))
    cad, reading = table.stacked(*(f"cad_{axis}" for axis in AXES)), table.stacked(*AXES)
    point = cad[[table["point"].index(name) for name in names]]
    _check_points(table, names, cad, point)
    measured = np.isfinite(reading).all(axis=1)
    read = [name for name, there in zip(table["point"], measured, strict=True) if there]
    targets = [i for i, name in enumerate(names) if name not in read]
    fiducials = [i for i, name in enumerate(names) if name in read]
    fit = computed(
        _core.register_points,
        table,
        names=[names[i] for i in fiducials],
        cad=np.ascontiguousarray(point[fiducials]),
        reading_names=read,
        readings=np.ascontiguousarray(reading[measured]),
        targets=np.ascontiguousarray(point[targets]) if targets else None,
        placement_sd=1e-3 * placement_sd_mm,
        **tracker_noise(robot, table),
    )
    position, turn = 1e3 * fit.T_ref[:3, 3], Rotation.from_matrix(fit.T_ref[:3, :3]).as_rotvec()
    rows = frame_rows(robot, position, 1e3 * np.asarray(fit.position_sd), turn, np.asarray(fit.rotation_sd))
    rows.append(Row("error at the points, RMS", "mm", 1e3 * fit.fre))
    expected = zip(targets, fit.tre, strict=True)
    rows += [Row(f"expected error at {names[i]}, RMS", "mm", 1e3 * tre) for i, tre in expected]
    columns = (fit.names, 1e3 * fit.residuals, 1e3 * np.linalg.norm(fit.residuals, axis=1), fit.counts)
    keys = ("name", "residual_mm", "distance_mm", "readings")
    points = [dict(zip(keys, values, strict=True)) for values in zip(*columns, strict=True)]
    details = {
        "points": [one | {"outlier": one["name"] in fit.outliers} for one in points],
        "T_ref_m": fit.T_ref,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "repeatability_mm": 1e3 * fit.repeatability_sd,
    }
    figures = {"fiducial_error_rms_mm": 1e3 * fit.fre, "rotation_sd_deg": np.degrees(fit.rotation_sd)}
    where = 1e3 * point[[names.index(name) for name in fit.names]]
    caption = "Left: displacement of the readings from the CAD points. Right: its size."
    picture = Picture(figures_of.points, (where, fit), caption, 4.4)
    said = [notice.text for notice in fit.notices]
    suspects = "a tracker that has moved, CAD coordinates in another frame, a unit, a sign"
    return Outcome("Tracker frame", rows, said, figures, details, picture, suspects=suspects)


def home(table: Table, robot: Robot | None, pitch_mm: float | None, sds_mm: dict[str, float]) -> Outcome:
    """Home translations and effective lengths, from distances by hand and angles by the encoders."""
    tubes = _all_tubes(table, robot)
    pitch = robot.actuation.translation_mm_per_rev if robot and pitch_mm is None else pitch_mm
    if pitch is None:
        raise ArgumentError(Problem("give --pitch-mm, how far a tube moves in one turn of its motor, or --robot"))

    def values(tube: int, name: str) -> list[float]:
        mine = table[name][table["tube"] == tube] if name in table else np.empty(0)
        return mine[np.isfinite(mine)].tolist()

    measured = [
        _core.TubeHome(
            home_angle=float(np.mean(values(tube, "home_angle") or 0.0)),
            distances=values(tube, "distance"),
            flush_angles=values(tube, "flush_angle"),
            lengths=values(tube, "length"),
        )
        for tube in tubes
    ]
    sds, ratio = {name: 1e-3 * sd for name, sd in sds_mm.items()}, 1e-3 * pitch / (2 * np.pi)
    fit = computed(_core.home_offsets, table, translation_ratio=ratio, tubes=measured, **sds)
    offset, offset_sd, length, length_sd, deployed, deployed_sd = (
        1e3 * np.asarray(getattr(fit, name))
        for name in ("offset", "offset_sd", "length", "length_sd", "deployed", "deployed_sd")
    )
    _check_home(table.file, tubes, length, deployed, deployed_sd)
    rows, old, correlations = [], [], []
    for i, tube in enumerate(tubes):
        paths = ("actuation", "home_translation_mm", i), ("tubes", i, "length_mm")
        correlations.append((*paths, fit.correlation[i]))
        rows.append(row_of(robot, f"tube {tube}: home translation", "mm", offset[i], offset_sd[i], paths[0]))
        rows.append(row_of(robot, f"tube {tube}: length", "mm", length[i], length_sd[i], paths[1]))
        before, before_sd = nan, nan
        if robot:
            names = f"actuation.home_translation.{tube}", f"tubes.{tube}.length"
            before, before_sd = (1e3 * size for size in by_robot(robot, np.sum, *names))
        rows.append(Row("    deployed at home", "mm", deployed[i], deployed_sd[i], before, old_sd=before_sd))
        old.append((in_file(robot, paths[0]), before))  # grasped point and tip
    sd = np.column_stack([offset_sd, deployed_sd])
    caption = "The tubes at home, two standard deviations at the grasped point and at the tip; grey: the robot file."
    picture = Picture(figures_of.homes, (tubes, offset, deployed, sd, np.array(old)), caption, 1.6 + 0.5 * len(tubes))
    notices, details = [notice.text for notice in fit.notices], {"correlation": fit.correlation}
    suspects = "the sign or the unit of distance or flush_angle, the order of the tubes"
    return Outcome("Home", rows, notices, {}, details, picture, correlations, suspects=suspects)


def _check_home(file: str, tubes: list[int], length: Array, deployed: Array, deployed_sd: Array) -> None:
    """Raises InputError for lengths and tips [mm] that no robot has at home."""
    problems = []
    for tube, long, out, sd in zip(tubes, length, deployed, deployed_sd, strict=True):
        text = ""
        if out < -settings.MOVED_FAR * sd:
            text = (
                f"at home its tip is {-out:.4g} mm behind the front plate: is the sign of flush_angle or pitch wrong?"
            )
        elif long > LONGEST_MM:
            text = f"its length comes out as {1e-3 * long:.4g} m: has flush_angle another unit?"
        if text:
            problems.append(Problem(f"tube {tube}: {text}", file))
    if problems:
        raise InputError(problems)


def check_tube(tube: int, robot: Robot | None, file: str, row: int | None = None) -> None:
    """Raises InputError where the robot has no such tube."""
    if robot is not None and tube > robot.n_tubes:
        raise InputError(Problem(f"tube {tube} is not there: the robot has {robot.n_tubes}", file, row, "tube", "row"))


def _all_tubes(table: Table, robot: Robot | None) -> list[int]:
    there = sorted(set(table["tube"].tolist()))
    count = robot.n_tubes if robot else there[-1]
    missing = [tube for tube in range(1, count + 1) if tube not in there]
    if missing or there[-1] > count:
        text = f"tube {missing[0]} has no row" if missing else f"tube {there[-1]} is not there: the robot has {count}"
        raise InputError(Problem(f"{text}: needs every tube, 1 to {count} from the innermost", table.file))
    return there


def _check_points(table: Table, names: list[str], cad: Array, point: Array) -> None:
    """Raises InputError where rows of one point differ in CAD coordinates, or a reading is not whole."""
    problems = []
    for row, name, xyz in zip(table.row.tolist(), table["point"], cad, strict=True):
        if np.max(np.abs(xyz - point[names.index(name)])) > 1e-6:
            text = f"the CAD coordinates of {name} differ from those in another row"
            problems.append(Problem(text, table.file, row, "cad_x", line_name="row"))
    known = np.isfinite(table.stacked(*AXES)).sum(axis=1)
    for row in table.row[(known > 0) & (known < 3)].tolist():
        problems.append(Problem("some of x, y, z are empty: fill in all or none", table.file, row, line_name="row"))
    if problems:
        raise InputError(problems)


def outliers(name: str, rows: Sequence[int]) -> list[str]:
    """A notice of outliers, by their rows of the file."""
    return [f"{name}: outliers, not used: rows {listed(rows, 10)}".removeprefix(": ")] if len(rows) else []


# ---- of a single tube


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
        raise ArgumentError(Problem("needs the tube's diameters: give --inner-mm and --outer-mm, or --robot, --tube"))
    if idle := table.row[table["load"] == 0].tolist():
        text = "no load bends nothing: leave this row out; --fit-zero finds a reading without load that is not 0"
        raise InputError(Problem(text, table.file, row, line_name="row") for row in idle)
    fit = computed(
        _core.fit_cantilever,
        table,
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
    ei = fit.bending_stiffness, fit.bending_stiffness_sd
    modulus, stiffness = _path(tube, "youngs_modulus_GPa"), _path(tube, "bending_stiffness_Nm2")
    name, of_EI = "bending stiffness EI", in_file(robot, _path(tube, "bending_stiffness"))
    rows = [  # the file holds one of the two
        Row("Young's modulus", "GPa", *gpa) if given_EI else row_of(robot, "Young's modulus", "GPa", *gpa, modulus),
        row_of(robot, name, "N m^2", *ei, stiffness) if given_EI else Row(name, "N m^2", *ei, of_EI),
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
    suspects = "another tube, its diameters, the unit of the load, the deflection or the length"
    return Outcome("Cantilever", rows, notices, figures, details, picture, suspects=suspects)


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
        raise ArgumentError(Problem("points in px need their scale: give --mm-per-px, or --reference, not both"))
    if unit != "px" and given:
        raise ArgumentError(Problem(f"points in {unit} have their scale: leave out --mm-per-px and --reference"))
    if reference is not None:
        scale = {"reference": np.array(reference[:4]).reshape(2, 2), "reference_length": 1e-3 * reference[4]}
    else:
        scale = {"scale": 1.0 if scale_mm is None else 1e-3 * scale_mm}
    fit = computed(
        _core.fit_tube_shape,
        table,
        points=np.ascontiguousarray(table.stacked("x", "y")),
        scale_sd=1e-2 * scale_sd_percent,
        point_sd=point_sd if unit == "px" else 1e-3 * point_sd,
        **scale,
    )
    sign = -1.0 if described is not None and described.curvature < 0 else 1.0  # a picture does not tell it
    curve, bent = (fit.curvature, fit.curvature_sd), (1e3 * fit.curved_length, 1e3 * fit.curved_length_sd)
    paths = _path(tube, "curvature_per_m"), _path(tube, "curved_length_mm")
    rows = [
        row_of(robot, "curvature", "1/m", sign * curve[0], curve[1], paths[0]),
        row_of(robot, "curved length", "mm", *bent, paths[1]),
        Row("radius", "mm", 1e3 * fit.radius),
        Row("straight length seen", "mm", 1e3 * fit.straight_length),
        Row("distance from the points, RMS", "mm", 1e3 * fit.rms),
    ]
    notices = [notice.text for notice in fit.notices] + outliers("", table.row[list(fit.outliers)])
    details = {"correlation": fit.correlation, "junction": fit.junction, "tip": fit.tip, "points_unit": unit}
    ends, bend = (np.asarray(fit.junction), np.asarray(fit.tip)), fit.curved_length / abs(fit.radius)
    caption = "The points on the fitted tube; the mark is where its curve starts."
    picture = Picture(figures_of.outline, (table.stacked("x", "y"), *ends, bend, list(fit.outliers)), caption, 5.0)
    suspects = "a picture of another tube, its scale"
    pair, figures = [(*paths, sign * fit.correlation)], {"shape_rms_mm": 1e3 * fit.rms}
    return Outcome("Shape of the tube", rows, notices, figures, details, picture, pair, suspects=suspects)


def _path(tube: int | None, field: str) -> FieldPath:
    """The field of a tube in the robot file; without such a file it is not used."""
    return ("tubes", (tube or 1) - 1, field)


def _described_tube(robot: Robot | None, tube: int | None):
    if robot is None:
        return None
    if tube is None:
        raise ArgumentError(Problem(f"give --tube, 1 to {robot.n_tubes} from the innermost: which tube was measured"))
    check_tube(tube, robot, robot._source.file)
    return robot.tubes[tube - 1]
