"""`ctcr record`: measurements on the bench."""

import click

from ctcr.commands import options


@click.command(name="record")
@options.robot
@click.argument("plan", type=options.read)
@options.output_folder("The recording; one that is there is resumed.", required=True)
@options.bench("The devices and their limits.")
@options.setting("--dwell", options.Finite(0), 0.5, "Rest before the first reading [s].")
@options.setting("--readings", click.IntRange(1), 1, "Readings per row of the plan.")
@options.setting("--speed", options.Finite(0.01, 1), 1.0, "Fraction of the highest speed.")
@options.setting(
    "--approach",
    click.Choice(["planned", "forward", "backward"]),
    "planned",
    "Approach each row as planned, or always with all joints moving up (forward) or down (backward).",
)
@options.setting("--approach-mm", options.Finite(0), 2.0, "Length of the approach [mm].")
@options.setting("--approach-deg", options.Finite(0), 5.0, "Length of the approach [deg].")
@options.setting("--patience", options.Finite(0.1), 30.0, "How long the tracker may lose the sensor [s].")
@options.writes("--page", "FILE.html", "Show progress and error on a page that the browser reloads.")
@options.folder
@options.json
def command(robot, plan, target, bench_path, dwell, readings, speed, patience, page, folder, out, **approach) -> None:
    """Measure the rows of a plan on the bench.

    ROBOT moves through PLAN in its order, and FOLDER/measurements.csv holds the readings. Every row is on the disk
    as soon as it is measured; the same command resumes an interrupted recording. Where the force changes from one
    row to the next you are asked to hang the weight; before the first row too, where one may hang there. Home the
    joints first: `ctcr move --home`.

    Example: ctcr record robot.yaml plan.csv --bench bench.yaml -o recordings/first
    """
    from contextlib import nullcontext
    from dataclasses import asdict

    import numpy as np

    from ctcr.bench.devices import bench_file
    from ctcr.bench.devices.motors import Motors
    from ctcr.bench.devices.person import person_of
    from ctcr.bench.devices.tracker import Tracker
    from ctcr.bench.record.display import Display
    from ctcr.bench.record.folder import TABLE, Folder
    from ctcr.bench.record.live_page import LivePage
    from ctcr.bench.record.session import Approach, Options, Session, steps_of

    loaded, table = options.load(robot, plan)
    bench = bench_file.load(bench_path)
    way = Approach(approach["approach"], 1e-3 * approach["approach_mm"], float(np.deg2rad(approach["approach_deg"])))
    steps = steps_of(table, way, bench.axis_settings(loaded).limits, plan)
    how, sources = Options(dwell, readings, speed), {"robot": robot, "plan": plan, "bench": bench_path}
    settings, group = asdict(how) | {"approach": asdict(way)}, readings + way.has_way_point
    recording, person = Folder(target, sources, settings, loaded.n_tubes, group), person_of(bench, folder)
    with Tracker(bench, folder, patience) as tracker, Motors(bench, loaded, folder) as motors:
        motors.connect()
        tracker.connect()
        before = recording.rows.groups
        if before:
            out.say(f"resuming after {before} of {len(steps)} rows")
        with Display() as display, LivePage(page, f"Recording {loaded.name}") if page else nullcontext() as live:

            def show(progress):
                display.show(progress)
                if live:
                    live.show(progress)

            def hang(force):
                with display.paused():
                    person.hang(force)

            devices, weighted = (loaded, motors, tracker), person.weight_left
            session = Session(*devices, recording.rows, how, recording.clock, hang, show, weighted)
            with recording.sitting(motors, tracker):
                done = session.run(steps)
    path = recording.path / TABLE
    out.say(f"{done.done - before} rows measured, RMS error against the model {done.rms_mm:.3f} mm: {path}")
    out.write_json({"rows": done.done, "rms_mm": done.rms_mm, "table": str(path)})
