"""`ctcr compare`: how wrong the model is, and where."""

import click

from ctcr.commands import options


@click.command(name="compare")
@options.robot
@options.measurements
@options.outputs
@options.steps
def command(robot: str, measurements: str, steps: int, out) -> None:
    """Compare predicted poses with measured ones.

    First tests whether the table or the robot file follows another convention: signs, units, order and zeros of the
    joints, the tracker frame, quaternions, the sign of the force, time, runs homed elsewhere, poses that repeat or
    are those of the row before, units of the robot file.

    Then the model of ROBOT predicts the poses of MEASUREMENTS. Shows the size of the error beside the noise, the
    hysteresis (difference between visits of the same joints from opposite directions), and which of joints, load
    and time the error depends on.

    Example: ctcr compare robot.yaml measurements.csv --report error.html
    """
    from ctcr.api.compare import compare
    from ctcr.compare import terminal

    loaded, readings = options.load(robot, measurements, any_convention=True)
    result = compare(loaded, readings, steps=steps)
    out.write_page(result)
    out.write_json(result.as_dict())
    out.say(*options.doubtful(loaded, robot, in_full=bool(result.conventions)))
    terminal.show(out.console, result)
