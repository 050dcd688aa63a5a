"""`ctcr track`: a robot follows a path in closed loop."""

import click


@click.command(name="track")
@click.argument("robot")
@click.argument("scenario")
@click.option(
    "--plant", metavar="ROBOT2", help="What is controlled, where it differs from what the controller knows."
)
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option(
    "--json", "json_target", metavar="FILE", help="Write the numbers as JSON; - for standard output."
)
def command(
    robot: str, scenario: str, plant: str | None, report: str | None, json_target: str | None
) -> None:
    """Let the controller that knows ROBOT follow the path of SCENARIO on a simulated robot.

    The paper's scenarios are examples/data/scenarios/S1.yaml to S4.yaml; S5.yaml goes beyond them.
    """
    from ctcr import output, robot_file
    from ctcr.track import scenario as scenario_file
    from ctcr.track.runs import run_all
    from ctcr.track.summary import COLUMNS, rows, summary

    loaded = robot_file.load(robot)
    real = robot_file.load(plant) if plant else loaded
    wanted = scenario_file.load(scenario, loaded.n_tubes)
    with output.Progress("tracking", len(wanted.load.mass_g) * wanted.repetitions) as progress:
        runs = run_all(wanted, loaded, real, progress.advance)
    numbers = summary(runs)
    if report:
        from ctcr.track import report as page

        page.write(
            runs, wanted, loaded, report, f"{scenario} with {robot}" + (f" on {plant}" if plant else "")
        )
    if json_target:
        output.write_json({"robot": loaded.name, "scenario": wanted.name, "weights": numbers}, json_target)
    console = output.console(json_target)
    title = f"{wanted.name}: tracking errors of {loaded.name} in mm, {wanted.repetitions} runs a weight"
    console.print(output.table(title, ["weight", *COLUMNS], rows(numbers)))
    for weight, figures in numbers.items():
        console.print(f"{weight:>6}  {figures['verdict']}", markup=False)
    if report:
        console.print(f"Report: {report}", markup=False)
