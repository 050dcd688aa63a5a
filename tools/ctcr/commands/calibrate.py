"""`ctcr calibrate`: the procedures that measure one quantity each, and the joint fit to pose measurements."""

import click

from ctcr.commands import options


@click.group(name="calibrate")
def command() -> None:
    """Measure parts of a robot, or fit parameters to poses.

    Every value comes with its standard deviation. With -o (or --in-place) the values go into a robot file, which
    keeps the old ones, their source and the date under `history`. Columns of the tables carry their unit in the
    name and may come in another one of the same kind: x_mm or x_m, motor_angle_deg, _rad or _rev, load_N, _mN or
    _g.

    Example: ctcr calibrate fit robot.yaml measurements.csv -o calibrated.yaml
    """


def _procedure(function):
    """The options that all procedures share: `robot`, `target`, `in_place` and `out`."""
    robot = options.robot_option("The robot file: its values are used, and updated with -o.")
    return robot(options.new_robot(options.outputs(function)))


def _live(function):
    """The options of procedures that the bench can carry out."""
    for option in (
        options.folder_name,
        options.setting("--readings", click.IntRange(2), 20, "With --live: readings per row."),
        options.bench("With --live: the devices and their limits.", required=False),
        click.option("--live", is_flag=True, help="Measure now: write the table row by row, or resume the one there."),
    ):
        function = option(function)
    return function


def _desk(bench_path, folder, out):
    from ctcr.bench.devices import bench_file, person
    from ctcr.bench.shared.folder import private_folder
    from ctcr.calibrate.live import Desk

    if not bench_path:
        raise click.UsageError("--live needs --bench")
    devices, place = bench_file.load(bench_path), private_folder(folder)
    return Desk(devices, place, person.person_of(devices, place), out.say)


_tube = click.option("--tube", type=click.IntRange(1, 9), help="The tube measured, innermost 1 (with --robot).")


def _length(name: str, default: float | None, text: str, least: float = 0):
    return options.setting(name, options.Finite(least), default, text)


def _run(procedure: str, table: str, robot, target, in_place, out, **chosen) -> None:
    """Runs a function of ctcr.calibrate.procedures, whose columns are its name in capitals, and gives the result."""
    from ctcr.calibrate import outcome, procedures, tables
    from ctcr.robot import robot_file

    called = f"ctcr calibrate {click.get_current_context().info_name}"
    loaded = robot_file.load(robot) if robot else None
    target = outcome.check_target(loaded, target, in_place)
    data = tables.read(table, getattr(procedures, procedure.upper()))
    found = getattr(procedures, procedure)(data, loaded, **chosen)
    _give(found, loaded, target, in_place, called, table, out)


def _give(found, robot, target, in_place, called: str, table: str, out) -> None:
    """Gives an Outcome back: robot file, report, JSON, text."""
    from ctcr.calibrate import outcome

    found = outcome.judged(found, robot)
    if target:
        outcome.write_robot(found, robot, target, called, table, in_place)
    out.write_report("calibrate.outcome", found, files=[*(robot.files if robot else []), table], robot=robot)
    out.write_json(found.as_dict())
    outcome.show(out.console, found)
    if target:
        out.say(f"Robot file: {target}")


@command.command(name="rotation-offset")
@click.argument("table", type=options.read)
@click.option("--ratio", type=float, help="Turns of a tube per turn of its motor; default: as in ROBOT.")
@_live
@options.setting("--step-deg", options.Finite(1, 90), 20.0, "With --live: angle between rows.")
@_length("--deployed-mm", None, "How far the tube stands out; default: its curved length.", least=1)
@_procedure
def rotation_offset(
    table, robot, ratio, live, bench_path, readings, folder, step_deg, deployed_mm, out, **target
) -> None:
    """Home rotations from circles: one tube alone stands out of the plate and turns, forward and backward.

    TABLE: motor_angle_deg, x_mm, y_mm, z_mm of the tip (tracker frame). Optional: tube (default 1), direction (1 or -1,
    default: from the order of the rows), and where a row is a mean, scatter_mm (standard deviation of one reading, per
    axis) and readings (their number). One row per reading, in the order measured.

    With --live the bench turns the tubes of ROBOT and writes TABLE; you are asked to move the sensor from tip to tip.

    Example: ctcr calibrate rotation-offset circles.csv --robot robot.yaml -o new.yaml
    """
    if live:
        import math

        from ctcr.calibrate.live import Circles, rotation_table
        from ctcr.robot import robot_file

        if not robot:
            raise click.UsageError("--live needs --robot")
        deployed = None if deployed_mm is None else 1e-3 * deployed_mm
        circles = Circles(math.radians(step_deg), readings, deployed)
        rotation_table(table, robot_file.load(robot), _desk(bench_path, folder, out), circles)
    _run("rotation_offsets", table, robot, out=out, ratio=ratio, deployed_mm=deployed_mm, **target)


