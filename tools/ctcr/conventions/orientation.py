"""Orientations in another form: quaternions scalar last, or of the inverse rotation, found once positions are right."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.conventions.calibrated import Calibrated
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import QUATERNION, Change, changed
from ctcr.frames import base_to_tracker, conjugate, matrix_from_quaternion
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

SCALAR_LAST = ("quaternion_order", "the quaternion columns hold x, y, z, w", "ctcr import --quaternion xyzw")
INVERSE = ("quaternion_inverse", "the quaternions are those of the inverse rotation", "ctcr import --invert-quaternion")


def wrong_form(fit: Calibrated, readings: Measurements) -> tuple[list[Finding], Change]:
    """What is wrong with the quaternions of readings whose positions fit, and the change that corrects them."""
    given = readings.quaternions
    use = fit.solved & readings.oriented
    if not use.any():
        return [], lambda m: m
    predicted = _predicted(fit.robot, readings.rows(use))
    roll_known = fit.robot.tracker.roll_known
    errors = {form: _error_deg(predicted, _in_form(given[use], *form), roll_known) for form in np.ndindex(2, 2)}
    last, inverse = best = min(errors, key=lambda form: errors[form])
    before, after = errors[0, 0], errors[best]
    if not any(best) or after > settings.CONVENTION_CLEAR * before:
        return [], lambda m: m
    wrong = [SCALAR_LAST] * last + [INVERSE] * inverse
    found = [
        Finding(kind, text, QUATERNION, fix, rms_mm=(fit.rms_mm, fit.rms_mm), rms_deg=(before, after))
        for kind, text, fix in wrong
    ]
    return found, changed("quaternion", lambda q: _in_form(q, last, inverse))


def mirrored(fit: Calibrated, readings: Measurements, axis: int) -> bool:
    """Whether quaternions are mirrored along an axis of the tracker as the positions were."""
    use = fit.solved & readings.oriented
    if not use.any():
        return False
    predicted, given = _predicted(fit.robot, readings.rows(use)), readings.quaternions[use]
    options = [
        min(_error_deg(predicted, _in_form(q, *form), fit.robot.tracker.roll_known) for form in np.ndindex(2, 2))
        for q in (given, mirror(given, axis))
    ]
    return options[1] < options[0]


def error_deg(robot: Robot, readings: Measurements) -> float:
    """RMS error of the orientations; NaN where none was measured."""
    some = readings.rows(readings.oriented)
    return _error_deg(_predicted(robot, some), some.quaternions, robot.tracker.roll_known) if len(some) else np.nan


def mirror(quaternion: Array, axis: int) -> Array:
    """Rotations (..., 4) seen in a mirror across the plane normal to an axis: that component of the vector stays."""
    sign = np.array([1.0, -1.0, -1.0, -1.0])
    sign[1 + axis] = 1.0
    return quaternion * sign


def _in_form(quaternion: Array, last: int, inverse: int) -> Array:
    moved = np.roll(quaternion, 1, axis=-1) if last else quaternion
    return conjugate(moved) if inverse else moved


def _predicted(robot: Robot, readings: Measurements) -> Array:
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    tips = Model(robot.standard).predict(beta, alpha, readings.force)
    return base_to_tracker(robot.tracker, tips.position, tips.quaternion)[1]


def _error_deg(predicted: Array, measured: Array, roll_known: bool) -> float:
    """RMS angle between orientations (K, 4), or between tip directions where the roll is unknown."""
    a, b = matrix_from_quaternion(predicted), matrix_from_quaternion(measured)
    cosine = np.sum(a[..., 2] * b[..., 2], axis=1)
    if roll_known:
        cosine = (np.einsum("kij,kij->k", a, b) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1, 1))
    return float(np.degrees(np.sqrt(np.nanmean(angle**2))))
