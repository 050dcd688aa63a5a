"""`ctcr predict`: a table of joints with the predicted poses added."""

from collections import Counter
from itertools import islice
from pathlib import Path

import click

from ctcr.commands import options

LISTED_ROWS = 20


@click.command(name="predict")
@options.robot
@click.argument("table", type=options.read)
@options.output("TABLE.csv|.txt", "The table to write.", required=True)
@options.setting(
    "--frame", click.Choice(["tracker", "base"]), "tracker", "Frame of the predicted poses; tracker: as measured ones."
)
@options.steps
@options.json
def command(robot: str, table: str, target: str, frame: str, steps: int, out) -> None:
    """Add predicted poses to a table.

    Each row of TABLE, with joints and forces, gets the pose that the model of ROBOT predicts. The new columns are
    pred_x_m, pred_y_m, pred_z_m and the unit quaternion pred_qw, pred_qx, pred_qy, pred_qz: of the sensor in the
    tracker frame, of the tip that carries it in the base frame, with the effects that ROBOT has. Rows without a
    solution stay empty and are listed.

    Example: ctcr predict robot.yaml measurements.csv -o predicted.csv
    """
    from ctcr.model.table_poses import predictions
    from ctcr.show.output import atomic_writer

    loaded, readings = options.load(robot, table)
    with atomic_writer(target, binary=True) as file:
        unsolved = _write(file, Path(table), readings, predictions(loaded, readings, steps), loaded.tracker, frame)
    solved = len(readings) - len(unsolved)
    rows = [{"row": row, "status": status} for row, status in unsolved]
    out.write_json({"rows": len(readings), "solved": solved, "frame": frame, "steps": steps, "unsolved": rows})
    out.say(f"{solved} of {len(readings)} rows predicted in the {frame} frame: {target}")
    out.say(*options.doubtful(loaded, robot))
    counts = Counter(status for _, status in unsolved).most_common()
    out.say(*(f"not solved: {count} rows, {status}" for status, count in counts))
    out.say(*(f"  row {row}: {status}" for row, status in unsolved[:LISTED_ROWS]))
    if len(unsolved) > LISTED_ROWS:
        out.say(f"  and {len(unsolved) - LISTED_ROWS} more rows (all of them: --json FILE)")


def _write(file, table: Path, readings, answers, tracker, frame: str) -> list[tuple[int, str]]:
    """Copies the table with the predictions beside it; returns (row, why) of those not solved."""
    from ctcr.model.model import POSE_COLUMNS

    unsolved = []
    with open(table, "rb") as source:
        file.write(_line(source.readline(), "," + ",".join(POSE_COLUMNS)))
        for rows, answer in answers:
            poses, status = _fields(answer, tracker, frame)
            file.write(b"".join(map(_line, islice(source, rows.stop - rows.start), poses)))
            unsolved += [(int(row), text) for row, text in zip(readings.row[rows], status, strict=True) if text]
    return unsolved


def _fields(answer, tracker, frame: str) -> tuple[list[str], list[str]]:
    """The new fields of each row as text, and why a row has none ("" where it has)."""
    import numpy as np

    from ctcr import frames
    from ctcr.model.model import POSE_COLUMNS, SOLVED

    position, quaternion = answer.position, answer.quaternion
    if frame == "tracker":
        position, quaternion = frames.base_to_tracker(tracker, position, quaternion)
    form, empty = ",%.10g" * len(POSE_COLUMNS), "," * len(POSE_COLUMNS)
    poses = np.hstack([position, quaternion]).tolist()
    status = ["" if why == SOLVED else why for why in answer.why]
    return [empty if why else form % tuple(pose) for pose, why in zip(poses, status, strict=True)], status


def _line(line: bytes, added: str) -> bytes:
    return line.rstrip(b"\r\n") + added.encode("ascii") + b"\n"
