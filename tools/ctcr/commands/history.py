"""`ctcr history`: what was changed in a robot file, when, from which data, and how the error fell."""

import click

from ctcr.commands import options


@click.command(name="history")
@options.robot
@options.outputs
def command(robot: str, out) -> None:
    """Show the ledger of a robot file.

    It holds each calibration and added effect, with date, data and error. Errors are those on held-out runs where
    there were any, in mm RMS.

    Example: ctcr history robot.yaml --report history.html
    """
    from ctcr.robot import history, robot_file

    loaded = robot_file.load(robot)
    entries, stages = history.entries(loaded), history.waterfall(loaded)
    out.write_report("robot.history", loaded)
    out.write_json({"entries": loaded.history, "waterfall": [vars(stage) for stage in stages]})
    history.show(out.console, loaded, entries, stages)
