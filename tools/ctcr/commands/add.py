"""`ctcr add`: a physical effect put into a robot file, fitted to measurements."""

import click


@click.command(name="add")
@click.argument("robot")
@click.argument("names", nargs=-1, metavar="[EFFECT..]")
@click.option(
    "--diagnosis", metavar="FILE.json", help="Add what ctcr diagnose --json found, in the form in which it was found."
)
@click.option("--fit", "measurements", metavar="MEASUREMENTS", help="Fit the effects to this table.")
@click.option(
    "--set",
    "given",
    multiple=True,
    metavar="NAME=VALUE",
    help="Give a parameter its value (SI) instead of fitting it: friction.coefficient.1=0.02.",
)
@click.option(
    "--free",
    default="standard",
    show_default=True,
    metavar="NAMES",
    help="What is fitted together with the effects, as in ctcr calibrate fit.",
)
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects.")
@click.option("-o", "--output", "target", metavar="NEW", help="The robot file to write.")
@click.option("--in-place", is_flag=True, help="Change the robot file itself.")
@click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output.")
def command(robot, names, diagnosis, measurements, given, free, own, target, in_place, json_target) -> None:
    """Add physical effects to ROBOT (see ctcr effects), so that every command uses them.

    With --fit they are fitted together with the calibration; the error is judged on runs that the fit has not seen.
    Without, they have the values of --set, and else change nothing. The old values stay in the file's history.
    """
    from ctcr.calibrate import outcome
    from ctcr.diagnose import add
    from ctcr.effects import catalogue, user_effects
    from ctcr.effects.settings import diagnosed, settings
    from ctcr.errors import InputError, Problem
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements as table

    user_effects.load_all(own)
    loaded = robot_file.load(robot)
    target = outcome.check_target(loaded, target, in_place)
    if not target:
        raise InputError(Problem("give -o: the robot file to write"))
    found, held, start = diagnosed(diagnosis, loaded) if diagnosis else ([], {}, {})
    ids = list(dict.fromkeys(catalogue.get(name, loaded.n_tubes).id for name in [*names, *found]))
    if not ids:
        raise InputError(
            Problem("nothing was found to add", diagnosis) if diagnosis else Problem("name an effect: see ctcr effects")
        )
    fixed = held | settings(given, loaded, ids)
    console = output.console(json_target)
    if not measurements:
        after = add.with_values(loaded, ids, fixed)
        add.write_values(loaded, after, ids, target, in_place)
        console.print(f"{', '.join(ids)} added, not fitted (--fit MEASUREMENTS fits): {target}", markup=False)
        if json_target:
            output.write_json({"effects": after.effects}, json_target)
        return
    readings = table.load(measurements, loaded.n_tubes)
    added = add.add(loaded, readings, ids, fixed=fixed, start=start, free=free.split(","))
    add.write_added(loaded, added, target, measurements, in_place)
    if json_target:
        output.write_json(_as_data(added), json_target)
    _report(console, loaded, added)
    for warning in readings.warnings:
        console.print(f"{warning}", markup=False)
    console.print(f"Robot file: {target}", markup=False)


def _as_data(added) -> dict:
    return {
        "added": added.ids,
        "effects": added.robot.effects,
        "parameters": added.parameters(),
        "rms_mm": added.rms("rms_mm"),
        "rms_deg": added.rms("rms_deg"),
        "held_out": added.held_out,
        "reduced_chi_square": added.fit.reduced_chi_square,
        "converged": added.fit.converged,
        "notices": added.notices,
    }


def _report(console, robot, added) -> None:
    from math import isfinite

    from ctcr.diagnose import fitted_effects
    from ctcr.show.output import table

    fitted = ((name, found["value"], found["sd"]) for name, found in added.parameters().items())
    fitted_effects.show(console, robot.n_tubes, fitted)
    on = f"what the fit has not seen ({added.held_out})" if added.held_out else "the rows that were fitted"
    with_angle = isfinite(added.stages[0].rms_deg)
    rows = [
        [stage.name.replace("_", " "), f"{stage.rms_mm:.3f}", *([f"{stage.rms_deg:.3f}"] if with_angle else [])]
        for stage in added.stages
    ]
    console.print(table(f"Error on {on}, RMS", ["", "mm", *(["deg"] if with_angle else [])], rows))
    for notice in added.notices:
        console.print(f"  • {notice}", markup=False)
