"""`ctcr compare`: how wrong the model is, and where."""

import click

CHUNK_ROWS = 1 << 16


@click.command(name="compare")
@click.argument("robot")
@click.argument("measurements")
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option("--json", "json_target", metavar="FILE", help="Write the numbers as JSON; - for standard output.")
@click.option(
    "--steps",
    type=click.IntRange(1, 1000),
    default=4,
    show_default=True,
    help="Integration steps per segment; more is finer and slower.",
)
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects that ROBOT has.")
def command(robot: str, measurements: str, report: str | None, json_target: str | None, steps: int, own) -> None:
    """Compare the model of ROBOT with the poses in MEASUREMENTS.

    Shows the size of the error against noise, the difference between visits of the same joints from opposite
    directions, and what the error depends on.
    """
    from ctcr.audit import missing_motion, spikes
    from ctcr.compare import compare, terminal
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements as table

    if own:
        from ctcr.effects import user_effects

        user_effects.load_all(own)
    loaded = robot_file.load(robot)
    readings = table.load(measurements, loaded.n_tubes)
    readings, spiked = spikes.left_out(loaded, readings)
    ways: list[str] = []
    if loaded.effects:  # they may remember what the table leaves out
        readings, ways = missing_motion.completed(loaded, readings)
    result = compare(loaded, readings, _predict(loaded, readings, steps), [f"{said}." for said in (*spiked, *ways)])
    if report:
        from ctcr.compare import report as page

        page.write(result, report, f"{measurements} compared with the model of {robot}")
    if json_target:
        output.write_json(result.as_dict(), json_target)
    console = output.console(json_target)
    terminal.show(console, result)
    for warning in readings.warnings:
        console.print(f"{warning}", markup=False)
    doubts = len(robot_file.warnings(loaded))
    if doubts:
        console.print(f"{doubts} things look wrong in the robot file: ctcr info {robot}", markup=False)
    if report:
        console.print(f"Report: {report}", markup=False)


def _predict(robot, readings, steps: int):
    """Predicted poses of all readings, in chunks so that a long table shows its progress; effects need all at once."""
    from types import SimpleNamespace

    import numpy as np

    from ctcr.model.model import Model
    from ctcr.show.output import Progress

    if robot.effects:
        from ctcr.model import effect_model

        return effect_model.readings(robot, readings, steps)
    model, parts = Model(robot, steps=steps), []
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    with Progress("predicting", len(readings)) as progress:
        for start in range(0, len(readings), CHUNK_ROWS):
            rows = slice(start, start + CHUNK_ROWS)
            parts.append(model.predict(beta[rows], alpha[rows], readings.force[rows]))
            progress.advance(len(readings.run[rows]))
    return SimpleNamespace(
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("position", "quaternion", "status")
        }
    )
