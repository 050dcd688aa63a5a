"""Between motor turns and joints: q = rho * theta + Delta, with theta in turns from the home position."""

from math import pi

import numpy as np

from ctcr.arrays import Array, ArrayLike
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot


def transmission(robot: Robot) -> Array:
    """Transmission ratios rho (2N,): translations [m/turn], rotations [rad/turn].

    Raises InputError where the robot file says null.
    """
    ratios = []
    for field, factor in (("translation_mm_per_rev", 1e-3), ("rotation_rev_per_rev", 2 * pi)):
        value = getattr(robot.actuation, field)
        if not value:
            raise InputError(Problem("a bench needs the transmission ratio", field=f"actuation.{field}"))
        ratios += [factor * value] * robot.n_tubes
    return np.array(ratios)


def home_joints(robot: Robot) -> Array:
    """Joints Delta (2N,) [m], [rad] at the home position, as the controller that records knows them."""
    known = robot.actuation
    beta = known.recorded_home_translation_mm or known.home_translation_mm
    alpha = known.recorded_home_rotation_deg or known.home_rotation_deg
    return np.concatenate([1e-3 * np.array(beta), np.deg2rad(alpha)])


def joints_of_turns(robot: Robot, turns: ArrayLike) -> Array:
    """q = rho * theta + Delta (2N,) [m], [rad]."""
    return transmission(robot) * np.asarray(turns, dtype=float) + home_joints(robot)


def turns_of_joints(robot: Robot, joints: ArrayLike) -> Array:
    """The inverse of `joints_of_turns`."""
    return (np.asarray(joints, dtype=float) - home_joints(robot)) / transmission(robot)
