"""`ctcr predict`: a table of joints with the predicted poses added."""

from collections import Counter
from itertools import islice
from pathlib import Path

import click

CHUNK_ROWS = 1 << 16
LISTED_ROWS = 20
POSE_COLUMNS = ("pred_x_m", "pred_y_m", "pred_z_m", "pred_qw", "pred_qx", "pred_qy", "pred_qz")


@click.command(name="predict")
@click.argument("robot")
@click.argument("table")
@click.option("-o", "--output", "target", required=True, metavar="FILE", help="The table to write.")
@click.option(
    "--frame",
    type=click.Choice(["tracker", "base"]),
    default="tracker",
    show_default=True,
    help="Frame of the predicted poses; measured ones are in the tracker's.",
)
@click.option(
    "--steps",
    type=click.IntRange(1, 1000),
    default=4,
    show_default=True,
    help="Integration steps per segment; more is finer and slower.",
)
@click.option("--json", "json_target", metavar="FILE", help="Write the summary as JSON; - for standard output.")
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects that ROBOT has.")
def command(robot: str, table: str, target: str, frame: str, steps: int, json_target: str | None, own) -> None:
    """Add the pose that the model of ROBOT predicts to each row of TABLE.

    The new columns are pred_x_m .. pred_z_m and the quaternion pred_qw .. pred_qz of the tube that carries the
    sensor, with the effects that ROBOT has. Rows that cannot be solved stay empty and are listed.
    """
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements

    if own:
        from ctcr.effects import user_effects

        user_effects.load_all(own)
    loaded = robot_file.load(robot)
    readings = measurements.load(table, loaded.n_tubes)
    with output.atomic_writer(target, binary=True) as file:
        unsolved = _write(file, Path(table), readings, _predictor(loaded, readings, steps), loaded.tracker, frame)
    summary = {
        "rows": len(readings),
        "solved": len(readings) - len(unsolved),
        "frame": frame,
        "steps": steps,
        "unsolved": [{"row": row, "status": status} for row, status in unsolved],
    }
    if json_target:
        output.write_json(summary, json_target)
    _report(output.console(json_target), summary, target, robot, len(robot_file.warnings(loaded)))


def _predictor(robot, readings, steps: int):
    """Predicts a slice of the readings; effects need all of them at once, in their order."""
    from types import SimpleNamespace

    if robot.effects:
        from ctcr.model import effect_model

        found = effect_model.readings(robot, readings, steps)
        return lambda rows: SimpleNamespace(**{name: values[rows] for name, values in vars(found).items()})
    from ctcr.model.model import Model

    model = Model(robot, steps=steps)
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    return lambda rows: model.predict(beta[rows], alpha[rows], readings.force[rows])


def _write(file, table: Path, readings, predict, tracker, frame: str) -> list[tuple[int, str]]:
    """Copies the table with the predictions beside it; returns (row, why) of those not solved."""
    from ctcr.show.output import Progress

    unsolved = []
    with open(table, "rb") as source, Progress("predicting", len(readings)) as progress:
        file.write(_line(source.readline(), "," + ",".join(POSE_COLUMNS)))
        for start in range(0, len(readings), CHUNK_ROWS):
            rows = slice(start, min(start + CHUNK_ROWS, len(readings)))
            poses, status = _fields(predict(rows), tracker, frame)
            lines = islice(source, rows.stop - start)
            file.write(b"".join(map(_line, lines, poses)))
            unsolved += [(int(readings.row[start + i]), text) for i, text in enumerate(status) if text]
            progress.advance(rows.stop - start)
    return unsolved


def _fields(answer, tracker, frame: str) -> tuple[list[str], list[str]]:
    """The new fields of each row as text, and why a row has none ("" where it has)."""
    import numpy as np

    from ctcr import frames
    from ctcr.model.model import status_text

    position, quaternion = answer.position, answer.quaternion
    if frame == "tracker":
        position, quaternion = frames.base_to_tracker(tracker, position, quaternion)
    form, empty = ",%.10g" * len(POSE_COLUMNS), "," * len(POSE_COLUMNS)
    poses = np.hstack([position, quaternion]).tolist()
    status = ["" if code == 0 else status_text(code) for code in np.asarray(answer.status).tolist()]
    return [empty if why else form % tuple(pose) for pose, why in zip(poses, status, strict=True)], status


def _line(line: bytes, added: str) -> bytes:
    return line.rstrip(b"\r\n") + added.encode("ascii") + b"\n"


def _report(console, summary: dict, target: str, robot: str, n_doubts: int) -> None:
    unsolved = summary["unsolved"]
    console.print(
        f"{summary['solved']} of {summary['rows']} rows predicted in the {summary['frame']} frame: {target}",
        markup=False,
    )
    if n_doubts:
        console.print(f"looks wrong in the robot file: {n_doubts} (ctcr info {robot})", markup=False)
    for status, count in Counter(item["status"] for item in unsolved).most_common():
        console.print(f"not solved: {count} rows, {status}", markup=False)
    for item in unsolved[:LISTED_ROWS]:
        console.print(f"  row {item['row']}: {item['status']}", markup=False)
    if len(unsolved) > LISTED_ROWS:
        console.print(f"  and {len(unsolved) - LISTED_ROWS} more rows (all of them: --json FILE)")
