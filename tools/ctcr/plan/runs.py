"""Runs that a robot can do: stops between two random configurations and back again, under one load.

Joints stay within the measured range, tube tips in their measured order, loads among those that are offered.
"""

from dataclasses import dataclass

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Run:
    beta: Array  # (2 stops, N) [m]
    alpha: Array  # (2 stops, N) [rad]
    mass: float  # hung at the tip [kg]


def random_runs(
    robot: Robot, measurements: Measurements, count: int, masses: Array, random: np.random.Generator
) -> list[Run]:
    """`count` runs; `masses` [kg] are those that can be hung at the tip."""
    joints = np.hstack([measurements.beta, measurements.alpha])
    low, high = joints.min(axis=0), joints.max(axis=0)
    slack = _orders(measurements.beta, robot).min(axis=0)
    runs = []
    for _ in range(settings.PLAN_TRIES * count):
        ends = random.uniform(low, high, size=(2, len(low)))
        way = np.linspace(ends[0], ends[1], settings.PLAN_STOPS)
        beta, alpha = np.hsplit(np.vstack([way, way[::-1]]), 2)
        if (_orders(beta, robot) >= slack).all():
            runs.append(Run(beta, alpha, float(random.choice(masses))))
        if len(runs) == count:
            break
    return runs


def _orders(beta: Array, robot: Robot) -> Array:
    """How far each grasped point is behind the next tube's, and each tip beyond it (rows, 2 N - 2) [m]."""
    tips = beta + np.array([tube.length for tube in robot.tubes])
    return np.hstack([np.diff(beta, axis=1), -np.diff(tips, axis=1)])


def table(robot: Robot, runs: list[Run], first_run: int = 0) -> Measurements:
    """The runs one after the other as a table without poses."""
    rows = sum(len(run.beta) for run in runs)
    down = np.array(robot.gravity if robot.gravity is not None else (0.0, 0.0, 0.0))
    mass = np.concatenate([np.full(len(run.beta), run.mass) for run in runs])
    return Measurements(
        t=settings.PLAN_STOP_S * np.arange(rows),
        run=np.repeat(np.arange(first_run, first_run + len(runs)), [len(run.beta) for run in runs]),
        beta=np.vstack([run.beta for run in runs]),
        alpha=np.vstack([run.alpha for run in runs]),
        force=mass[:, None] * down,
        position=None,
        quaternion=None,
        row=np.arange(rows) + 2,
    )
