"""What some runs leave open in others, by joints, loads and model alone: nothing that was read of a pose is used."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ctcr.fit import joint
from ctcr.model import parameters, user_recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]


class Coverage:
    """Of groups of rows, `group` (M,) numbered from 0."""

    def __init__(self, robot: Robot, measurements: Measurements, group: NDArray[np.int64]) -> None:
        rows = joint.measured_rows(measurements)
        self._worlds = [_informations(slopes, group) for slopes in _slopes(robot, measurements, rows)]

    def left_open(self, locked: Iterable[int]) -> Array:
        """Mean square error of the position in each locked group that the calibration by the others leaves, over that
        of the tracker's jitter."""
        locked = sorted(locked)
        return np.max([_left_open(*world, locked) for world in self._worlds], axis=0)


def _left_open(together: Array, information: Array, of_position: Array, locked: list[int]) -> Array:
    covariance = np.linalg.inv(together - information[locked].sum(axis=0))
    return np.einsum("ij,gji->g", covariance, of_position[locked]) / 3


def _informations(slopes: Array, group: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Information on the parameters, prior included (k, k), that of each group (G, k, k), and of its mean position."""
    whole, position = np.zeros((2, group.max() + 1, *2 * slopes.shape[-1:]))
    for k in range(len(whole)):
        own = slopes[group == k]
        whole[k] = np.einsum("mai,maj->ij", own, own)
        position[k] = np.einsum("mai,maj->ij", own[:, :3], own[:, :3]) / max(1, np.sum(own.any(axis=(1, 2))))
    return np.eye(slopes.shape[-1]) + whole.sum(axis=0), whole, position


def _slopes(robot: Robot, measurements: Measurements, rows: NDArray[np.bool_]) -> Iterable[Array]:
    """Of poses (M, 6, k) by the calibration parameters, in units of jitter and prior; with curves as stated, longer and
    shorter: where a curve starts near the plate, that decides which readings know its length."""
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    noise = noise_of_readings(robot, measurements, field=False)
    jitter = np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    table = user_recording.recording_of(robot, measurements, names)
    few = joint.few_of(rows)
    table.activate((rows if few is None else few).tolist())
    curves = np.array([name.endswith(".curved_length") for name in names])
    for way in (0.0, 1.0, -1.0):
        at = np.clip(mean + way * curves * sd, low, high)
        jacobian = table.residual(at, True)[1].reshape(len(measurements), 6, len(names))
        yield np.where(np.isfinite(jacobian), jacobian, 0.0) * sd / jitter[:, None]
