"""`ctcr diagnose`: which physical effect is missing, and how sure that is."""

import click

from ctcr.commands import options


@click.command(name="diagnose")
@options.robot
@options.measurements
@options.outputs
@options.threads
@options.anyway
@options.frames
def command(robot: str, measurements: str, threads: int, anyway: bool, frame_per_run: bool | None, out) -> None:
    """Find the physical effect that a model lacks.

    Stops where the table or the robot file follows a wrong convention, as `ctcr compare` finds them. Else calibrates
    ROBOT to the poses in MEASUREMENTS first. Then fits every effect of the catalogue (`ctcr effects`) together with
    the calibration, accepts one at a time, and checks the result on held-out runs. The verdict also says when nothing
    is missing, when the data cannot tell effects apart, and when no effect of the catalogue explains the error.

    Example: ctcr diagnose robot.yaml measurements.csv --json diagnosis.json --report diagnosis.html
    """
    from ctcr.api.diagnose import diagnose
    from ctcr.api.reviewed import WrongConventions
    from ctcr.conventions import report
    from ctcr.diagnose import next_commands, terminal

    loaded, readings = options.load(robot, measurements, any_convention=True)
    try:
        with terminal.progress() as say:
            result = diagnose(
                loaded, readings, anyway=anyway, frame_per_run=frame_per_run, threads=threads, progress=say
            )
    except WrongConventions as wrong:
        found = wrong.review
        out.write_report("conventions.report", found)
        out.write_json(report.as_diagnosis(found))
        out.say(*options.doubtful(loaded, robot, in_full=True))
        report.show(out.console, found)
        out.say(*readings.doubts)
        return
    out.write_page(result)
    out.write_json(result.as_dict())
    out.say(*options.doubtful(loaded, robot))
    terminal.show(out.console, result)
    if result.accepted and not result.verdict.names_no_cause:
        way = next_commands.to_add(result, out.json_target if out.json_target != "-" else None)
        out.console.print(f"To add: {way}", soft_wrap=True)  # one line, to be copied
