"""The procedures that measure one thing of the robot at a time: from a small table to an Outcome.

The numbers come from the core.
"""

from math import degrees, isfinite, nan

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ctcr import _core
from ctcr.calibrate import procedure_figures as figures_of
from ctcr.calibrate.outcome import Outcome, Picture, Row, computed
from ctcr.calibrate.tables import Column, Table
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot
from ctcr.robot.ledger import Change
from ctcr.show.output import listed

Array = NDArray[np.float64]

SIGMAS_AT_95 = 2.80  # the norm of a 3-D Gaussian is below 2.80 standard deviations of an axis in 95 % of cases
AXES = "xyz"

SCATTER = (  # of a reading that is the mean of several: their standard deviation per axis, and how many
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
    Column("distance", "length", needed=False, filled=False),
    Column("flush_angle", "angle", needed=False, filled=False),
    Column("length", "length", needed=False, filled=False),
)


def tracker_noise(robot: Robot | None, table: Table | None = None) -> dict[str, float]:
    """Jitter and smooth error of a reading per axis [m], as the robot file states them; 0: not known.

    The jitter of a table whose readings are means is that of their scatter.
    """
    noise = {}
    if robot is not None:
        noise["jitter"] = 1e-3 * (robot.tracker.jitter_mm or 0.0)
        noise["field_error"] = 1e-3 * (robot.tracker.accuracy_95_mm or 0.0) / SIGMAS_AT_95
    if table and "scatter" in table and "readings" in table:
        known = (table["readings"] > 0) & np.isfinite(table["scatter"])
        if known.any():
            variance = table["scatter"][known] ** 2 / table["readings"][known]
            noise["jitter"] = float(np.sqrt(variance.mean()))
    return noise


def rotation_offsets(table: Table, robot: Robot | None, ratio: float | None) -> Outcome:
    """Home rotations from circles of the tip, one tube alone at a time. Ref: Boyer et al., eq. (5)."""
    tubes = table["tube"] if "tube" in table else np.ones(len(table), np.int64)
    ratio = _rotation_ratio(robot, ratio)
    rows, notices, changes, details, circles = [], [], [], {}, []
    for tube in np.unique(tubes).tolist():
        mine = np.flatnonzero(tubes == tube)
        check_tube(tube, robot, table.file, int(table.row[mine[0]]))
        fit = computed(
            _core.fit_rotation_offset,
            table.file,
            motor_angle=table["motor_angle"][mine],
            position=np.ascontiguousarray(table.stacked(*AXES)[mine]),
            direction=table["direction"][mine].astype(np.int8) if "direction" in table else None,
            ratio=ratio,
            T_ref=_tracker_pose(robot) if robot else None,
            bend_angle=-np.pi / 2 if robot is None or robot.tubes[tube - 1].curvature >= 0 else np.pi / 2,
            **tracker_noise(robot, table),
        )
        name = f"tube {tube}"
        old = robot.actuation.home_rotation_deg[tube - 1] if robot else nan
        offset = degrees(fit.offset)
        if robot:
            offset += 360 * round((old - offset) / 360)  # the same angle, on the turn of the old value
            changes.append(Change(("actuation", "home_rotation_deg", tube - 1), "deg", offset, degrees(fit.offset_sd)))
        rows.append(Row(f"{name}: rotation offset", "deg", offset, degrees(fit.offset_sd), old))
        for way in ("forward", "backward"):
            value, sd = getattr(fit, f"offset_{way}"), getattr(fit, f"offset_{way}_sd")
            if isfinite(value):
                turned = degrees(value) + 360 * round((offset - degrees(value)) / 360)
                rows.append(Row(f"    turning {way}", "deg", turned, degrees(sd)))
        rows.append(Row("    radius of the circle", "mm", 1e3 * fit.radius, 1e3 * fit.radius_sd))
        rows.append(Row("    distance from the circle, RMS", "mm", 1e3 * fit.rms))
        notices += [f"{name}: {notice.text}" for notice in fit.notices]
        notices += left_out(name, [int(table.row[mine[i]]) for i in fit.outliers])
        position, angle = table.stacked(*AXES)[mine], table["motor_angle"][mine]
        moved = np.diff(angle)
        forward = table["direction"][mine] > 0 if "direction" in table else np.append(moved[:1], moved) > 0
        circles.append(figures_of.circle_of(name, position, ratio * angle, forward, fit, robot))
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
        "Left: the readings on the circle fitted to them. Right: how far the tip is from where its motor says; where "
        "the two ways differ, friction or backlash holds it back."
    )
    picture = Picture(figures_of.circles, circles, caption, figures_of.ROW_HEIGHT * len(circles))
    return Outcome("Rotation offsets", rows, notices, changes, figures, {"tubes": details}, picture)