@command.command(name="registration")
@click.argument("points", type=options.read)
@_length("--placement-sd-mm", 0.0, "Standard deviation of the probe from a CAD point, per axis; 0: from the residuals.")
@_live
@options.reads(
    "--cad", "CAD.csv", "With --live: file with the names and coordinates of the points, in the columns of POINTS."
)
@options.setting("--rounds", click.IntRange(1), 1, "With --live: rounds over all points.")
@_procedure
def registration(
    points, robot, placement_sd_mm, live, bench_path, readings, folder, cad, rounds, out, **target
) -> None:
    """The tracker frame T_ref from named points on the robot, read with a probe.

    POINTS: point (its name), cad_x_mm, cad_y_mm, cad_z_mm (base frame), x_mm, y_mm, z_mm (reading, tracker frame);
    optional: scatter_mm and readings as in rotation-offset. Several rows may read one point. A point without reading
    is a target, whose expected error (TRE) is given.

    With --live you are asked to touch each point of CAD.csv; it is read when the probe is still, and POINTS is written.

    Example: ctcr calibrate registration points.csv --robot robot.yaml -o new.yaml
    """
    if live:
        from ctcr.calibrate import tables
        from ctcr.calibrate.live import point_table
        from ctcr.calibrate.procedures import CAD_POINTS

        if not cad:
            raise click.UsageError("--live needs --cad")
        point_table(points, tables.read(cad, CAD_POINTS), _desk(bench_path, folder, out), readings, rounds)
    _run("registration", points, robot, out=out, placement_sd_mm=placement_sd_mm, **target)


@command.command(name="frame")
@options.robot
@options.measurements
@options.anyway
@options.new_robot
@options.outputs
def frame(robot, measurements, anyway, target, in_place, out) -> None:
    """The tracker frame T_ref from poses of the tip alone, wherever ROBOT says that the tracker is.

    A registration in closed form of the predicted tips on those of MEASUREMENTS gives a start; then a fit finds
    position_mm and rotation_vector_rad. Homes and tubes keep their values, and their uncertainty in the robot file
    counts in that of the frame. Names shifts and turns that the readings do not determine. Stops where another
    convention is wrong, as `ctcr compare` says.

    Example: ctcr calibrate frame robot.yaml measurements.csv -o new.yaml
    """
    from ctcr.api.reviewed import to_fit
    from ctcr.calibrate import outcome
    from ctcr.calibrate.frame import tracker_frame

    loaded, table = options.load(robot, measurements, any_convention=True)
    finds = ("frame_inverse", "frame_wrong")
    readings, said, _ = to_fit(loaded, table, anyway=anyway, frame_per_run=False, finds=finds)
    target = outcome.check_target(loaded, target, in_place)
    found = tracker_frame(loaded, readings)
    found.notices[:0] = said
    _give(found, loaded, target, in_place, "ctcr calibrate frame", measurements, out)


@command.command(name="home")
@click.argument("table", type=options.read)
@click.option("--pitch-mm", type=float, help="Translation of a tube per turn of its motor; default: as in ROBOT.")
@_length("--distance-sd-mm", 1.0, "Standard deviation of a distance measured by hand.")
@_length("--flush-sd-mm", 0.2, "Standard deviation of bringing a tip flush with the plate.")
@_length("--length-sd-mm", 1.0, "Standard deviation of a length measured by hand.")
@_procedure
def home(table: str, distance_sd_mm, flush_sd_mm, length_sd_mm, **others) -> None:
    """Home translations and effective lengths of the tubes.

    TABLE: tube; distance_mm (plate to the grasped point at home, by hand); flush_angle_rev (motor angle with the tip
    flush with the plate) and home_angle_rev (default 0); length_mm (grasped point to tip). Two of distance, flush
    angle and length for each tube; an empty field was not measured; several rows of a tube are averaged.

    Example: ctcr calibrate home home.csv --robot robot.yaml -o new.yaml
    """
    sds = {"distance_sd": distance_sd_mm, "flush_sd": flush_sd_mm, "length_sd": length_sd_mm}
    _run("home", table, sds_mm=sds, **others)


