"""Spikes of the tracker: readings that leap away and back, found by the readings around them and not by a fit."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show.wording import listed
from ctcr.table.measurements import Measurements


def left_out(
    robot: Robot, measurements: Measurements, predicted: Array | None = None
) -> tuple[Measurements, list[str]]:
    """The table without the poses of spikes, and a notice if there are any. `predicted` as of `leaps`.

    An effect of the robot shows in more than one reading along a path, or moves the tip no farther than its joints and
    load do. The model is that of the robot file: no fit selects the readings by which it is judged.
    """
    leap = leaps(robot, measurements, predicted)
    spikes = np.isfinite(leap)
    if not spikes.any():
        return measurements, []
    one = spikes.sum() == 1
    count = "1 reading leaps" if one else f"{spikes.sum()} readings leap"
    rows = f"{'row' if one else 'rows'} {listed(measurements.row[spikes])}"
    notice = (
        f"{count} up to {1e3 * np.nanmax(leap):.1f} mm away and back ({rows}), "
        f"at least {settings.SPIKE_LEAP:g} times as far as the joints and the load move the tip: "
        f"{'a spike' if one else 'spikes'} of the tracker, left out of all fits and errors"
    )
    return measurements.without_poses(spikes), [notice]


def leaps(robot: Robot, measurements: Measurements, predicted: Array | None = None) -> Array:
    """Distance (M,) [m] that each spike leaps; NaN for other readings.

    `predicted` positions (M, 3) of all rows by the standard model, base frame, where they are known already.
    """
    leap, jitter = np.full(len(measurements), np.nan), robot.tracker.jitter_mm
    if measurements.position is None or not jitter:
        return leap
    read = np.flatnonzero(np.isfinite(measurements.position).all(axis=1))
    if predicted is None:
        predicted = standard_tips(robot, measurements.rows(read)).position
    else:
        predicted = predicted[read]
    measured, run = measurements.position[read], measurements.run[read]
    step = np.diff(measurements.load_space[read], axis=0)
    measured_step, predicted_step = (np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (measured, predicted))
    leaped = np.minimum(measured_step[:-1], measured_step[1:])
    moved = np.maximum(predicted_step[:-1], predicted_step[1:])  # NaN, where the model has no solution, finds nothing
    onward = np.sum(step[:-1] * step[1:], axis=1) >= 0  # at a turn, a leap may be one step that the model misses
    found = (
        (onward & (run[:-2] == run[2:]) & (leaped > settings.SPIKE_LEAP * moved))
        | (leaped > settings.SPIKE_LEAP * 2 * robot.tubes[0].length)  # twice its reach: no tip moves farther
    )
    found &= (leaped > settings.SPIKE_VISIBLE * np.sqrt(6) * 1e-3 * jitter) & (
        np.linalg.norm(measured[2:] - measured[:-2], axis=1) < settings.SPIKE_RETURN * leaped
    )
    leap[read[1:-1][found]] = leaped[found]
    return leap