def registration(table: Table, robot: Robot | None, placement_sd_mm: float) -> Outcome:
    """T_ref from named points: CAD coordinates in the base frame, probe readings in the tracker frame."""
    names = list(dict.fromkeys(table["point"]))
    cad, reading = table.stacked(*(f"cad_{axis}" for axis in AXES)), table.stacked(*AXES)
    first = np.array([table["point"].index(name) for name in names])
    place = cad[first]
    _check_same_place(table, names, cad, place)
    measured = np.isfinite(reading).all(axis=1)
    read = [name for name, there in zip(table["point"], measured, strict=True) if there]
    targets = np.array([name not in read for name in names])
    fit = computed(
        _core.register_points,
        table.file,
        names=[name for name, target in zip(names, targets, strict=True) if not target],
        cad=np.ascontiguousarray(place[~targets]),
        reading_names=read,
        readings=np.ascontiguousarray(reading[measured]),
        targets=np.ascontiguousarray(place[targets]) if targets.any() else None,
        placement_sd=1e-3 * placement_sd_mm,
        **tracker_noise(robot, table),
    )
    position, turn = 1e3 * fit.T_ref[:3, 3], Rotation.from_matrix(fit.T_ref[:3, :3]).as_rotvec()
    old_position = robot.tracker.position_mm if robot else [nan] * 3
    old_turn = robot.tracker.rotation_vector_rad if robot else [nan] * 3
    rows = [
        Row(f"origin of the base frame, {axis}", "mm", position[i], 1e3 * fit.position_sd[i], old_position[i])
        for i, axis in enumerate(AXES)
    ]
    rows += [
        Row(f"rotation vector, {axis}", "rad", turn[i], fit.rotation_sd[i], old_turn[i]) for i, axis in enumerate(AXES)
    ]
    rows.append(Row("error at the points, RMS", "mm", 1e3 * fit.fre))
    names_of_targets = [name for name, target in zip(names, targets, strict=True) if target]
    rows += [
        Row(f"expected error at {name}, RMS", "mm", 1e3 * tre)
        for name, tre in zip(names_of_targets, fit.tre, strict=True)
    ]
    changes = [Change(("tracker", "position_mm", i), "mm", position[i], 1e3 * fit.position_sd[i]) for i in range(3)]
    changes += [Change(("tracker", "rotation_vector_rad", i), "rad", turn[i]) for i in range(3)]
    residual = 1e3 * np.linalg.norm(fit.residuals, axis=1)
    figures = {"fiducial_error_rms_mm": 1e3 * fit.fre, "rotation_sd_deg": np.degrees(fit.rotation_sd)}
    details = {
        "points": [
            {
                "name": name,
                "residual_mm": 1e3 * vector,
                "distance_mm": size,
                "readings": count,
                "outlier": name in fit.outliers,
            }
            for name, vector, size, count in zip(fit.names, fit.residuals, residual, fit.counts, strict=True)
        ],
        "T_ref_m": fit.T_ref,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "repeatability_mm": 1e3 * fit.repeatability_sd,
    }
    where = 1e3 * np.array([place[names.index(name)] for name in fit.names])
    caption = "Left: where the readings lie against the CAD points. Right: how far."
    picture = Picture(figures_of.points, (where, fit), caption, 4.4)
    return Outcome("Tracker frame", rows, [notice.text for notice in fit.notices], changes, figures, details, picture)


