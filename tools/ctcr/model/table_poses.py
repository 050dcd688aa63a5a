"""The poses that a model predicts for the rows of a table, in their order, on which effects with history depend."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from ctcr import _core
from ctcr.arguments import checked
from ctcr.frames import base_to_tracker, tracker_to_base
from ctcr.model import user_recording
from ctcr.model.model import Model, Prediction
from ctcr.robot.description import Robot
from ctcr.show.output import Progress
from ctcr.table.measurements import Measurements, check_of

CHUNK_ROWS = 1 << 16  # solved at once: a few MB of poses
PER_ROW = ("position", "quaternion", "status", "stability")


@checked
def predict(
    robot: Robot, table: Measurements, *, steps: int = 4, frame: Literal["base", "tracker"] = "base"
) -> Prediction:
    """The poses of all rows, with the effects of the robot.

    steps    factor on the integration steps: more are slower and more accurate
    frame    "base", or "tracker": as measured
    Raises InputError where the table is not one of this robot, or only another convention makes it possible.
    """
    parts = [answer for _, answer in predictions(robot, table, steps)]
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in PER_ROW}
    if frame == "tracker":
        columns["position"], columns["quaternion"] = base_to_tracker(
            robot.tracker, columns["position"], columns["quaternion"]
        )
    return Prediction(**columns, jacobian=None, compliance=None)


def readings(robot: Robot, table: Measurements, steps: int = 4) -> Prediction:
    """Predicted readings of all rows in their order, with all effects of the robot, seen from its base frame.

    The stability is not known: NaN.
    """
    recorded = user_recording.recording_of(robot, table, (), steps=steps)
    recorded.residual(np.empty(0))
    position, quaternion = tracker_to_base(robot.tracker, *recorded.predicted())
    solved = np.isfinite(position).all(axis=1)
    status = np.where(solved, _core.Status.ok.value, _core.Status.not_converged.value).astype(np.uint8)
    return Prediction(position, quaternion, status, np.full(len(table), np.nan), None, None)


def standard_tips(robot: Robot, table: Measurements) -> Prediction:
    """The pose of the tip in each row, base frame, by the standard model: without the effects of the robot."""
    beta, alpha = robot.joints_of_table(table.beta, table.alpha)
    return Model(robot.standard).predict(beta, alpha, table.force)


def predictions(robot: Robot, table: Measurements, steps: int) -> Iterator[tuple[slice, Prediction]]:
    """Yields (rows, their predicted poses) in chunks, so that a long table shows its progress and takes no memory; with
    effects, which may have a history, all rows at once."""
    check_of(robot, table)
    if table.refusal:
        raise table.refusal
    if robot.effects:
        yield slice(0, len(table)), readings(robot, table, steps)
        return
    model, (beta, alpha) = Model(robot, steps=steps), robot.joints_of_table(table.beta, table.alpha)
    with Progress("predicting", len(table)) as progress:
        for start in range(0, len(table), CHUNK_ROWS):
            rows = slice(start, min(start + CHUNK_ROWS, len(table)))
            yield rows, model.predict(beta[rows], alpha[rows], table.force[rows])
            progress.advance(rows.stop - start)
