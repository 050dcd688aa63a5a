"""How well some runs determine the poses of others, by joints, loads and model alone: no measured pose is used."""

from collections.abc import Iterable

import numpy as np

from ctcr.arrays import Array, Integers, Mask
from ctcr.model import parameters, user_recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


class Coverage:
    """Fisher information of groups of rows on the standard calibration: `rows` (M,) that count, `group` (M,) from 0."""

    def __init__(self, robot: Robot, measurements: Measurements, rows: Mask, group: Integers) -> None:
        self._linearisations = [_information(J, group) for J in _linearisations(robot, measurements, rows)]

    def undetermined(self, held_out: Iterable[int]) -> Array:
        """Mean square error of the position in each held-out group (in ascending order) that a calibration by the
        others leaves, over that of the tracker's jitter."""
        held_out = sorted(held_out)
        return np.max([_undetermined(*one, held_out) for one in self._linearisations], axis=0)


def _undetermined(total: Array, information: Array, of_position: Array, held_out: list[int]) -> Array:
    covariance = np.linalg.inv(total - information[held_out].sum(axis=0))
    return np.einsum("ij,gji->g", covariance, of_position[held_out]) / 3


def _information(jacobian: Array, group: Integers) -> tuple[Array, Array, Array]:
    """Information on the parameters, prior included (k, k), that of each group (G, k, k), and of its mean position."""
    whole, position = np.zeros((2, group.max() + 1, *2 * jacobian.shape[-1:]))
    for k in range(len(whole)):
        own = jacobian[group == k]
        whole[k] = np.einsum("mai,maj->ij", own, own)
        position[k] = np.einsum("mai,maj->ij", own[:, :3], own[:, :3]) / max(1, np.sum(own.any(axis=(1, 2))))
    return np.eye(jacobian.shape[-1]) + whole.sum(axis=0), whole, position


def _linearisations(robot: Robot, measurements: Measurements, rows: Mask) -> Iterable[Array]:
    """Derivatives of poses (M, 6, k) by the standard parameters, in units of jitter and prior sd; 0 in other rows.

    At curved lengths as stated, longer and shorter by their sd: where a curve starts near the plate, that decides which
    readings depend on its length.
    """
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    noise = noise_of_readings(robot, measurements, field=False)
    jitter = np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    model = user_recording.recording_of(robot, measurements, names)
    model.activate(rows.tolist())
    curves = np.array([name.endswith(".curved_length") for name in names])
    for side in (0.0, 1.0, -1.0):
        at = np.clip(mean + side * curves * sd, low, high)
        jacobian = model.residual(at, True)[1].reshape(len(measurements), 6, len(names))
        yield np.where(np.isfinite(jacobian), jacobian, 0.0) * sd / jitter[:, None]
