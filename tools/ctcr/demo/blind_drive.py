"""Joints that bring the tip to points by the model alone, without a look at the tracker: as good as the model is."""

import numpy as np

from ctcr.arrays import Array, ArrayLike
from ctcr.errors import InputError, Problem
from ctcr.model import simulation
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

TURN = np.deg2rad(60.0)  # in one direction: far enough to forget how friction stood
CLOSE = 2e-5  # [m] from a point, by the model
MOST_STEPS = 40
DAMPING = 1e-3  # of the least-squares step, relative
RADIAN = 0.05  # [m]: weight of a turn by 1 rad in it


def drive(robot: Robot, start: ArrayLike, points: ArrayLike) -> Measurements:
    """A plan without poses: a turn after which friction no longer depends on what was before, the start (2N,) [m],
    [rad], then a row a point.

    points (P, 3) [m], tracker frame. Raises InputError where the model cannot reach one.
    """
    start = np.asarray(start, float)
    n = robot.n_tubes
    rows = [start - np.repeat([0.0, TURN], n), start]
    for number, point in enumerate(np.asarray(points, float), start=1):
        rows.append(rows[-1])
        for _ in range(MOST_STEPS):
            table = _table(rows)
            error = robot.tracker.rotation.T @ (point - simulation.simulate(robot, table, "none").position[-1])
            if np.linalg.norm(error) < CLOSE:
                break
            rows[-1] = rows[-1] + _step(robot, table, error)
        else:
            raise InputError(Problem(f"the model does not reach point {number}", field="drive"))
    return _table(rows)


def _step(robot: Robot, table: Measurements, error: Array) -> Array:
    """Joints (2N,) by which the tip moves by `error` [m], base frame, with the least motion."""
    beta, alpha = robot.joints_of_table(table.beta[-1:], table.alpha[-1:])
    plain = robot.standard  # an effect with history has no Jacobian of a single pose
    jacobian = Model(plain).predict(beta, alpha, table.force[-1:], derivatives=True).jacobian[0, :3]
    scale = np.repeat([1.0, 1 / RADIAN], robot.n_tubes)
    scaled = jacobian * scale
    square = scaled @ scaled.T
    return scale * (scaled.T @ np.linalg.solve(square + DAMPING * np.trace(square) * np.eye(3), error))


def _table(joints: list[Array]) -> Measurements:
    return Measurements.of_joints(*np.hsplit(np.array(joints), 2))
