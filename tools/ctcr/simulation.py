"""Measurements made by the library's own model, to plan with: what a robot with some effects would read, and its noise.

They are no proof of the model: it made them itself.
"""

from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ctcr import identify, user_effects
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.measurements import Measurements, group_columns
from ctcr.output import atomic_writer
from ctcr.robot import Robot

Array = NDArray[np.float64]

NOISES = ("none", "jitter", "realistic")
OUTLIERS = 0.005  # share of readings that are off by 1 to 3 mm
OUTLIER_M = (1e-3, 3e-3)
WAVES = 400  # of which the smooth field is the sum


def simulate(
    robot: Robot, plan: Measurements, noise: str = "jitter", seed: int = 1, steps: int = 4
) -> Measurements:
    """What the tracker reads in the rows of a plan, as the robot with its effects moves along them.

    Noise: none; jitter, that of the robot file; realistic, with the smooth error of the tracker's field and outliers
    too. Rows that the model cannot solve have no pose. Raises InputError where the robot file does not state the noise.
    """
    recorded = user_effects.recording_of(robot, plan, (), steps=steps)
    recorded.residual(np.empty(0))
    position, quaternion = recorded.predicted()
    if noise != "none":
        position, quaternion = _noisy(
            robot, position, quaternion, noise == "realistic", np.random.default_rng(seed)
        )
    return replace(plan, position=position, quaternion=quaternion)


def write(readings: Measurements, target: str | Path, n_tubes: int) -> None:
    """The table in the format of measurements; columns without any value are left out."""
    columns = group_columns(n_tubes)
    groups = {
        "t": readings.t[:, None], "run": readings.run[:, None], "beta": readings.beta, "alpha": readings.alpha,
        "force": readings.force, "position": readings.position, "quaternion": readings.quaternion,
    }  # fmt: skip
    kept = [name for name in groups if groups[name] is not None and np.isfinite(groups[name]).any()]
    header = ",".join(column for name in kept for column in columns[name])
    rows = np.hstack([groups[name] for name in kept]).tolist()
    with atomic_writer(target) as file:
        file.write(header + "\n")
        file.writelines(
            ",".join("" if value != value else f"{value:.12g}" for value in row) + "\n" for row in rows
        )


def _noisy(robot: Robot, position: Array, quaternion: Array, realistic: bool, rng: np.random.Generator):
    noise, shape = identify.noise_of(robot), position.shape
    shift = noise.position_jitter * rng.standard_normal(shape)
    turn = noise.rotation_jitter * rng.standard_normal(shape)
    if realistic:
        places = np.nan_to_num(position)
        shift += noise.position_field * _field(places, noise.correlation_length, rng)
        turn += noise.rotation_field * _field(places, noise.correlation_length, rng)
        off = rng.random(len(position)) < OUTLIERS
        direction = rng.standard_normal(shape)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        shift += np.where(off, rng.uniform(*OUTLIER_M, len(position)), 0.0)[:, None] * direction
    turned = product(quaternion_from_rotation_vector(turn), quaternion)
    turned *= np.where(turned[:, :1] < 0, -1.0, 1.0)
    return position + shift, np.where(np.isfinite(quaternion), turned, nan)


def _field(places: Array, length: float, rng: np.random.Generator) -> Array:
    """Three smooth random functions of the place (M, 3), variance 1, correlation exp(-d^2 / (2 length^2))."""
    columns = []
    for _ in range(3):
        wave = rng.standard_normal((3, WAVES)) / length
        phase = rng.uniform(0, 2 * np.pi, WAVES)
        columns.append(np.sqrt(2 / WAVES) * np.cos(places @ wave + phase).sum(axis=1))
    return np.stack(columns, axis=1)