def home(table: Table, robot: Robot | None, pitch_mm: float | None, sds_mm: dict[str, float]) -> Outcome:
    """Home translations and effective lengths, from what is measured by hand and by the encoders."""
    tubes = _all_tubes(table, robot)
    pitch = robot.actuation.translation_mm_per_rev if robot and pitch_mm is None else pitch_mm
    if pitch is None:
        raise InputError(Problem("give --pitch-mm, how far a tube moves in one turn of its motor, or --robot"))

    def values(tube: int, name: str) -> list[float]:
        if name not in table:
            return []
        mine = table[name][table["tube"] == tube]
        return mine[np.isfinite(mine)].tolist()

    measured = []
    for tube in tubes:
        angles = values(tube, "home_angle")
        measured.append(
            _core.TubeHome(
                home_angle=float(np.mean(angles)) if angles else 0.0,
                distances=values(tube, "distance"),
                flush_angles=values(tube, "flush_angle"),
                lengths=values(tube, "length"),
            )
        )
    fit = computed(
        _core.home_offsets,
        table.file,
        translation_ratio=1e-3 * pitch / (2 * np.pi),
        tubes=measured,
        **{name: 1e-3 * sd for name, sd in sds_mm.items()},
    )
    rows, changes = [], []
    for i, tube in enumerate(tubes):
        for name, path, value, sd, old in (
            (
                "home translation",
                ("actuation", "home_translation_mm", i),
                fit.offset[i],
                fit.offset_sd[i],
                robot.actuation.home_translation_mm[i] if robot else nan,
            ),
            (
                "length",
                ("tubes", i, "length_mm"),
                fit.length[i],
                fit.length_sd[i],
                robot.tubes[i].length_mm if robot else nan,
            ),
        ):
            rows.append(Row(f"tube {tube}: {name}", "mm", 1e3 * value, 1e3 * sd, old))
            changes.append(Change(path, "mm", 1e3 * value, 1e3 * sd))
        rows.append(Row("    deployed at home", "mm", 1e3 * fit.deployed[i], 1e3 * fit.deployed_sd[i]))
    old = [
        [robot.actuation.home_translation_mm[i], robot.actuation.home_translation_mm[i] + robot.tubes[i].length_mm]
        if robot
        else [nan, nan]
        for i in range(len(tubes))
    ]
    ends = (1e3 * np.array(fit.offset), 1e3 * np.array(fit.deployed))
    sd = 1e3 * np.column_stack([fit.offset_sd, fit.deployed_sd])
    caption = "The tubes at home, two standard deviations at the grasped point and at the tip; grey: the robot file."
    picture = Picture(figures_of.homes, (tubes, *ends, sd, np.array(old)), caption, 1.6 + 0.5 * len(tubes))
    return Outcome(
        "Home", rows, [notice.text for notice in fit.notices], changes, {}, {"correlation": fit.correlation}, picture
    )


def _tracker_pose(robot: Robot) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = robot.tracker.rotation, robot.tracker.position
    return pose


def _rotation_ratio(robot: Robot | None, ratio: float | None) -> float:
    if ratio is None and robot is not None:
        ratio = robot.actuation.rotation_rev_per_rev
    if ratio is None:
        raise InputError(Problem("give --ratio, turns of a tube in one turn of its motor, or --robot"))
    return ratio


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


def _check_same_place(table: Table, names: list[str], cad: Array, place: Array) -> None:
    problems = []
    for name, there in zip(names, place, strict=True):
        for i, (other, point) in enumerate(zip(table["point"], cad, strict=True)):
            if other == name and np.max(np.abs(point - there)) > 1e-6:
                text = f"the CAD coordinates of {name} differ from those in another row"
                problems.append(Problem(text, table.file, int(table.row[i]), "cad_x", line_name="row"))
    partly = np.isfinite(table.stacked(*AXES)).sum(axis=1)
    for row in table.row[(partly > 0) & (partly < 3)]:
        text = "some of x, y, z are empty: fill in all or none"
        problems.append(Problem(text, table.file, int(row), line_name="row"))
    if problems:
        raise InputError(problems)


def left_out(name: str, rows: list[int]) -> list[str]:
    """A notice of outliers, by their rows of the file."""
    if not rows:
        return []
    return [f"{name}: outliers, not used: rows {listed(rows, 10)}".removeprefix(": ")]
