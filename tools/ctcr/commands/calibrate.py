"""`ctcr calibrate`: the procedures that measure one thing at a time, and the joint fit to pose measurements."""

import click

from ctcr.commands.options import folder_option


@click.group(name="calibrate")
def command() -> None:
    """Calibrate a robot: measure its parts one by one, or fit named parameters to measured poses.

    Every value comes with its standard deviation. With -o (or --in-place) the values go into a robot file, which keeps
    the old ones, their source and the date under `history`. Columns of the tables carry their unit in the name and may
    come in another one of the same kind: x_mm or x_m, motor_angle_deg, _rad or _rev, load_N, _mN or _g.
    """


def _outputs(function):
    """The options that all procedures share."""
    for option in (
        click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output."),
        click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page."),
        click.option("--in-place", is_flag=True, help="Change the robot file itself."),
        click.option("-o", "--output", "target", metavar="NEW", help="Write the updated robot file."),
    ):
        function = option(function)
    return function


_robot = click.option("--robot", metavar="ROBOT", help="The robot file: what it states is used, and updated with -o.")
_tube = click.option("--tube", type=click.IntRange(1, 9), help="The tube measured, innermost 1 (with --robot).")


def _live(function):
    """The options of procedures that the bench can carry out."""
    for option in (
        folder_option,
        click.option(
            "--readings", type=click.IntRange(2), default=20, show_default=True, help="With --live, of each row."
        ),
        click.option("--bench", metavar="BENCH.yaml", help="With --live: the devices and their limits."),
        click.option("--live", is_flag=True, help="Measure now; the table is written row by row, or gone on with."),
    ):
        function = option(function)
    return function


def _desk(bench, folder, console):
    from ctcr.bench.devices import bench_file, person
    from ctcr.bench.devices.private_folder import private_folder
    from ctcr.calibrate.live import Desk

    if not bench:
        raise click.UsageError("--live needs --bench")
    devices, place = bench_file.load(bench), private_folder(folder)
    return Desk(devices, place, person.person_of(devices, place), lambda text: console.print(text, markup=False))


def _length(name: str, default: float | None, text: str):
    shown = default is not None
    return click.option(name, type=click.FloatRange(min=0), default=default, show_default=shown, help=text)


def _run(name: str, room: str, procedure: str, table, robot, target, in_place, json_target, report, **options) -> None:
    """Runs a procedure of ctcr.calibrate.procedures or .specimens; its columns have its name in capitals."""
    from importlib import import_module

    from ctcr.calibrate import outcome, tables
    from ctcr.robot import robot_file

    room = import_module(f"ctcr.calibrate.{room}")
    loaded = robot_file.load(robot) if robot else None
    target = outcome.check_target(loaded, target, in_place)
    data = tables.read(table, getattr(room, procedure.upper()))
    found = getattr(room, procedure)(data, loaded, **options)
    outcome.deliver(found, loaded, f"ctcr calibrate {name}", [table], target, in_place, json_target, report)


@command.command(name="rotation-offset")
@click.argument("table")
@_robot
@click.option("--ratio", type=float, help="Turns of a tube in one turn of its motor; else as in ROBOT.")
@_live
@click.option(
    "--step-deg", type=click.FloatRange(1, 90), default=20.0, show_default=True, help="With --live: between rows."
)
@click.option(
    "--deployed-mm", type=click.FloatRange(min=1), help="With --live: how far a tube stands out; else its curved part."
)
@_outputs
def rotation_offset(table: str, robot, ratio, live, bench, readings, folder, step_deg, deployed_mm, **outputs) -> None:
    """Home rotations from circles: one tube alone is out of the plate and turns, both ways.

    TABLE: motor_angle_deg, x_mm, y_mm, z_mm of the tip (tracker frame); tube (default 1) and direction (1 or -1,
    default: from the order of the rows) may be added, and where a row is a mean scatter_mm (standard deviation of one
    reading, per axis) and readings. One row per reading, in the order measured.

    With --live the bench turns the tubes of ROBOT and writes TABLE; you are asked to move the sensor from tip to tip.
    """
    if live:
        import math

        from ctcr.calibrate.live import Circles, rotation_table
        from ctcr.robot import robot_file
        from ctcr.show import output

        if not robot:
            raise click.UsageError("--live needs --robot")
        deployed = None if deployed_mm is None else 1e-3 * deployed_mm
        desk = _desk(bench, folder, output.console(outputs["json_target"]))
        rotation_table(table, robot_file.load(robot), desk, Circles(math.radians(step_deg), readings, deployed))
    _run("rotation-offset", "procedures", "rotation_offsets", table, robot, ratio=ratio, **outputs)


