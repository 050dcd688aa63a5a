"""`ctcr init`: a new robot file."""

import os
import shlex

import click

from ctcr.commands import options

DIRECTIONS = {"unknown": None, "-x": 0, "-y": 1, "-z": 2, "+x": 0, "+y": 1, "+z": 2}


@click.command(name="init")
@options.output("ROBOT.yaml|.yml", "The robot file to write.", required=True)
@click.option("--name", help="Name of the robot.")
@click.option(
    "--tube",
    "tubes",
    multiple=True,
    metavar="FIELD=VALUE,...",
    help="A tube, the innermost first: length_mm, outer_diameter_mm, inner_diameter_mm, curved_length_mm, radius_mm or "
    "curvature_per_m, youngs_modulus_GPa (60), poisson_ratio (0.3), density_kg_m3 (6450).",
)
@click.option("--example", type=click.IntRange(1, 4), metavar="N", help="Invented numbers for N tubes, to replace.")
@click.option(
    "--gravity",
    type=click.Choice(list(DIRECTIONS)),
    help="Where weights fall in the base frame, whose z is along the insertion; unknown (default): no weight.",
)
@click.option("--sensor-on-tube", type=click.IntRange(1, 4), help="The tube with the sensor; default 1, innermost.")
@click.option(
    "--home-mm", type=options.Numbers(), metavar="B1,B2,..", help="beta of each tube at home; default: flush tips."
)
def command(target, name, tubes, example, gravity, sensor_on_tube, home_mm) -> None:
    """Write a new robot file.

    It needs dimensions and precurvature of the tubes; all else gets a default that a comment in the file explains.
    Without --tube and --example it asks.

    \b
    Example: ctcr init -o robot.yaml --tube
    length_mm=300,outer_diameter_mm=1.3,inner_diameter_mm=1,curved_length_mm=60,radius_mm=100
    """
    from ctcr.errors import InputError, Problem
    from ctcr.robot import new_file, robot_file
    from ctcr.show.output import write_text
    from ctcr.show.wording import counted

    if os.path.exists(target):
        raise InputError(Problem("exists already: give another name, or remove it", target))
    if tubes and example:
        raise click.UsageError("--tube and --example exclude each other")
    if tubes:
        robot = new_file.NewRobot(new_file.tubes_of(tubes))
    elif example:
        robot = new_file.example(example)
    else:
        robot, gravity = _asked(new_file, gravity)
        if not sensor_on_tube and len(robot.tubes) > 1:
            text = "Tube that carries the sensor (1: the innermost)"
            sensor_on_tube = click.prompt(text, type=click.IntRange(1, len(robot.tubes)), default=1)
    robot.name = name or robot.name
    robot.sensor_on_tube = sensor_on_tube or 1
    robot.gravity = _vector(gravity or "unknown")
    robot.home_mm = home_mm or []
    if any(home > 0 for home in robot.home_mm):
        given = ",".join(f"{home:g}" for home in home_mm)
        text = f"{given}: beta is 0 at the front plate and negative behind it: write --home-mm=-400,-300"
        raise InputError(Problem(text, field="--home-mm"))
    text = new_file.text(robot)
    loaded = robot_file.parse(text.encode(), target)
    write_text(text, target)
    out = options.Output()
    out.say(f"{target}: {counted(loaded.n_tubes, 'tube')}; comments in it say which values are defaults")
    for i, tube in enumerate(robot.tubes, start=1):
        if tube.curvature_per_m is None:
            out.say(f"Doubt: tube {i} counts as straight, as no curvature was given; radius_mm=inf says that it is")
    out.say(*(f"Doubt: {doubt}" for doubt in robot_file.warnings(loaded) if doubt.field != "gravity"))
    out.say(f"Next: {shlex.join(['ctcr', 'import', 'LOG', '-o', 'measurements.csv', '--robot', target])}")


def _asked(new_file, gravity):
    """A robot by questions, and the direction of gravity."""
    robot = new_file.NewRobot([], click.prompt("Name", default="my robot"))
    count = click.prompt("Number of tubes", type=click.IntRange(1, 4))
    for i in range(1, count + 1):
        options.Output().say(f"Tube {i}{' (innermost)' if i == 1 else ''}, lengths from the grasped end to the tip")
        length = _ask("  length [mm]")
        outer = _ask("  outer diameter [mm]")
        inner = _ask("  inner diameter [mm]")
        text = "  radius of the precurved part [mm], or its curvature such as 12.5/m; 0 for a straight tube"
        bent = click.prompt(text, value_proc=_bent)
        curved = _ask("  length of the precurved part [mm]") if bent else 0.0
        modulus = click.prompt("  Young's modulus [GPa]", type=float, default=new_file.NITINOL_GPA)
        robot.tubes.append(new_file.NewTube(length, outer, inner, curved, bent, modulus))
    if gravity is None:
        text = "Where weights fall in the base frame (z along the insertion)"
        gravity = click.prompt(text, type=click.Choice(list(DIRECTIONS)), default="unknown")
    return robot, gravity


def _bent(answer: str) -> float:
    """Curvature [1/m] of a radius in mm such as 80, or of itself such as 12.5/m."""
    from ctcr.robot.new_file import curvature

    number = answer.strip().removesuffix("/m")
    try:
        return curvature(float(number)) if number == answer.strip() else float(number)
    except ValueError:
        raise click.BadParameter(f"{answer!r} is neither a radius nor a curvature") from None


def _ask(text: str) -> float:
    return click.prompt(text, type=options.Finite(min=0))


def _vector(direction: str) -> list[float] | None:
    axis = DIRECTIONS[direction]
    return None if axis is None else [(-9.80665 if direction[0] == "-" else 9.80665) * (i == axis) for i in range(3)]
