"""The roll of the sensor about the axis of the tip: estimated, then fitted, where the robot file does not know it."""

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
    """The robot with a starting value of an unknown roll, the usable readings, and notices on both.

    Where the rolls of the readings do not agree, as with a sensor that does not measure them, orientations are dropped.
    """
    tracker, oriented = robot.tracker, measurements.oriented.any()
    if tracker.sensor_roll == "known" or (tracker.sensor_roll_deg is not None and oriented):
        return robot, measurements, []
    if not oriented:
        return _with(robot, None), measurements, []
    rolls = np.exp(1j * _rolls(robot, measurements))
    mean = rolls[np.isfinite(rolls)].mean() if np.isfinite(rolls).any() else 0.0
    if abs(mean) < settings.ONE_ROLL:
        notice = "the sensor's roll is unknown and differs from reading to reading: orientations are not used"
        return robot, replace(measurements, quaternion=None), [notice]
    roll = float(np.degrees(np.angle(mean)))
    notice = f"the sensor's roll is unknown: its fit starts at {roll:.1f} deg, the mean over the readings"
    return _with(robot, roll), measurements, [notice]


def positions_alone(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The readings without orientations where the sensor's roll is not known, and a notice.

    Such a sensor may be tilted too, which would be taken for an effect of the robot.
    """
    if robot.tracker.sensor_roll == "known" or not measurements.oriented.any():
        return measurements, []
    notice = "the sensor's roll is unknown: orientations are not used (write sensor_roll: known once it is)"
    return replace(measurements, quaternion=None), [notice]


def with_roll(free: str | Iterable[str], robot: Robot) -> list[str]:
    """The parameters that names stand for (`parameters.expand`), with the roll where it must be fitted too."""
    names = parameters.expand(free, robot)
    tracker = robot.tracker
    if tracker.sensor_roll == "unknown" and tracker.sensor_roll_deg is not None and NAME not in names:
        names = parameters.expand([*names, NAME], robot)
    return names


def _with(robot: Robot, roll_deg: float | None) -> Robot:
    tracker = robot.tracker.model_copy(update={"sensor_roll_deg": roll_deg})
    return robot.model_copy(update={"tracker": tracker})


def _rolls(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Roll of each reading against the predicted tip (M,) [rad]; NaN where not measured or not solved."""
    beta, alpha = robot.joints_of_table(measurements.beta, measurements.alpha)
    tips = Model(robot.standard).predict(beta, alpha, measurements.force)
    _, orientation = base_to_tracker(_with(robot, None).tracker, tips.position, tips.quaternion)
    turn = product(conjugate(orientation), measurements.quaternion)
    return np.where(tips.solved, 2 * np.arctan2(turn[:, 3], turn[:, 0]), np.nan)
