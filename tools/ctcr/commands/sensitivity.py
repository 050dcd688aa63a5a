"""`ctcr sensitivity`: which parameters matter."""

import click


@click.command(name="sensitivity")
@click.argument("robot")
@click.option("--open-loop", type=click.IntRange(min=1), metavar="N", help="Predicted tips at N random configurations.")
@click.option("--closed-loop", metavar="SCENARIO", help="Tracking errors in a scenario.")
@click.option(
    "--accuracy",
    type=click.FloatRange(min=0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="MM",
    help="Wanted accuracy: which parameters must be calibrated for it?",
)
@click.option(
    "--force",
    type=click.FloatRange(min=0),
    default=0.3,
    show_default=True,
    metavar="N",
    help="Open loop: largest tip force.",
)
@click.option(
    "--points", type=click.IntRange(2, 101), default=5, show_default=True, help="Closed loop: places over each range."
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of the random configurations.")
@click.option("--resume", metavar="FILE", help="Keep the progress here, and go on from there after an interruption.")
@click.option("--dask", metavar="ADDRESS", help="Scheduler of a dask.distributed cluster that does the work.")
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option("--json", "json_target", metavar="FILE", help="Write the numbers as JSON; - for standard output.")
def command(robot, open_loop, closed_loop, accuracy, force, points, seed, resume, dask, report, json_target) -> None:
    """Vary each parameter of ROBOT over the paper's range, one at a time and together.

    Open loop: how far predicted tips move. Closed loop: how much larger the tracking error is when the controller's
    parameters are wrong. Ends with the fewest parameters that need calibration for a wanted accuracy.
    """
    from ctcr.errors import InputError, Problem
    from ctcr.robot import robot_file
    from ctcr.sensitivity import closed_loop as closed
    from ctcr.sensitivity import open_loop as opened
    from ctcr.sensitivity import terminal
    from ctcr.sensitivity.ranges import all_varied
    from ctcr.show import output
    from ctcr.track import scenario as scenario_file

    if not open_loop and not closed_loop:
        raise InputError(Problem("nothing to do: give --open-loop N, --closed-loop SCENARIO, or both"))
    loaded = robot_file.load(robot)
    wanted = scenario_file.load(closed_loop, loaded.n_tubes) if closed_loop else None
    varied, found = all_varied(loaded), {}
    if open_loop:
        keep = f"{resume}.open" if resume and closed_loop else resume
        with output.Progress("open loop", open_loop) as progress:
            found["open_loop"] = opened.study(
                loaded, varied, open_loop, most_force=force, seed=seed, dask=dask, keep=keep, advance=progress.advance
            )
    if wanted:
        keep = f"{resume}.closed" if resume and open_loop else resume
        with output.Progress("closed loop", 1 + len(varied) * points) as progress:
            found["closed_loop"] = closed.study(
                loaded, varied, wanted, points=points, dask=dask, keep=keep, advance=progress.advance
            )
    if report:
        from ctcr.sensitivity import report as page

        page.write(found, accuracy, report, robot, closed_loop)
    if json_target:
        output.write_json(terminal.as_data(loaded.name, found, accuracy), json_target)
    console = output.console(json_target)
    terminal.show(console, found, accuracy)
    if report:
        console.print(f"Report: {report}", markup=False)
