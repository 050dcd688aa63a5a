"""`ctcr add`: a physical effect put into a robot file, fitted to measurements."""

import click

from ctcr.commands import options
from ctcr.errors import InputError, Problem


@click.command(name="add")
@options.robot
@click.argument("names", nargs=-1, metavar="[EFFECT..]")
@options.reads("--diagnosis", "FILE.json", "Add the effects that `ctcr diagnose --json FILE.json` found.")
@options.reads("--fit", "MEASUREMENTS", "Fit the effects to this table.", "measurements")
@options.repeated(
    "--set", "given", "NAME=VALUE", "Fix a parameter instead of fitting it, SI units: friction.coefficient.1=0.02."
)
@options.free
@options.anyway
@options.frames
@options.new_robot
@options.outputs
def command(robot, names, diagnosis, measurements, given, free, anyway, frame_per_run, target, in_place, out) -> None:
    """Add physical effects to a robot file.

    Every command then uses them; `ctcr effects` lists them. With --fit the effects are fitted together with the
    parameters of --free. Every fourth run is held out and judges the error; the values written come from a fit to
    all runs. Without --fit the effects take the values of --set, and otherwise their neutral ones, which change
    nothing. The history of the file keeps the old values.

    Example: ctcr add robot.yaml friction --fit measurements.csv -o new.yaml
    """
    from pathlib import Path

    from ctcr.api.add import add
    from ctcr.calibrate import outcome
    from ctcr.diagnose.add import write_values
    from ctcr.effects import catalogue
    from ctcr.effects.settings import diagnosed, settings
    from ctcr.robot import robot_file

    tables = [name for name in names if Path(name).is_file()]
    if tables:
        raise click.UsageError(f"{tables[0]} is a file and not an effect: --fit {tables[0]} fits the effects to it")
    loaded = robot_file.load(robot)
    target = outcome.check_target(loaded, target, in_place, needed=True)
    found, held, start = diagnosed(diagnosis, loaded) if diagnosis else ([], {}, {})
    ids = list(dict.fromkeys(catalogue.get(name, loaded.n_tubes).id for name in [*names, *found]))
    if not ids:
        if diagnosis:
            raise InputError(Problem("nothing was found to add", diagnosis))
        raise click.UsageError("name an effect: see ctcr effects")
    fixed = held | settings(given, loaded, ids)
    if not measurements:
        if out.report:
            raise click.UsageError("--report shows a fit: give --fit MEASUREMENTS")
        after = catalogue.with_values(loaded, ids, fixed)
        write_values(loaded, after, ids, target, in_place)
        out.write_json({"effects": after.effects})
        out.say(f"{', '.join(ids)} added, not fitted (--fit MEASUREMENTS fits): {target}")
        return
    loaded, readings = options.load(robot, measurements, any_convention=True)
    given = {"fixed": fixed, "start": start, "free": free, "anyway": anyway, "frame_per_run": frame_per_run}
    added = add(loaded, ids, readings, **given)
    added.save(target, in_place=in_place)
    out.write_json(added.as_dict())
    out.write_page(added)
    _show(out, loaded, added)
    out.say(f"Robot file: {target}")


def _show(out, robot, added) -> None:
    from math import isfinite

    from ctcr.diagnose import terminal

    fitted = ((name, found["value"], found["sd"]) for name, found in added.parameters().items())
    terminal.show_fitted(out.console, robot.n_tubes, fitted)
    units = ["mm", "deg"] if isfinite(added.stages[0].rms_deg) else ["mm"]
    rows = [
        [stage.name.replace("_", " "), *(f"{getattr(stage, f'rms_{unit}'):.3f}" for unit in units)]
        for stage in added.stages
        if stage.name != "noise_floor"
    ]
    rows += [[name, f"{value:.3f}", *["" for _ in units[1:]]] for name, value in added.floors.rows()]
    on = f"held-out data ({added.held_out})" if added.held_out else "the rows that were fitted"
    out.table(f"Error on {on}, RMS", ["", *units], rows)
    out.console.bullets(added.notices)
