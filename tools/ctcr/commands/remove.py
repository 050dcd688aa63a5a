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
    from ctcr import effect_fit, output, robot_file, user_effects
    from ctcr.calibrate import outcome
    from ctcr.errors import InputError, Problem

    user_effects.load_all(own)
    loaded = robot_file.load(robot)
    target = outcome.check_target(loaded, target, in_place)
    if not target:
        raise InputError(Problem("give -o: the robot file to write"))
    _, notices = effect_fit.remove(loaded, list(dict.fromkeys(names)), target, in_place)
    console = output.console()
    for notice in notices:
        console.print(f"  • {notice}", markup=False)
    console.print(f"{', '.join(names)} removed: {target}", markup=False)
