"""Orientations in another form: quaternions scalar last, or of the inverse rotation, found once positions are right."""

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array
from ctcr.conventions.calibrated import Calibrated
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import QUATERNION, Change, changed
from ctcr.frames import angle_between, base_to_tracker, conjugate, matrix_from_quaternion, nearest_rotation, product
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show.wording import numbers
from ctcr.table.measurements import Measurements

TURNED = "sensor_rotation"
SCALAR_LAST = ("quaternion_order", "the quaternion columns hold x, y, z, w", "ctcr import --quaternion xyzw")
INVERSE = ("quaternion_inverse", "the quaternions are those of the inverse rotation", "ctcr import --invert-quaternion")


def wrong_form(fit: Calibrated, readings: Measurements, axis: int | None = None) -> tuple[list[Finding], Change]:
    """Faults in the quaternions of readings whose positions fit, and the change that corrects them.

    axis: the axis of the tracker along which they are mirrored
    """
    given = readings.quaternions
    use = fit.solved & readings.oriented
    if not use.any():
        return [], lambda m: m
    predicted = _predicted(fit.robot, readings.rows(use))
    known = _is_known(fit.robot)
    measured = {form: _in_form(given[use], *form, axis) for form in np.ndindex(2, 2)}
    errors = {form: _error_deg(predicted, measured[form], known) for form in measured}
    last, inverse = min(errors, key=lambda form: errors[form])
    before, after = errors[0, 0], errors[last, inverse]
    turn = _turn_between(predicted, measured[0, 0])
    turned = _error_deg(predicted, measured[0, 0], False)
    # A physical effect may ask for a turn, too, but hardly for a large one, and it leaves more than a turn does.
    is_noise = turned < settings.CONVENTION_AT_FLOOR * (fit.robot.tracker.jitter_deg or 0.0)
    jump = settings.SENSOR_JUMP[1] if is_noise else np.deg2rad(settings.CONVENTION_MOST_JUMP_DEG)
    if known and turned < min(after, settings.CONVENTION_CONSTANT * before) and turn.magnitude() > jump:
        return [_turned(fit, turn, (before, turned))], changed("quaternion", lambda q: _in_form(q, 0, 0, axis))
    if after > settings.CONVENTION_CLEAR * before:  # it is not clear that any form is wrong
        last = inverse = 0
    wrong = [SCALAR_LAST] * last + [INVERSE] * inverse
    found = [
        Finding(kind, text, QUATERNION, fix, rms_mm=(fit.rms_mm, fit.rms_mm), rms_deg=(before, after))
        for kind, text, fix in wrong
    ]
    return found, changed("quaternion", lambda q: _in_form(q, last, inverse, axis))


def mirrored(fit: Calibrated, readings: Measurements, axis: int) -> bool:
    """Whether quaternions are mirrored along an axis of the tracker as the positions were."""
    return _in_best_form(fit, readings, axis) < _in_best_form(fit, readings, None)


def least_error_deg(fit: Calibrated, readings: Measurements, axis: int | None) -> float:
    """RMS error of the orientations in the form that suits them best, mirrored along an axis of the tracker or not; 0
    where none was measured."""
    return min(_in_best_form(fit, readings, along) for along in {None, axis})


def _in_best_form(fit: Calibrated, readings: Measurements, axis: int | None) -> float:
    """The same with all of them mirrored along an axis, or none."""
    use = fit.solved & readings.oriented
    if not use.any():
        return 0.0
    predicted, given = _predicted(fit.robot, readings.rows(use)), readings.quaternions[use]
    forms = (_in_form(given, *form, axis) for form in np.ndindex(2, 2))
    return min(_error_deg(predicted, form, _is_known(fit.robot)) for form in forms)


def error_deg(robot: Robot, readings: Measurements) -> float:
    """RMS error of the orientations; NaN where none was measured."""
    some = readings.rows(readings.oriented)
    known = _is_known(robot)
    return _error_deg(_predicted(robot, some), some.quaternions, known) if len(some) else np.nan


def mirror(quaternion: Array, axis: int) -> Array:
    """Rotations (..., 4) seen in a mirror across the plane normal to an axis: that component of the vector stays."""
    sign = np.array([1.0, -1.0, -1.0, -1.0])
    sign[1 + axis] = 1.0
    return quaternion * sign


def _in_form(quaternion: Array, last: int, inverse: int, axis: int | None) -> Array:
    """Right quaternions (..., 4) of those that are scalar last, of the inverse rotation, mirrored along an axis."""
    moved = np.roll(quaternion, 1, axis=-1) if last else quaternion
    turned = conjugate(moved) if inverse else moved
    return turned if axis is None else mirror(turned, axis)


def _is_known(robot: Robot) -> bool:
    """Whether the robot file knows how the sensor is turned, but for an error of mounting."""
    stated = robot.uncertainty.sensor_rotation_deg
    return robot.tracker.sensor_rotation_known and np.max(stated or 0.0) <= np.rad2deg(settings.SENSOR_JUMP[1])


def _predicted(robot: Robot, readings: Measurements) -> Array:
    tips = standard_tips(robot, readings)
    return base_to_tracker(robot.tracker, tips.position, tips.quaternion)[1]


def _error_deg(predicted: Array, measured: Array, known: bool) -> float:
    """RMS angle between orientations (K, 4), but for a turn of the sensor where its rotation is not known; NaN without
    any."""
    turn = Rotation.identity() if known else _turn_between(predicted, measured)
    angle = angle_between(product(predicted, turn.as_quat(scalar_first=True)), measured)
    angle = angle[np.isfinite(angle)]
    return float(np.degrees(np.sqrt(np.mean(angle**2)))) if len(angle) else np.nan


def _turn_between(predicted: Array, measured: Array) -> Rotation:
    """The turn of the sensor that predicted orientations (K, 4) lack most."""
    turns = matrix_from_quaternion(product(conjugate(predicted), measured))
    return Rotation.from_matrix(nearest_rotation(np.nanmean(turns, axis=0)))


def _turned(fit: Calibrated, turn: Rotation, error_deg: tuple[float, float]) -> Finding:
    """The finding that the sensor is turned against its rotation in the robot file."""
    vector = (Rotation.from_rotvec(fit.robot.tracker.sensor_rotation_vector) * turn).as_rotvec()
    text = f"the sensor is turned by {np.degrees(turn.magnitude()):.0f} deg against what the robot file says"
    fix = f"set tracker.sensor_rotation_vector_rad to {numbers(vector, 3)}, or to null: ctcr calibrate fit finds it"
    return Finding(TURNED, text, QUATERNION, fix, rms_mm=(fit.rms_mm, fit.rms_mm), rms_deg=error_deg)
