"""Measurements made by the library's own model, to plan with: what a robot with some effects would read, and its noise.

They are no proof of the model: it made them itself.
"""

from collections.abc import Callable
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np

from ctcr.arrays import Array
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.model import parameters, user_recording
from ctcr.model.noise import noise_of
from ctcr.robot.description import Robot
from ctcr.show.output import atomic_writer
from ctcr.table.measurements import Measurements, group_columns

Field = Callable[[Array], Array]

NOISES = ("none", "jitter", "realistic")
OUTLIERS = 0.005  # fraction of readings that are off by 1 to 3 mm
OUTLIER_M = (1e-3, 3e-3)
WAVES = 400  # of which the smooth field is the sum


def simulate(robot: Robot, plan: Measurements, noise: str = "jitter", seed: int = 1, steps: int = 4) -> Measurements:
    """Simulated readings of the tracker in the rows of a plan, along which the robot moves with its effects.

    Noise: none; jitter, that of the robot file; realistic, with the smooth error of the tracker's field and outliers
    too. Rows that the model cannot solve have no pose. Raises InputError where the robot file does not state the noise.
    """
    recorded = user_recording.recording_of(robot, plan, (), steps=steps)
    recorded.residual(np.empty(0))
    position, quaternion = recorded.predicted()
    if noise != "none":
        position, quaternion = ReadingNoise(robot, noise, seed).added(position, quaternion)
    return replace(plan, position=position, quaternion=quaternion)


def write(readings: Measurements, target: str | Path) -> None:
    """The table in the format of measurements; columns without any value are left out."""
    columns = group_columns(readings.n_tubes)
    present = {name: getattr(readings, name) for name in columns if getattr(readings, name) is not None}
    kept = {name: values.reshape(len(readings), -1) for name, values in present.items() if np.isfinite(values).any()}
    header = ",".join(column for name in kept for column in columns[name])
    rows = np.hstack(list(kept.values()))
    form = ",".join(["%.12g"] * (header.count(",") + 1)) + "\n"
    with atomic_writer(target) as file:
        file.write(header + "\n")
        for block in np.array_split(rows, len(rows) // 1000 + 1):
            file.write((form * len(block) % tuple(block.ravel().tolist())).replace("nan", ""))


def as_built(robot: Robot, rng: np.random.Generator) -> Robot:
    """A robot that differs from its file in every calibrated parameter: normal, with half the file's sd."""
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    drawn = np.clip(mean + 0.5 * sd * rng.standard_normal(len(mean)), low, high)
    return parameters.applied(robot, names, drawn)


class ReadingNoise:
    """Simulated errors of a tracker: jitter, and for "realistic" the smooth error of its field and outliers.

    One field stays as long as the object. Raises InputError where the robot file does not state the noise.
    """

    def __init__(self, robot: Robot, kind: str, seed: int):
        self._noise, self._realistic = noise_of(robot), kind == "realistic"
        self._rng = np.random.default_rng(seed)
        self._fields: tuple[Field, Field] | None = None

    def added(self, position: Array, quaternion: Array) -> tuple[Array, Array]:
        """Poses (M, 3) [m], (M, 4) as read; NaN stays NaN."""
        noise, rng, shape = self._noise, self._rng, position.shape
        shift = noise.position_jitter * rng.standard_normal(shape)
        turn = noise.rotation_jitter * rng.standard_normal(shape)
        if self._realistic:
            if not self._fields:
                self._fields = tuple(_field(noise.correlation_length, rng) for _ in range(2))
            positions = np.nan_to_num(position)
            shift += noise.position_field * self._fields[0](positions)
            turn += noise.rotation_field * self._fields[1](positions)
            off = rng.random(len(position)) < OUTLIERS
            direction = rng.standard_normal(shape)
            direction /= np.linalg.norm(direction, axis=1, keepdims=True)
            shift += np.where(off, rng.uniform(*OUTLIER_M, len(position)), 0.0)[:, None] * direction
        turned = product(quaternion_from_rotation_vector(turn), quaternion)
        turned *= np.where(turned[:, :1] < 0, -1.0, 1.0)
        return position + shift, np.where(np.isfinite(quaternion), turned, nan)


def _field(length: float, rng: np.random.Generator) -> Field:
    """Three smooth random functions of positions (M, 3), variance 1, correlation exp(-d^2 / (2 length^2))."""
    waves = [(rng.standard_normal((3, WAVES)) / length, rng.uniform(0, 2 * np.pi, WAVES)) for _ in range(3)]

    def value(positions: Array) -> Array:
        columns = [np.sqrt(2 / WAVES) * np.cos(positions @ wave + phase).sum(axis=1) for wave, phase in waves]
        return np.stack(columns, axis=1)

    return value