@command.command(name="registration")
@click.argument("points")
@_robot
@_length("--placement-sd-mm", 0.0, "How far the probe may sit from a CAD point, per axis; 0: from the residuals.")
@_live
@click.option("--cad", metavar="CAD.csv", help="With --live: names and places of the points, columns as POINTS.")
@click.option("--rounds", type=click.IntRange(1), default=1, show_default=True, help="With --live: over all points.")
@_outputs
def registration(points: str, robot, placement_sd_mm, live, bench, readings, folder, cad, rounds, **outputs) -> None:
    """The tracker frame T_ref from named points on the robot, read with a probe.

    POINTS: point (its name), cad_x_mm, cad_y_mm, cad_z_mm (base frame), x_mm, y_mm, z_mm (reading, tracker frame);
    scatter_mm and readings as in rotation-offset. Several rows may read one point. A point without reading is a target:
    its expected error is told.

    With --live you are told which point of CAD.csv to touch; it is read when the probe is still, and POINTS is written.
    """
    if live:
        from ctcr.calibrate import tables
        from ctcr.calibrate.live import point_table
        from ctcr.calibrate.procedures import CAD_POINTS
        from ctcr.show import output

        if not cad:
            raise click.UsageError("--live needs --cad")
        desk = _desk(bench, folder, output.console(outputs["json_target"]))
        point_table(points, tables.read(cad, CAD_POINTS), desk, readings, rounds)
    _run("registration", "procedures", "registration", points, robot, placement_sd_mm=placement_sd_mm, **outputs)


@command.command(name="home")
@click.argument("table")
@_robot
@click.option("--pitch-mm", type=float, help="How far a tube moves in one turn of its motor; else as in ROBOT.")
@_length("--distance-sd-mm", 1.0, "Standard deviation of a distance measured by hand.")
@_length("--flush-sd-mm", 0.2, "Standard deviation of bringing a tip flush with the plate.")
@_length("--length-sd-mm", 1.0, "Standard deviation of a length measured by hand.")
@_outputs
def home(table: str, robot, pitch_mm, distance_sd_mm, flush_sd_mm, length_sd_mm, **outputs) -> None:
    """Home translations and effective lengths of the tubes.

    TABLE: tube; distance_mm (plate to the grasped point at home, by hand); flush_angle_rev (motor angle with the tip
    flush with the plate) and home_angle_rev (default 0); length_mm (grasped point to tip). Two of distance, flush
    angle and length for each tube; an empty field was not measured; several rows a tube are averaged.
    """
    sds = {"distance_sd": distance_sd_mm, "flush_sd": flush_sd_mm, "length_sd": length_sd_mm}
    _run("home", "procedures", "home", table, robot, pitch_mm=pitch_mm, sds_mm=sds, **outputs)


@command.command(name="cantilever")
@click.argument("table")
@_robot
@_tube
@_length("--inner-mm", None, "Inner diameter; else as in ROBOT.")
@_length("--outer-mm", None, "Outer diameter; else as in ROBOT.")
@_length("--deflection-sd-mm", 0.0, "Standard deviation of a deflection; 0: from the residuals.")
@_length("--free-length-sd-mm", 0.0, "Standard deviation of the free length, common to all rows.")
@_length("--diameter-sd-mm", 0.0, "Standard deviation of each diameter.")
@click.option("--fit-zero", is_flag=True, help="The reading without load is not known: find it too.")
@_outputs
def cantilever(
    table, robot, tube, inner_mm, outer_mm, deflection_sd_mm, free_length_sd_mm, diameter_sd_mm, fit_zero, **outputs
) -> None:
    """Young's modulus from a straight piece of tube, clamped at one end and loaded across.

    TABLE: load_N (or load_g, a hung mass), deflection_mm (at the free end), free_length_mm (clamp to end);
    load_distance_mm (clamp to load, default: at the end) may be added. Large deflections are allowed.
    """
    sds = {"deflection_sd": deflection_sd_mm, "free_length_sd": free_length_sd_mm, "diameter_sd": diameter_sd_mm}
    _run(
        "cantilever",
        "specimens",
        "cantilever",
        table,
        robot,
        tube=tube,
        inner_mm=inner_mm,
        outer_mm=outer_mm,
        sds_mm=sds,
        fit_zero=fit_zero,
        **outputs,
    )


