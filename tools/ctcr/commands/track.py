"""`ctcr track`: a robot follows a path in closed loop."""

import click

from ctcr.commands import options


@click.command(name="track")
@options.compiled_robot
@click.argument("scenario", type=options.read)
@options.reads("--plant", "ROBOT2", "The robot that is controlled, where it differs from ROBOT.")
@click.option("--live", is_flag=True, help="Track on the bench instead of on a simulated robot; needs --bench and -o.")
@options.bench("The devices and their limits.", required=False)
@options.output_folder("The recording; one that is there is resumed.")
@options.setting("--patience", options.Finite(0.1), 2.0, "How long the tracker may lose the sensor [s].")
@options.setting("--most-error-mm", options.Finite(1), 20.0, "Stop where the tip is farther from its reference [mm].")
@options.folder_name
@options.outputs
def command(robot, scenario, plant, live, bench_path, target, patience, most_error_mm, folder, out) -> None:
    """Follow a path in closed loop.

    A controller that knows ROBOT follows the path of SCENARIO, on a simulated robot or on the bench. SCENARIO is a
    YAML file with the path, the tasks, the limits, an obstacle and the weights at the tip. The paper's are
    examples/data/scenarios/S1.yaml to S4.yaml; S5.yaml goes beyond them. The result is the tracking error in mm for
    each weight, and which limit or task caused a failure.

    With --live the tracker sets the pace. You are asked to hang each weight, and every reading is on the disk at
    once; the same command resumes an interrupted recording after its last whole run.

    Example: ctcr track robot.yaml examples/data/scenarios/S3.yaml --report tracking.html
    """
    from ctcr.robot import robot_file
    from ctcr.show.output import Progress
    from ctcr.track import scenario as scenario_file
    from ctcr.track.result import COLUMNS, rows, summary
    from ctcr.track.runs import run_all

    loaded = robot_file.load(robot, compiled=True)
    if not live and (bench_path or target):
        raise click.UsageError("--bench and -o go with --live")
    if live and (plant or not bench_path or not target):
        raise click.UsageError("--live needs --bench and -o, and has no --plant")
    if live:
        from ctcr.track import live as bench

        stops = {"patience_s": patience, "most_error_mm": most_error_mm}
        runs, wanted = bench.track(target, robot, scenario, bench_path, place=folder, said=out.say, **stops)
    else:
        real = robot_file.load(plant, compiled=True) if plant else loaded
        wanted = scenario_file.load(scenario, loaded.n_tubes)
        with Progress("tracking", len(wanted.load.mass_g) * wanted.repetitions) as progress:
            runs = run_all(wanted, loaded, real, progress.advance)
    numbers = summary(runs)
    files = [robot, scenario, *filter(None, [plant, bench_path])]
    out.write_report("track.report", runs, files=files, scenario=wanted, robot=loaded, measured=live)
    out.write_json({"robot": loaded.name, "scenario": wanted.name, "weights": numbers})
    title = f"{wanted.name}: tracking errors of {loaded.name}, runs a weight: {wanted.repetitions}"
    out.table(title, COLUMNS, rows(numbers))
    out.say(*(f"{weight:>6}  {figures['verdict']}" for weight, figures in numbers.items()))
