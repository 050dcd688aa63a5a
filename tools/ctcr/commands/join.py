"""`ctcr join`: recordings of one session as one table."""

import click

from ctcr.commands import options


@click.command(name="join")
@options.robot
@click.argument("tables", nargs=-1, type=options.read, required=True, metavar="MEASUREMENTS...")
@options.output("TABLE.csv|.txt", "The table to write.", required=True)
def command(robot, tables, target) -> None:
    """Join the tables of one session.

    MEASUREMENTS of ROBOT, in the order in which they were recorded, become one table. The joints must not have moved
    between these recordings, such as a first one and the one that `ctcr next` proposed. The numbers of the runs
    continue; times follow from the recordings' session.json.

    Example: ctcr join robot.yaml first/measurements.csv second/measurements.csv -o both.csv
    """
    from ctcr.bench.record.joined import joined, start_of
    from ctcr.model import simulation
    from ctcr.robot import robot_file
    from ctcr.table import measurements

    n = robot_file.load(robot).n_tubes
    whole = joined([measurements.load(table, n) for table in tables], [start_of(table) for table in tables])
    simulation.write(whole, target)
    options.Output().say(f"{len(whole)} rows of {len(tables)} tables: {target}")
