"""The predicted readings of a table, in its order, by a robot whose effects may depend on the path."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr import _core
from ctcr.arrays import Array
from ctcr.effects import catalogue
from ctcr.frames import tracker_to_base
from ctcr.model import user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Readings:
    """What the tracker would read in M rows, seen from the robot's base frame."""

    position: Array  # (M, 3) [m]; NaN: not solved
    quaternion: Array  # (M, 4), w first
    status: NDArray[np.uint8]  # (M,), as of a prediction


def readings(robot: Robot, measurements: Measurements, steps: int = 4) -> Readings:
    """Predicted readings of all rows of a table in their order, with all effects of the robot."""
    recorded = user_recording.recording_of(robot, measurements, (), steps=steps)
    recorded.residual(np.empty(0))
    position, quaternion = tracker_to_base(robot.tracker, *recorded.predicted())
    solved = np.isfinite(position).all(axis=1)
    status = np.where(solved, _core.Status.ok.value, _core.Status.not_converged.value).astype(np.uint8)
    return Readings(position, quaternion, status)


def of_the_poses(robot: Robot) -> dict[str, Any]:
    """The robot's effects that change the poses of its tubes: all but those of the tracker alone."""
    alone = {effect.id for effect in catalogue.catalogue(robot.n_tubes).values() if effect.acts_on == {"reading"}}
    return {identity: given for identity, given in robot.effects.items() if identity not in alone}


def of_the_path(robot: Robot) -> list[str]:
    """The robot's effects that depend on the path to a configuration, and all effects of users' files."""
    known = catalogue.catalogue(robot.n_tubes)
    without = {effect.id for effect in known.values() if not effect.needs & {"order", "time"}}
    return [identity for identity in of_the_poses(robot) if identity not in without]


def without_the_path(robot: Robot) -> Robot:
    """The robot without those effects: what a `Model` can solve, configuration by configuration."""
    path = of_the_path(robot) if robot.effects else []
    return robot.with_effects({identity: given for identity, given in robot.effects.items() if identity not in path})
