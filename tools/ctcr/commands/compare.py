"""`ctcr compare`: how wrong the model is, and where."""

import click

from ctcr.commands import options


@click.command(name="compare")
@options.robot
@options.measurements
@options.outputs
@options.steps
@options.effects
def command(robot: str, measurements: str, steps: int, out) -> None:
    """Compare predicted poses with measured ones.

    First tests whether the table or the robot file follows another convention: signs, units, order and zeros of the
    joints, the tracker frame, quaternions, the sign of the force, time, runs homed elsewhere, poses that repeat.

    Then the model of ROBOT predicts the poses of MEASUREMENTS. Shows the size of the error beside the noise, the
    hysteresis (difference between visits of the same joints from opposite directions), and which of joints, load
    and time the error depends on.

    Example: ctcr compare robot.yaml measurements.csv --report error.html
    """
    from ctcr.audit import missing_motion, spikes
    from ctcr.compare import compare, terminal
    from ctcr.robot import robot_file

    loaded, readings, conventions, refusal = options.reviewed(robot, measurements)
    corrected = []
    if refusal:
        loaded, readings = conventions.robot, conventions.readings
        corrected = ["the table as it is cannot be compared: all that follows is of the corrected one"]
    readings, repeated = options.without_repeated(readings, conventions)
    own, floor = _fitted(loaded, readings, conventions)
    predicted = _predict(loaded.standard, readings, steps)
    readings, excluded = spikes.left_out(loaded, readings, predicted.position)
    added: list[str] = []
    if loaded.effects:  # their state may depend on motions that the table leaves out
        readings, added = missing_motion.completed(loaded, readings)
        predicted = _predict(loaded, readings, steps)
    notices = [f"{said}." for said in (*corrected, *excluded, *added)] + repeated
    result = compare(loaded, readings, predicted, notices, conventions.findings, own, floor)
    out.write_report("compare.report", result, f"{measurements} compared with the model of {robot}")
    out.write_json(result.as_dict())
    terminal.show(out.console, result)
    out.say(*readings.warnings)
    if doubts := robot_file.warnings(loaded):
        out.say(f"{len(doubts)} values look wrong in the robot file: ctcr info {robot}")


def _fitted(robot, readings, conventions):
    """What a fit to the readings tells: sentences on what each run has of its own, and the floors of the error."""
    from ctcr.diagnose import sessions
    from ctcr.fit.floors import floors

    said: list[str] = []
    if not conventions.wrong:
        readings, said = sessions.of_runs(robot, readings)
    return said, floors(robot, readings).as_dict()


def _predict(robot, readings, steps: int):
    """Predicted poses of all readings: position (M, 3) [m], quaternion (M, 4), status (M,)."""
    from types import SimpleNamespace

    import numpy as np

    from ctcr.commands.predict import predictions

    parts = [answer for _, answer in predictions(robot, readings, steps)]
    names = ("position", "quaternion", "status")
    return SimpleNamespace(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
