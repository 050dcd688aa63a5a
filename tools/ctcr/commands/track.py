"""`ctcr track`: a robot follows a path in closed loop."""

import click

from ctcr.commands.options import folder_option


@click.command(name="track")
@click.argument("robot")
@click.argument("scenario")
@click.option("--plant", metavar="ROBOT2", help="What is controlled, where it differs from what the controller knows.")
@click.option("--live", is_flag=True, help="On the bench instead of a simulated robot; needs --bench and -o.")
@click.option("--bench", "bench_path", metavar="BENCH.yaml", help="The devices and their limits.")
@click.option("-o", "--output", "target", metavar="FOLDER", help="The recording; goes on with one there.")
@click.option(
    "--patience", type=click.FloatRange(0.1), default=2.0, show_default=True, help="With an unseen sensor [s]."
)
@click.option(
    "--most-error-mm",
    type=click.FloatRange(1),
    default=20.0,
    show_default=True,
    help="Stop where the tip is farther from its reference.",
)
@folder_option
@click.option("--report", metavar="FILE.html", help="Write one self-contained HTML page.")
@click.option("--json", "json_target", metavar="FILE", help="Write the numbers as JSON; - for standard output.")
def command(
    robot, scenario, plant, live, bench_path, target, patience, most_error_mm, folder, report, json_target
) -> None:
    """Let the controller that knows ROBOT follow the path of SCENARIO on a simulated robot, with --live on the bench.

    The paper's scenarios are examples/data/scenarios/S1.yaml to S4.yaml; S5.yaml goes beyond them. On the bench the
    pace is that of the tracker, where a weight differs from that before you are asked to hang it, and every reading is
    in FOLDER at once; the same command goes on behind the last whole run.
    """
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.track import scenario as scenario_file
    from ctcr.track.runs import run_all
    from ctcr.track.summary import COLUMNS, rows, summary

    loaded, console = robot_file.load(robot), output.console(json_target)
    if not live and (bench_path or target):
        raise click.UsageError("--bench and -o go with --live")
    if live:
        if plant or not bench_path or not target:
            raise click.UsageError("--live needs --bench and -o, and has no --plant")
        from ctcr.track.live import track

        runs, wanted = track(
            target,
            robot,
            scenario,
            bench_path,
            place=folder,
            patience_s=patience,
            most_error_mm=most_error_mm,
            said=lambda text: console.print(text, markup=False),
        )
        on = f" on the bench, into {target}"
    else:
        real = robot_file.load(plant) if plant else loaded
        wanted = scenario_file.load(scenario, loaded.n_tubes)
        with output.Progress("tracking", len(wanted.load.mass_g) * wanted.repetitions) as progress:
            runs = run_all(wanted, loaded, real, progress.advance)
        on = f" on {plant}" if plant else ""
    numbers = summary(runs)
    if report:
        from ctcr.track import report as page

        page.write(runs, wanted, loaded, report, f"{scenario} with {robot}{on}", measured=live)
    if json_target:
        output.write_json({"robot": loaded.name, "scenario": wanted.name, "weights": numbers}, json_target)
    title = f"{wanted.name}: tracking errors of {loaded.name} in mm, runs a weight: {wanted.repetitions}"
    console.print(output.table(title, ["weight", *COLUMNS], rows(numbers)))
    for weight, figures in numbers.items():
        console.print(f"{weight:>6}  {figures['verdict']}", markup=False)
    if report:
        console.print(f"Report: {report}", markup=False)
