"""Predictions of a robot that has effects beyond the standard model."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr import _core
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.frames import tracker_to_base
from ctcr.model import recording, user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Readings:
    """What the tracker would read in M rows, seen from the robot's base frame."""

    position: Array  # (M, 3) [m]; NaN: not solved
    quaternion: Array  # (M, 4), w first
    status: NDArray[np.uint8]  # (M,), as of a prediction


def readings(robot: Robot, measurements: Measurements, steps: int = 4, threads: int = 0) -> Readings:
    """Predicted readings of all rows of a table in their order, with all effects of the robot."""
    recorded = user_recording.recording_of(robot, measurements, (), steps=steps, threads=threads)
    recorded.residual(np.empty(0))
    position, quaternion = tracker_to_base(robot.tracker, *recorded.predicted())
    return Readings(position, quaternion, _status(position))


def usable(robot: Robot, integrator: str) -> dict[str, Any]:
    """The effects of a robot that act on single configurations. Raises InputError where others are among them."""
    if integrator != "default":
        raise InputError(Problem(f"effects are integrated with the default integrator, not with {integrator}"))
    path = of_the_path(robot)
    if path:
        text = (
            f"a model solves configurations one by one, but the effects {', '.join(path)} need the rows in their "
            "order: use `ctcr predict`, or ctcr.effect_model.readings"
        )
        raise InputError(Problem(text))
    return {identity: given for identity, given in robot.effects.items() if identity not in of_the_reading(robot)}


def of_the_reading(robot: Robot) -> set[str]:
    """Effects of the library that change the tracker's reading, not the pose of the tube."""
    return {e.id for e in catalogue.catalogue(robot.n_tubes).values() if e.acts_on == {"reading"}}


def of_the_path(robot: Robot) -> list[str]:
    """Those of a robot's effects that depend on how a configuration was reached, and those of the user's own."""
    known, only_reading = catalogue.catalogue(robot.n_tubes), of_the_reading(robot)
    return [
        identity
        for identity in robot.effects
        if identity not in only_reading and (identity not in known or known[identity].needs & {"order", "time"})
    ]


def predict(
    robot: Robot, effects: Mapping[str, Any], beta: Array, alpha: Array, force: Array | None, out: Any, **options: int
) -> None:
    """Fills position, quaternion and status of a prediction: tips, base frame. Options as of a recording."""
    rows = len(beta)
    at_base = {"position_mm": [0.0] * 3, "rotation_vector_rad": [0.0] * 3, "sensor_roll_deg": None}
    frame = robot.tracker.model_copy(update=at_base)
    actuation = robot.actuation.model_copy(
        update={"recorded_home_translation_mm": None, "recorded_home_rotation_deg": None}
    )
    tips = robot.model_copy(update={"tracker": frame, "actuation": actuation, "effects": dict(effects)})
    table = Measurements(
        t=np.full(rows, np.nan),
        run=np.zeros(rows, np.int64),
        beta=beta,
        alpha=alpha,
        force=np.zeros((rows, 3)) if force is None else force,
        position=None,
        quaternion=None,
        row=np.arange(rows) + 2,
    )
    recorded = recording.recording_of(tips, table, (), **options)
    recorded.residual(np.empty(0))
    out.position[:], out.quaternion[:] = recorded.predicted()
    out.status[:], out.stability[:] = _status(out.position), np.nan


def _status(position: Array) -> NDArray[np.uint8]:
    solved = np.isfinite(position).all(axis=1)
    return np.where(solved, _core.Status.ok.value, _core.Status.not_converged.value).astype(np.uint8)
