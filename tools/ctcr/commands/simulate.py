"""`ctcr simulate`: measurements made by the model, to plan with."""

import click


@click.command(name="simulate")
@click.argument("robot")
@click.argument("plan")
@click.option(
    "--hide",
    "hidden",
    multiple=True,
    metavar="EFFECT[.PARAMETER[.TUBE]]=VALUE",
    help="Give the simulated robot an effect that ROBOT does not have; SI units (see ctcr effects EFFECT).",
)
@click.option(
    "--noise",
    type=click.Choice(["none", "jitter", "realistic"]),
    default="jitter",
    show_default=True,
    help="jitter: of the robot file; realistic: with the smooth error of the tracker's field and outliers too.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Another one: other noise.")
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects.")
@click.option("-o", "--output", "target", required=True, metavar="MEASUREMENTS", help="The table to write.")
def command(robot, plan, hidden, noise, seed, own, target) -> None:
    """Write what the tracker would read if ROBOT moved through the joints of PLAN, in their order.

    PLAN is a table as measurements are, poses not needed. The readings come from the same model that later explains
    them, so they serve to plan measurements and to learn the tools, never to prove the model right.
    """
    import numpy as np

    from ctcr.diagnose import add
    from ctcr.effects import user_effects
    from ctcr.effects.settings import settings
    from ctcr.model import simulation
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements

    user_effects.load_all(own)
    loaded = robot_file.load(robot)
    values = settings(hidden, loaded)
    names = list(dict.fromkeys(name.split(".")[1] for name in values))
    table = measurements.load(plan, loaded.n_tubes)
    made = simulation.simulate(add.with_values(loaded, names, values), table, noise, seed)
    simulation.write(made, target, loaded.n_tubes)
    console = output.console()
    unsolved = int(np.isnan(made.position).any(axis=1).sum())
    console.print(f"{len(made) - unsolved} readings, noise: {noise}, seed {seed}: {target}", markup=False)
    if unsolved:
        console.print(f"{unsolved} rows have no pose: the model has no solution there", markup=False)
