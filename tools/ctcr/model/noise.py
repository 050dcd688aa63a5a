"""The tracker's noise: the jitter of single readings and the smooth error of its field."""

from collections.abc import Sequence

import numpy as np

from ctcr import _core, settings
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Noise = _core.Noise


def noise_of(robot: Robot, field: bool = True, kinds: Sequence[str] = ("position", "rotation")) -> Noise:
    """The tracker's noise: its jitter, and with `field` the smooth error that its 95 % accuracy implies.

    `kinds` is what was measured. Raises InputError where the robot file does not state the jitter of one of these.
    """
    tracker, problems, figures = robot.tracker, [], {}
    for kind, unit, scale in (("position", "mm", 1e-3), ("rotation", "deg", np.pi / 180)):
        jitter, accuracy = (getattr(tracker, f"{name}_{unit}") for name in ("jitter", "accuracy_95"))
        if kind in kinds and not jitter:
            text = f"a fit needs the standard deviation of one reading, above 0, in {unit}"
            problems.append(Problem(text, field=f"tracker.jitter_{unit}"))
            continue
        figures[f"{kind}_jitter"] = scale * (jitter or 1.0)  # of what was not measured any will do
        smooth = field and kind in kinds and accuracy
        figures[f"{kind}_field"] = scale * _core.field_of_accuracy(accuracy, jitter) if smooth else 0.0
    if problems:
        raise InputError(problems)
    return Noise(**figures, correlation_length=settings.CORRELATION_LENGTH)


def noise_of_readings(robot: Robot, measurements: Measurements, field: bool = True) -> Noise:
    """Like noise_of(), for the kinds of readings in the table: without orientations their jitter need not be stated."""
    readings = {"position": measurements.positions, "rotation": measurements.quaternions}
    kinds = [kind for kind, of in readings.items() if np.isfinite(of).all(axis=1).any()]
    return noise_of(robot, field=field, kinds=kinds)


def has_field(noise: Noise) -> bool:
    """Whether it has a smooth error."""
    return noise.position_field > 0 or noise.rotation_field > 0


def with_field(noise: Noise, part: float) -> Noise:
    """The same jitter with a part of the smooth field error."""
    return changed(noise, position_field=part * noise.position_field, rotation_field=part * noise.rotation_field)


def changed(noise: Noise, **values: float) -> Noise:
    """The noise with other values of some of its members."""
    names = ("position_jitter", "rotation_jitter", "position_field", "rotation_field", "correlation_length")
    return Noise(**{name: values.get(name, getattr(noise, name)) for name in names})
