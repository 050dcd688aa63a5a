"""Snaps: readings of a robot that rests in another stable equilibrium than the one that the model predicts."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.frames import base_to_tracker
from ctcr.model.effect_model import without_the_path
from ctcr.model.model import Model, Prediction
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def snapped(robot: Robot, measurements: Measurements, prediction: Prediction) -> Integers:
    """Indices of the readings that err far more than usual, and lie where the robot may rest instead; of the
    SNAPS_LOOKED_AT that err most."""
    tips, _ = base_to_tracker(robot.tracker, prediction.position, prediction.quaternion)
    error = np.linalg.norm(measurements.positions - tips, axis=1)
    known = np.flatnonzero(np.isfinite(error))
    far = known[error[known] > settings.SURPRISE * np.median(error[known])] if len(known) else known
    far = far[np.argsort(-error[far])][: settings.SNAPS_LOOKED_AT]

    def is_there(k: int) -> bool:
        others = np.linalg.norm(other_tips(robot, measurements, k) - measurements.position[k], axis=1)
        return bool(np.any(others < settings.SNAP_ERROR * error[k]))

    return np.sort([k for k in far.tolist() if is_there(k)]).astype(int)


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
