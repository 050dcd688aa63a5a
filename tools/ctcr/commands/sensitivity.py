"""`ctcr sensitivity`: which parameters matter."""

import click

from ctcr.commands.options import output_options, robot_argument, seed_option


def _number(name: str, metavar: str, default: float, text: str, **bounds):
    kind = click.FloatRange(min=0, **bounds)
    return click.option(name, type=kind, default=default, show_default=True, metavar=metavar, help=text)


@click.command(name="sensitivity")
@robot_argument
@click.option("--open-loop", type=click.IntRange(min=1), metavar="N", help="Predict tips at N random configurations.")
@click.option("--closed-loop", metavar="SCENARIO", help="Track the path of this scenario file.")
@_number("--accuracy", "MM", 1.0, "Wanted accuracy [mm]: which parameters need calibration for it?", min_open=True)
@_number("--force", "N", 0.3, "Open loop: largest tip force [N].")
@click.option(
    "--points", type=click.IntRange(2, 101), default=5, show_default=True, help="Closed loop: values over each range."
)
@seed_option
@click.option("--resume", metavar="FILE", help="Keep the progress in FILE, and resume from it after an interruption.")
@click.option("--dask", metavar="ADDRESS", help="Scheduler of a dask.distributed cluster that does the work.")
@output_options
def command(robot, open_loop, closed_loop, accuracy, force, points, seed, resume, dask, out) -> None:
    """Vary each parameter of ROBOT over the paper's range, one at a time and together.

    Open loop: how far predicted tips move. Closed loop: how much the tracking error grows when the controller's
    parameters are wrong. Ends with the fewest parameters that need calibration for the wanted accuracy.

    Example: ctcr sensitivity robot.yaml --open-loop 10000 --accuracy 0.5
    """
    from ctcr.errors import InputError, Problem
    from ctcr.robot import robot_file
    from ctcr.sensitivity import closed_loop as closed
    from ctcr.sensitivity import open_loop as opened
    from ctcr.sensitivity import terminal
    from ctcr.sensitivity.ranges import all_varied
    from ctcr.show.output import Progress
    from ctcr.track import scenario as scenario_file

    if not open_loop and not closed_loop:
        raise InputError(Problem("nothing to do: give --open-loop N, --closed-loop SCENARIO, or both"))
    loaded = robot_file.load(robot)
    wanted = scenario_file.load(closed_loop, loaded.n_tubes) if closed_loop else None
    both, varied, found = open_loop and wanted, all_varied(loaded), {}
    if open_loop:
        keep = f"{resume}.open" if resume and both else resume
        options = {"most_force": force, "seed": seed, "dask": dask, "keep": keep}
        with Progress("open loop", open_loop) as progress:
            found["open_loop"] = opened.study(loaded, varied, open_loop, advance=progress.advance, **options)
    if wanted:
        keep = f"{resume}.closed" if resume and both else resume
        options = {"points": points, "dask": dask, "keep": keep}
        with Progress("closed loop", 1 + len(varied) * points) as progress:
            found["closed_loop"] = closed.study(loaded, varied, wanted, advance=progress.advance, **options)
    source = robot + (f" in {closed_loop}" if closed_loop else "")
    out.write_report("sensitivity.report", found, source, accuracy=accuracy)
    out.write_json(terminal.as_data(loaded.name, found, accuracy))
    terminal.show(out.console, found, accuracy)
