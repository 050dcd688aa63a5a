"""Snaps: readings of a robot that rests in another stable equilibrium than the one that the model predicts."""

import numpy as np

from ctcr.arrays import Array
from ctcr.frames import base_to_tracker
from ctcr.model.effect_model import without_the_path
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def other_tips(robot: Robot, measurements: Measurements, index: int) -> Array:
    """Where else the sensor may rest (E, 3) [m], tracker frame, in the reading `index` of the table.

    Effects that depend on how the joints were reached are left out, as every equilibrium has a history of its own.
    """
    beta, alpha = (q[0] for q in robot.joints_of_table(*(m[[index]] for m in (measurements.beta, measurements.alpha))))
    tube = robot.tracker.sensor_on_tube - 1
    end = robot.tubes[tube].length + beta[tube]
    others = Model(without_the_path(robot)).all_shapes(beta, alpha, measurements.force[index])[1:]
    position = np.reshape([shape.position_at(end) for shape in others], (-1, 3))
    along = [shape.tube_quaternion(tube) for shape in others]
    turned = np.reshape([there[np.isfinite(there).all(axis=1)][-1] for there in along], (-1, 4))
    return base_to_tracker(robot.tracker, position, turned)[0]
