"""How far two models differ that were fitted to two halves of the data, and how far noise alone would drive them apart.

A small difference beyond noise means that the model fits one part of the workspace at the cost of another.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ctcr import settings
from ctcr.frames import base_to_tracker
from ctcr.model import effect_model
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Halves:
    """The difference of the two models' tips at K visited joints, tracker frame, and what noise makes of it."""

    kind: str  # what the halves kept together, runs or places
    row: NDArray[np.int64]  # (K,) of the file
    tip: Array  # (K, 3) of the first model, base frame [m]
    difference: Array  # (K, 3) second minus first, tracker frame [m]
    noise: Array  # (K,) RMS length that noise alone gives [m]

    @property
    def rms_mm(self) -> float:
        return 1e3 * float(np.sqrt(np.mean(np.sum(self.difference**2, axis=1))))

    @property
    def noise_mm(self) -> float:
        """What noise alone would give."""
        return 1e3 * float(np.sqrt(np.mean(self.noise**2)))


def compare_halves(robot: Robot, readings: Measurements, first, second, kind: str) -> Halves | None:
    """Halves of two fits of one robot to two halves of a table; None where the models cannot be solved."""
    rows = np.unique(np.linspace(0, len(readings) - 1, min(len(readings), settings.HALVES_ROWS)).astype(np.int64))
    models = [fit.apply(robot) for fit in (first, second)]
    tips = [_tips(model, readings, rows) for model in models]
    spread = _root(_difference_covariance(first, second))
    rng = np.random.default_rng(settings.HALVES_SEED)
    squares = []
    for _ in range(settings.HALVES_DRAWS):
        values = first.values + spread @ rng.standard_normal(spread.shape[1])
        try:
            moved = replace(first, values=values).apply(robot)
        except ValidationError:  # a draw that no robot can have, such as a negative modulus
            continue
        squares.append(np.sum((_tips(moved, readings, rows) - tips[0]) ** 2, axis=1))
    squares = np.mean(squares, axis=0) if squares else np.full(len(rows), np.nan)
    solved = np.isfinite(tips[0]).all(axis=1) & np.isfinite(tips[1]).all(axis=1) & np.isfinite(squares)
    if not solved.any():
        return None
    base = (tips[0] - models[0].tracker.position) @ models[0].tracker.rotation
    return Halves(kind, readings.row[rows[solved]], base[solved], (tips[1] - tips[0])[solved], np.sqrt(squares[solved]))


def _tips(robot: Robot, readings: Measurements, rows: NDArray[np.int64]) -> Array:
    """Predicted tips (K, 3), tracker frame; NaN where not solved."""
    if robot.effects:  # they may depend on the whole path
        seen = effect_model.readings(robot, readings)
        return base_to_tracker(robot.tracker, seen.position[rows], seen.quaternion[rows])[0]
    beta, alpha = robot.joints_of_table(readings.beta[rows], readings.alpha[rows])
    answer = Model(robot).predict(beta, alpha, readings.force[rows])
    return base_to_tracker(robot.tracker, answer.position, answer.quaternion)[0]


def _difference_covariance(first, second) -> Array:
    """Covariance of the difference of two fits that share a prior.

    With posterior covariances A, B and prior information P the difference of the estimates has covariance
    A + B - A P B - B P A: what the prior holds in both does not drive them apart.
    """
    a, b = (np.nan_to_num(fit.covariance, posinf=0.0, neginf=0.0) for fit in (first, second))
    prior = np.diag(1 / first.prior_sd**2)
    return a + b - a @ prior @ b - b @ prior @ a


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0))
