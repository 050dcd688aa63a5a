"""`ctcr remove`: a physical effect taken out of a robot file."""

import click

from ctcr.commands import options


@click.command(name="remove")
@options.robot
@click.argument("names", nargs=-1, required=True, metavar="EFFECT..")
@options.new_robot
def command(robot, names, target, in_place) -> None:
    """Take physical effects out of the file ROBOT.

    Parameters that were fitted together with them return to their earlier values.

    Example: ctcr remove robot.yaml friction -o without.yaml
    """
    from ctcr.calibrate import outcome
    from ctcr.diagnose import add
    from ctcr.robot import robot_file

    loaded, out = robot_file.load(robot), options.Output()
    target = outcome.check_target(loaded, target, in_place, needed=True)
    _, notices = add.remove(loaded, list(dict.fromkeys(names)), target, in_place)
    out.console.bullets(notices)
    out.say(f"{', '.join(names)} removed: {target}")
