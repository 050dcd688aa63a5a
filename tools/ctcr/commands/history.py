"""`ctcr history`: what was changed in a robot file, when, from which data, and what it brought."""

import click


@click.command(name="history")
@click.argument("robot")
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects that it has.")
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output.")
def command(robot: str, own: tuple[str, ...], report: str | None, json_target: str | None) -> None:
    """Show the ledger of ROBOT: what was calibrated and added, and how the error fell on data that no fit had seen."""
    from ctcr.effects import user_effects
    from ctcr.robot import history, robot_file
    from ctcr.show import output

    user_effects.load_all(own)
    loaded = robot_file.load(robot)
    entries, stages = history.entries(loaded), history.waterfall(loaded)
    if report:
        history.write_report(loaded, report, robot)
    if json_target:
        data = {"entries": loaded.history, "waterfall": [vars(stage) for stage in stages]}
        output.write_json(data, json_target)
    console = output.console(json_target)
    history.show(console, loaded, entries, stages)
    if report:
        console.print(f"Report: {report}", markup=False)