@command.command(name="cantilever")
@click.argument("table", type=options.read)
@_tube
@_length("--inner-mm", None, "Inner diameter; default: as in ROBOT.")
@_length("--outer-mm", None, "Outer diameter; default: as in ROBOT.")
@_length("--deflection-sd-mm", 0.0, "Standard deviation of a deflection; 0: from the residuals.")
@_length("--free-length-sd-mm", 0.0, "Standard deviation of the free length, common to all rows.")
@_length("--diameter-sd-mm", 0.0, "Standard deviation of each diameter.")
@click.option("--fit-zero", is_flag=True, help="Fit the reading without load too, where it is not known to be 0.")
@_procedure
def cantilever(table: str, deflection_sd_mm, free_length_sd_mm, diameter_sd_mm, **others) -> None:
    """Young's modulus from a straight piece of tube, clamped at one end and loaded across.

    TABLE: load_N (or load_g, a hung mass), deflection_mm (at the free end), free_length_mm (clamp to end); optional:
    load_distance_mm (clamp to load, default: at the end). Deflections may be large.

    Example: ctcr calibrate cantilever cantilever.csv --robot robot.yaml --tube 1 -o new.yaml
    """
    sds = {"deflection_sd": deflection_sd_mm, "free_length_sd": free_length_sd_mm, "diameter_sd": diameter_sd_mm}
    _run("cantilever", table, sds_mm=sds, **others)


@command.command(name="curvature")
@click.argument("table", type=options.read)
@_tube
@click.option("--mm-per-px", "scale_mm", type=options.Finite(min=0, min_open=True), help="Scale of the picture.")
@_length("--scale-sd-percent", 0.0, "Standard deviation of the scale.")
@click.option(
    "--reference",
    type=(float,) * 5,
    default=None,
    metavar="X1 Y1 X2 Y2 MM",
    help="Two points of the picture [px] and their distance [mm], instead of the scale.",
)
@_length("--point-sd", 0.0, "Standard deviation of a point, in its unit; 0: from the residuals.")
@_procedure
def curvature(table: str, **others) -> None:
    """Curvature and curved length of a tube from points along its picture.

    TABLE: x_px, y_px (or x_mm, y_mm) along the tube, in any order, over the curved part and some of the straight part.

    Example: ctcr calibrate curvature picture.csv --robot robot.yaml --tube 2 --mm-per-px 0.0833 -o new.yaml
    """
    _run("curvature", table, **others)


@command.command(name="fit")
@options.robot
@options.measurements
@options.free
@options.repeated(
    "--sd", "widths", "NAME=SD", "Prior standard deviation of a parameter, in the unit of the robot file, or inf."
)
@options.frames
@click.option(
    "--hold-out",
    type=click.IntRange(min=0),
    metavar="N",
    help="Runs held out of a second fit to judge it, evenly spread; 0: none; default: each quarter in turn.",
)
@options.setting(
    "--noise",
    click.Choice(["auto", "jitter", "field"]),
    "auto",
    "jitter: the tracker's white noise; field: also its smooth error; auto: the one that the data support.",
)
@options.anyway
@options.new_robot
@options.outputs
def fit(robot, measurements, free, widths, frame_per_run, hold_out, noise, anyway, target, in_place, out) -> None:
    """Fit named parameters of ROBOT to the poses in MEASUREMENTS, all together (maximum a posteriori).

    The `uncertainty` of the robot file gives the priors. Shows which parameters the data determine and which they do
    not, the error on held-out runs, and the expected error of a right model (jitter, tracker field up to its stated
    accuracy, parameter uncertainty). Stops where a convention is wrong, as `ctcr compare` says.

    Example: ctcr calibrate fit robot.yaml measurements.csv --free standard -o calibrated.yaml --report fit.html
    """
    from ctcr.api.calibrate import calibrate
    from ctcr.calibrate import outcome, report

    loaded, readings = options.load(robot, measurements, any_convention=True)
    target = outcome.check_target(loaded, target, in_place)
    chosen = {"free": free, "hold_out": hold_out, "noise": noise, "sd": _widths(widths), "anyway": anyway}
    calibration = calibrate(loaded, readings, halves=out.report is not None, frame_per_run=frame_per_run, **chosen)
    if target:
        calibration.save(target, in_place=in_place)
    out.write_page(calibration)
    out.write_json(calibration.as_dict())
    report.show(out.console, calibration)
    if target:
        out.say(f"Robot file: {target}")


def _widths(texts: tuple[str, ...]) -> dict[str, float]:
    """Standard deviations by name, from NAME=SD options."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise click.BadParameter(f"{text!r} is not NAME=SD, such as tubes.*.poisson_ratio=0.05") from None
    return found
