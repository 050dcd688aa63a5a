"""The two floors of the error, `sensor jitter` and `expected error`, and the test whether noise explains what a fit
leaves. All commands take both from here, so that they show the same figures."""

from dataclasses import dataclass
from math import nan, sqrt

import numpy as np

from ctcr.arrays import Array, Mask
from ctcr.audit import sensor_pose
from ctcr.errors import InputError
from ctcr.fit import joint
from ctcr.fit.result import Fit
from ctcr.fit.sessions import part_of_runs, some_runs
from ctcr.model import parameters, user_recording
from ctcr.model.noise import Noise, noise_of_readings
from ctcr.model.sessions import told
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

UNEXPLAINED = "the noise does not explain"  # as the warnings of a fit begin that say so


@dataclass(frozen=True)
class Floors:
    """RMS position errors [mm]; NaN where the robot file does not say enough."""

    sensor_jitter_mm: float = nan  # of a single reading, as stated
    expected_error_mm: float = nan  # that a right model leaves, calibrated to the readings: jitter, field, parameters

    NAMES = ("sensor jitter", "expected error")
    MEANING = (
        "expected error: what a right model leaves, by jitter, field error of the tracker and uncertain parameters"
    )

    def rows(self) -> list[tuple[str, float]]:
        """For people."""
        return list(zip(self.NAMES, (self.sensor_jitter_mm, self.expected_error_mm), strict=True))

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {"sensor_jitter_mm": self.sensor_jitter_mm, "expected_error_mm": self.expected_error_mm}


def floors(robot: Robot, readings: Measurements) -> Floors:
    """The floors of the error of these readings. They follow from the robot file: no fit and no residual changes them.

    The expected error is what a standard calibration by least squares leaves where the model is right: the noise, less
    the part that the parameters absorb, and the frames of the runs where each has its own. Every command computes it
    from the same rows.
    """
    jitter = sqrt(3) * (robot.tracker.jitter_mm or nan)
    robot, readings, _ = sensor_pose.trusted(robot, readings)
    if not np.isfinite(readings.positions).any():
        return Floors(jitter)
    readings, chosen = part_of_runs(robot, some_runs(readings))
    try:
        noise = noise_of_readings(robot, readings)
        names = told(parameters.uncertain(robot), readings)
        _, sd, _, _ = parameters.priors(robot, names)
    except InputError:  # nothing could be fitted
        return Floors(jitter)
    recorded = user_recording.recording_of(robot, readings, names)
    recorded.activate(chosen.tolist())
    residual, jacobian, _ = recorded.residual(recorded.nominal(), True)
    known = np.isfinite(residual).reshape(-1, 6) & chosen[:, None]
    if not known[:, :3].any():  # nothing is solved
        return Floors(jitter)
    # Of the K numbers read: derivatives (K, n), the gain of the fit (n, K), and what it leaves of jitter and field.
    row, axis = np.nonzero(known)
    jitters = np.where(axis < 3, noise.position_jitter, noise.rotation_jitter)
    fields = np.where(axis < 3, noise.position_field, noise.rotation_field)
    J = jacobian[known.ravel()] * sd
    if readings.sessions is not None:  # the frames of the runs are fitted too
        J = np.hstack([J, recorded.columns(residual)[known.ravel()]])
    gain = np.linalg.solve((J.T / jitters**2) @ J + np.eye(J.shape[1]), J.T / jitters**2)
    square = jitters**2 * (1 - 2 * np.sum(J * gain.T, axis=1))
    square += np.sum((J @ ((gain * jitters**2) @ gain.T)) * J, axis=1)
    if fields.any():
        smooth = fields[:, None] * _field(joint.sensor_positions(robot, readings), chosen, noise)[row]
        for a in range(6):  # axes are independent
            alone = np.where((axis == a)[:, None], smooth, 0.0)
            square += np.sum((alone - J @ (gain @ alone)) ** 2, axis=1)
    return Floors(jitter, 1e3 * sqrt(3 * np.mean(square[axis < 3])))


def _field(positions: Array, chosen: Mask, noise: Noise) -> Array:
    """A root (M, k) of the correlation of the field error at the chosen positions (M, 3) [m]."""
    apart = np.sum((positions[chosen, None] - positions[None, chosen]) ** 2, axis=2)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * apart / noise.correlation_length**2))
    kept = values > 1e-9 * values[-1]
    root = np.zeros((len(positions), np.sum(kept)))
    root[chosen] = vectors[:, kept] * np.sqrt(values[kept])
    return root


def explains(fit: Fit, stated: Noise) -> bool:
    """Whether the noise as stated, with the likeliest part of its field error, explains what a fit leaves."""
    return not joint.rejects(joint.with_likeliest_field(fit, stated))


def warnings(fit: Fit, explained: bool) -> list[str]:
    """The warnings of a fit; where the noise explains its residual, without those that say otherwise."""
    return [text for text in fit.warnings if not (explained and text.startswith(UNEXPLAINED))]
