"""`ctcr remove`: a physical effect taken out of a robot file."""

import click


@click.command(name="remove")
@click.argument("robot")
@click.argument("names", nargs=-1, required=True, metavar="EFFECT..")
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects.")
@click.option("-o", "--output", "target", metavar="NEW", help="The robot file to write.")
@click.option("--in-place", is_flag=True, help="Change the robot file itself.")
def command(robot, names, own, target, in_place) -> None:
    """Take physical effects out of ROBOT; what was fitted together with them goes back to what it was."""
    from ctcr.calibrate import outcome
    from ctcr.diagnose import add
    from ctcr.effects import user_effects
    from ctcr.errors import InputError, Problem
    from ctcr.robot import robot_file
    from ctcr.show import output

    user_effects.load_all(own)
    loaded = robot_file.load(robot)
    target = outcome.check_target(loaded, target, in_place)
    if not target:
        raise InputError(Problem("give -o: the robot file to write"))
    _, notices = add.remove(loaded, list(dict.fromkeys(names)), target, in_place)
    console = output.console()
    for notice in notices:
        console.print(f"  • {notice}", markup=False)
    console.print(f"{', '.join(names)} removed: {target}", markup=False)
