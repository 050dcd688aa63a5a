"""Measurements in the order in which they were taken, beside a robot with effects."""

from collections.abc import Mapping, Sequence

import numpy as np

from ctcr import _core, settings
from ctcr.arrays import Array, Mask, evenly
from ctcr.effects import catalogue
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def names_of(n_tubes: int) -> tuple[str, ...]:
    """All parameters of a robot and of all effects."""
    return (*parameters.names_of(n_tubes), *catalogue.names_of(n_tubes))


def values(robot: Robot) -> Array:
    """Values of all these parameters. Turns count from the file's, so they are 0."""
    own = parameters.values(robot)
    for i, name in enumerate(parameters.names_of(robot.n_tubes)):
        if parameters.field_of(name).path is None:
            own[i] = 0.0
    return np.concatenate([own, catalogue.values(robot)])


def session_part(measurements: Measurements) -> Array:
    """When each row was measured, from 0 (first in time) to 1 (last); by its number where times are missing."""
    t = measurements.clock
    return (t - t.min()) / max(np.ptp(t), np.finfo(float).tiny)


def steps_for(
    robot: Robot, measurements: Measurements, noise: _core.Noise, chi_square: float = settings.INTEGRATION_ERROR
) -> int:
    """The smallest factor on the integration steps whose errors, of all rows against the tracker's jitter, stay below
    `chi_square`.

    Integration errors are systematic: what one reading hides, many show. They fall with the fourth power of the steps.
    """
    count, least = len(measurements), settings.STEPS
    sample = np.zeros(count, bool)
    sample[evenly(count, settings.INTEGRATION_SAMPLE)] = True
    coarse, fine = (_residual(robot.standard, measurements, steps, sample) for steps in (least, 2 * least))
    error = (coarse - fine) * 16 / 15 / np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    known = np.isfinite(error).any(axis=1)
    if not known.any():
        return least
    missed = np.nansum(error[known] ** 2) * count / np.sum(known)
    return int(np.clip(np.ceil(least * (missed / chi_square) ** 0.125), least, settings.MOST_STEPS))


def recording_of(
    robot: Robot,
    measurements: Measurements,
    names: Sequence[str] = (),
    *,
    fixed: Mapping[str, float] | None = None,
    steps: int = settings.STEPS,
    threads: int = 0,
    profiles: Array | None = None,
) -> _core.Recording:
    """The compiled residuals of all rows as functions of the named parameters.

    `fixed` gives parameters of effects other values than the robot's. `profiles` (K, 3N): at K arc lengths along each
    tube, equally spaced from its grasped point to its tip, the curvature about its x and y axes to add [1/m], and the
    relative change of its bending stiffness.
    """
    known = names_of(robot.n_tubes)
    own = dict(zip(catalogue.names_of(robot.n_tubes), catalogue.values(robot), strict=True)) | dict(fixed or {})
    beta, alpha = robot.joints_of_table(measurements.beta, measurements.alpha)
    return _core.Recording(
        parameters=parameters.values(robot),
        effects=np.array(list(own.values())),
        sensor_tube=robot.tracker.sensor_on_tube - 1,
        beta=beta,
        alpha=alpha,
        force=measurements.force,
        position=measurements.positions,
        quaternion=measurements.quaternions,
        time=measurements.t,
        part=session_part(measurements),
        run=measurements.run.astype(np.int32),
        centre=measurements.centre,
        free=[known.index(name) for name in names],
        steps=steps,
        threads=threads,
        from_home=measurements.from_home,
        profiles=profiles,
    )


def _residual(robot: Robot, measurements: Measurements, steps: int, rows: Mask) -> Array:
    """Residual (M, 6) at the robot file's values in some rows (M,); NaN in the others."""
    table = recording_of(robot, measurements, steps=steps)
    table.activate(rows.tolist())
    return table.residual(np.empty(0))[0].reshape(-1, 6)
