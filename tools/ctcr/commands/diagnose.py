"""`ctcr diagnose`: which physical effect is missing, and how sure that is."""

import click


@click.command(name="diagnose")
@click.argument("robot")
@click.argument("measurements")
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option("--json", "json_target", metavar="FILE", help="Write the verdict as JSON; - for standard output.")
@click.option(
    "--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects that may be missing too."
)
@click.option("--threads", type=click.IntRange(0), default=0, help="Threads; 0: all cores.")
def command(robot: str, measurements: str, report: str | None, json_target: str | None, own, threads: int) -> None:
    """Find out which physical effect the model of ROBOT lacks to explain MEASUREMENTS.

    Calibrates first, then fits every effect of the catalogue together with the calibration, accepts one at a time, and
    checks the result on runs that no fit saw. Says so when nothing is missing, when the data cannot tell effects apart,
    and when the cause is in no catalogue.
    """
    from ctcr.diagnose import diagnose, terminal
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements as table

    if own:
        from ctcr.effects import user_effects

        user_effects.load_all(own)
    loaded = robot_file.load(robot)
    readings = table.load(measurements, loaded.n_tubes)
    console = output.console(json_target)
    with terminal.progress() as say:
        result = diagnose(loaded, readings, progress=say, threads=threads)
    if report:
        from ctcr.diagnose import report as page

        page.write(result, report, f"{measurements} diagnosed with the model of {robot}")
    if json_target:
        output.write_json(result.as_json(), json_target)
    terminal.show(console, result)
    for warning in readings.warnings:
        console.print(f"{warning}", markup=False)
    if result.accepted and not result.verdict.names_no_cause:
        found = "FILE" if json_target in (None, "-") else json_target
        way = f"ctcr add {robot} --diagnosis {found} --fit {measurements} -o NEW.yaml"
        hint = " (FILE: that of --json)" if found == "FILE" else ""
        console.print(f"To add: {way}{hint}", markup=False, soft_wrap=True)
    if report:
        console.print(f"Report: {report}", markup=False)