@command.command(name="curvature")
@click.argument("table")
@_robot
@_tube
@click.option("--mm-per-px", "scale_mm", type=click.FloatRange(min=0, min_open=True), help="Scale of the picture.")
@_length("--scale-sd-percent", 0.0, "Standard deviation of the scale.")
@click.option(
    "--reference",
    type=(float, float, float, float, float),
    default=None,
    metavar="X1 Y1 X2 Y2 MM",
    help="Two points of the picture (px) and their distance (mm) instead of the scale.",
)
@_length("--point-sd", 0.0, "Standard deviation of a point, in its unit; 0: from the residuals.")
@_outputs
def curvature(table: str, robot, tube, scale_mm, scale_sd_percent, reference, point_sd, **outputs) -> None:
    """Curvature and curved length of a tube from points along its picture.

    TABLE: x_px, y_px (or x_mm, y_mm) along the tube, in any order, over the curved part and some of the straight one.
    """
    _run(
        "curvature",
        "specimens",
        "curvature",
        table,
        robot,
        tube=tube,
        scale_mm=scale_mm,
        scale_sd_percent=scale_sd_percent,
        reference=reference,
        point_sd=point_sd,
        **outputs,
    )


@command.command(name="fit")
@click.argument("robot")
@click.argument("measurements")
@click.option(
    "--free",
    default="standard",
    show_default=True,
    metavar="NAMES",
    help="What is fitted: names such as tubes.*.youngs_modulus,tracker.frame, or standard.",
)
@click.option(
    "--sd",
    "widths",
    multiple=True,
    metavar="NAME=SD",
    help="What is known of a parameter: a standard deviation in the unit of the robot file, or inf. May be repeated.",
)
@click.option("--frame-per-run", is_flag=True, help="Fit a tracker frame for every run.")
@click.option(
    "--hold-out",
    type=click.IntRange(min=0),
    metavar="N",
    help="Runs kept out of a second fit to judge it, evenly spread; 0: none; default: a quarter.",
)
@click.option(
    "--noise",
    type=click.Choice(["auto", "jitter", "field"]),
    default="auto",
    show_default=True,
    help="The tracker's jitter, or also the smooth error that its accuracy allows; auto: what the data call for.",
)
@_outputs
def fit(
    robot, measurements, free, widths, report, frame_per_run, hold_out, noise, target, in_place, json_target
) -> None:
    """Fit named parameters of ROBOT to the poses in MEASUREMENTS, all together.

    What is known before, the robot file's `uncertainty`, counts as measurements do. Tells what the data determine and
    what not, the error on runs that a fit has not seen, and the noise floor that no fit can get below.
    """
    from ctcr.calibrate import joint_fit, outcome, terminal
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements as table

    loaded = robot_file.load(robot)
    target = outcome.check_target(loaded, target, in_place)
    readings = table.load(measurements, loaded.n_tubes)
    names = [name.strip() for name in free.split(",") if name.strip()]
    calibration = joint_fit.calibrate(
        loaded,
        readings,
        names,
        frame_per_run=frame_per_run,
        hold_out=hold_out,
        halves=report is not None,
        noise=noise,
        sd=_widths(widths),
    )
    if target:
        joint_fit.write_robot(calibration, target, measurements, in_place=in_place)
    if report:
        from ctcr.calibrate import report as page

        page.write(calibration, report, f"{measurements} fitted with {robot}")
    if json_target:
        output.write_json(calibration.as_dict(), json_target)
    console = output.console(json_target)
    terminal.show(console, calibration)
    for warning in readings.warnings:
        console.print(f"{warning}", markup=False)
    for name, file in (("Report", report), ("Robot file", target)):
        if file:
            console.print(f"{name}: {file}", markup=False)


def _widths(texts: tuple[str, ...]) -> dict[str, float]:
    """What NAME=SD options say."""
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise click.BadParameter(f"{text!r} is not NAME=SD, such as tubes.*.poisson_ratio=0.05") from None
    return found
