"""How far two models differ that were fitted to two halves of the data, and how far noise alone would drive them apart.

A difference beyond noise means that the model fits one part of the workspace at the cost of another.
"""

from dataclasses import dataclass, replace

import numpy as np
from pydantic import ValidationError

from ctcr import settings
from ctcr.arrays import Array, Integers, evenly
from ctcr.fit.result import Fit, rms
from ctcr.frames import base_to_tracker, points_to_base
from ctcr.model import table_poses
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Halves:
    """The difference of the two models' tips at K visited joints, tracker frame, and the one that noise alone gives."""

    kind: str  # what the halves kept together, runs or places
    row: Integers  # (K,) of the file
    tip: Array  # (K, 3) of the first model, base frame [m]
    difference: Array  # (K, 3) second minus first, tracker frame [m]
    noise: Array  # (K,) RMS length that noise alone gives [m]

    @property
    def rms_mm(self) -> float:
        return 1e3 * rms(self.difference)

    @property
    def noise_mm(self) -> float:
        """RMS difference that noise alone would give."""
        return 1e3 * rms(self.noise[:, None])


def compare_halves(robot: Robot, readings: Measurements, first: Fit, second: Fit, kind: str) -> Halves | None:
    """Halves of two fits of one robot to two halves of a table; None where the models cannot be solved.

    The effect of noise is sampled: the second fit's values are drawn about the first one's.
    """
    count = len(readings)
    rows = evenly(count, settings.HALVES_ROWS)
    models = [fit.apply(robot) for fit in (first, second)]
    tips = [_tips(model, readings, rows) for model in models]
    eigenvalues, vectors = np.linalg.eigh(_difference_covariance(first, second))
    spread = vectors * np.sqrt(np.maximum(eigenvalues, 0))
    rng = np.random.default_rng(settings.HALVES_SEED)
    squares = []
    for _ in range(settings.HALVES_DRAWS):
        values = first.values + spread @ rng.standard_normal(spread.shape[1])
        try:
            moved = replace(first, values=values).apply(robot)
        except ValidationError:  # a draw that no robot can have, such as a negative modulus
            continue
        squares.append(np.sum((_tips(moved, readings, rows) - tips[0]) ** 2, axis=1))
    square = np.mean(squares, axis=0) if squares else np.full(len(rows), np.nan)
    solved = np.isfinite(tips[0]).all(axis=1) & np.isfinite(tips[1]).all(axis=1) & np.isfinite(square)
    if not solved.any():
        return None
    base = points_to_base(models[0].tracker, tips[0])
    return Halves(kind, readings.row[rows[solved]], base[solved], (tips[1] - tips[0])[solved], np.sqrt(square[solved]))


def _tips(robot: Robot, readings: Measurements, rows: Integers) -> Array:
    """Predicted tips (K, 3), tracker frame; NaN where not solved."""
    if robot.effects:  # they may depend on the whole path
        seen = table_poses.readings(robot, readings)
        return base_to_tracker(robot.tracker, seen.position[rows], seen.quaternion[rows])[0]
    beta, alpha = robot.joints_of_table(readings.beta[rows], readings.alpha[rows])
    answer = Model(robot).predict(beta, alpha, readings.force[rows])
    return base_to_tracker(robot.tracker, answer.position, answer.quaternion)[0]


def _difference_covariance(first: Fit, second: Fit) -> Array:
    """Covariance of the difference of two fits that share a prior.

    With posterior covariances A, B and prior information P it is A + B - A P B - B P A: both estimates lean on the same
    prior, which does not drive them apart.
    """
    a, b = (np.nan_to_num(fit.covariance, posinf=0.0, neginf=0.0) for fit in (first, second))
    prior = first.priors.precision
    covariance = a + b - a @ prior @ b - b @ prior @ a
    return (covariance + covariance.T) / 2
