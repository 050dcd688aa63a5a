"""`ctcr simulate`: measurements made by the model, to plan with."""

import click

from ctcr.commands import options


@click.command(name="simulate")
@options.robot
@click.argument("plan", type=options.read)
@options.hide
@options.noise
@options.seed
@options.output("MEASUREMENTS.csv", "The table to write.", required=True)
def command(robot, plan, hidden, noise, seed, target) -> None:
    """Simulate the measurements of a plan.

    Writes the poses that the tracker would read if ROBOT moved through the joints of PLAN, in their order. PLAN is
    a table with the columns of a table of measurements (beta1_m, alpha1_rad, fx_N, ...); it needs no poses. The
    readings come from the same model that later explains them. They serve to plan measurements and to learn the
    tools, and cannot show that the model is right.

    Example: ctcr simulate robot.yaml plan.csv --hide friction.coefficient=0.02 -o measurements.csv
    """
    import numpy as np

    from ctcr.model import simulation
    from ctcr.show.wording import counted

    loaded, table = options.load(robot, plan)
    made = simulation.simulate(options.with_effects(loaded, hidden), table, noise, seed)
    simulation.write(made, target)
    out, unsolved = options.Output(), int(np.isnan(made.position).any(axis=1).sum())
    out.say(f"{counted(len(made) - unsolved, 'reading')}, noise: {noise}, seed {seed}: {target}")
    if unsolved:
        out.say(f"{counted(unsolved, 'row')} without pose: the model has no solution there")
