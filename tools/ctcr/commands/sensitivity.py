"""`ctcr sensitivity`: which parameters matter."""

import click

from ctcr.commands import options


@click.command(name="sensitivity")
@options.compiled_robot
@click.option("--open-loop", type=click.IntRange(min=1), metavar="N", help="Predict tips at N random configurations.")
@options.reads("--closed-loop", "SCENARIO", "Track the path of this scenario file.")
@options.setting(
    "--accuracy", options.Finite(0, min_open=True), 1.0, "Wanted accuracy [mm]: which parameters need calibration?"
)
@options.setting("--force", options.Finite(0), 0.3, "Open loop: largest tip force [N].")
@options.setting("--points", click.IntRange(2, 101), 5, "Closed loop: values over each range.")
@options.seed
@options.writes("--resume", "FILE", "Keep the progress in FILE, and resume from it after an interruption.")
@click.option("--dask", metavar="ADDRESS", help="Scheduler of a dask.distributed cluster that does the work.")
@options.outputs
def command(robot, open_loop, closed_loop, accuracy, force, points, seed, resume, dask, out) -> None:
    """Find out which parameters matter.

    Each parameter of ROBOT is varied over the paper's range, one at a time and together. Open loop: how far
    predicted tips move. Closed loop: how much the tracking error grows when the controller's parameters are wrong.
    Ends with the fewest parameters that need calibration for the wanted accuracy.

    Example: ctcr sensitivity robot.yaml --open-loop 10000 --accuracy 0.5
    """
    from ctcr.errors import ArgumentError, Problem
    from ctcr.robot import robot_file
    from ctcr.sensitivity import closed_loop as closed
    from ctcr.sensitivity import open_loop as opened
    from ctcr.sensitivity import terminal
    from ctcr.sensitivity.ranges import all_varied
    from ctcr.show.output import Progress
    from ctcr.track import scenario as scenario_file

    if not open_loop and not closed_loop:
        raise ArgumentError(Problem("nothing to do: give --open-loop N, --closed-loop SCENARIO, or both"))
    loaded = robot_file.load(robot, compiled=True)
    wanted = scenario_file.load(closed_loop, loaded.n_tubes) if closed_loop else None
    both, varied, found = open_loop and wanted, all_varied(loaded), {}
    if open_loop:
        keep = f"{resume}.open" if resume and both else resume
        chosen = {"most_force": force, "seed": seed, "dask": dask, "keep": keep}
        with Progress("open loop", open_loop) as progress:
            found["open_loop"] = opened.study(loaded, varied, open_loop, advance=progress.advance, **chosen)
    if wanted:
        keep = f"{resume}.closed" if resume and both else resume
        chosen = {"points": points, "dask": dask, "keep": keep}
        with Progress("closed loop", 1 + len(varied) * points) as progress:
            found["closed_loop"] = closed.study(loaded, varied, wanted, advance=progress.advance, **chosen)
    files = [robot, *([closed_loop] if closed_loop else [])]
    out.write_report("sensitivity.report", found, files=files, accuracy=accuracy)
    out.write_json(terminal.as_data(loaded.name, found, accuracy))
    terminal.show(out.console, found, accuracy)
