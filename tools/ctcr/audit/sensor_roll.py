"""The roll of the sensor about the axis of the tip, where the robot file does not know it: first found, then fitted."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.frames import base_to_tracker, conjugate, product
from ctcr.model import parameters
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

NAME = "tracker.sensor_roll"


def usable(robot: Robot, measurements: Measurements) -> tuple[Robot, Measurements, list[str]]:
    """The robot with a first value of an unknown roll, the readings that say something of it, and what to say of both.

    Where each reading has a roll of its own, as of a sensor that does not measure it, orientations are left out.
    """
    tracker = robot.tracker
    if tracker.sensor_roll == "known" or (tracker.sensor_roll_deg is not None and _turned(measurements).any()):
        return robot, measurements, []
    if not _turned(measurements).any():
        return _with(robot, None), measurements, []
    rolls = np.exp(1j * _rolls(robot, measurements))
    mean = rolls[np.isfinite(rolls)].mean() if np.isfinite(rolls).any() else 0.0
    if abs(mean) < settings.ONE_ROLL:
        said = "the sensor's roll is unknown and differs from reading to reading: orientations are not used"
        return robot, replace(measurements, quaternion=None), [said]
    roll = float(np.degrees(np.angle(mean)))
    said = f"the sensor's roll is unknown: it is fitted from {roll:.1f} deg, where the readings put it"
    return _with(robot, roll), measurements, [said]


def positions_alone(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The readings without the orientations of a sensor whose roll is not known, and what to say about it.

    Such a sensor may be tilted too: where effects are judged, that would count as what the robot does.
    """
    if robot.tracker.sensor_roll == "known" or not _turned(measurements).any():
        return measurements, []
    said = "the sensor's roll is unknown: orientations are not used (write sensor_roll: known once it is)"
    return replace(measurements, quaternion=None), [said]


def with_roll(free: str | Iterable[str], robot: Robot) -> list[str]:
    """The parameters that names stand for (`free_parameters.expand`), and the roll where it must be fitted too."""
    names = parameters.expand(free, robot)
    tracker = robot.tracker
    if tracker.sensor_roll == "unknown" and tracker.sensor_roll_deg is not None and NAME not in names:
        names = parameters.expand([*names, NAME], robot)
    return names


def _turned(measurements: Measurements) -> np.ndarray:
    """Rows with an orientation (M,)."""
    if measurements.quaternion is None:
        return np.zeros(len(measurements), bool)
    return np.isfinite(measurements.quaternion).all(axis=1)


def _with(robot: Robot, roll_deg: float | None) -> Robot:
    tracker = robot.tracker.model_copy(update={"sensor_roll_deg": roll_deg})
    return robot.model_copy(update={"tracker": tracker})


def _rolls(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Of each reading against the tip as predicted (M,) [rad]; NaN where not measured or not solved."""
    beta, alpha = robot.joints_of_table(measurements.beta, measurements.alpha)
    tips = Model(robot.standard).predict(beta, alpha, measurements.force)
    _, orientation = base_to_tracker(_with(robot, None).tracker, tips.position, tips.quaternion)
    turn = product(conjugate(orientation), measurements.quaternion)
    rolls = 2 * np.arctan2(turn[:, 3], turn[:, 0])
    return np.where(tips.solved, rolls, np.nan)
