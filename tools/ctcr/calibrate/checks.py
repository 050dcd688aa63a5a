"""Faults of a table that is to be fitted, and notices on it."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Integers, Mask
from ctcr.errors import InputError, Problem
from ctcr.fit import floors
from ctcr.fit.result import Fit
from ctcr.fit.widening import widened
from ctcr.frames import base_to_tracker
from ctcr.model.noise import noise_of_readings
from ctcr.model.parameters import field_of
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show import wording
from ctcr.show.wording import listed, numbers, sentence
from ctcr.table.measurements import Measurements

LISTED = 12
STOPPED = "the fit stopped where"  # as the warnings of a fit begin that ended at a limit of several parameters
SAID_AS_DOUBTS = ("moved by more than", "stopped at a bound", STOPPED)


def start(robot: Robot, readings: Measurements) -> float:
    """The tip's usual distance from the insertion axis [m], by the model as it is.

    Raises InputError where nothing is measured or solved, and where the tracker frame is no start for a fit.
    """
    if readings.position is None or not np.isfinite(readings.position).any():
        raise InputError(Problem("no position is measured: columns x_m, y_m, z_m are missing or empty"))
    answer = standard_tips(robot, readings)
    if not answer.solved.any():
        raise InputError(Problem("the model solves no row of the table: are these the joints of this robot?"))
    tip, _ = base_to_tracker(robot.tracker, answer.position, answer.quaternion)
    distance = np.linalg.norm(readings.position - tip, axis=1)
    usual, longest = float(np.nanmedian(distance)), robot.tubes[0].length
    if usual > longest:
        text = (
            f"the measured tips lie {1e3 * usual:.0f} mm from those predicted, more than the robot is long: the "
            "tracker frame (tracker.position_mm, rotation_vector_rad) or its unit is wrong; find it with "
            "`ctcr calibrate frame`"
        )
        raise InputError(Problem(text))
    return max(float(np.sqrt(np.nanmean(np.sum(answer.position[answer.solved, :2] ** 2, axis=1)))), 1e-3)


def of_sensor(robot: Robot, fit: Fit) -> list[str]:
    """Where a fit found the sensor of its robot, in the frame of the tip, in a sentence; none where that was known."""
    sd, said = dict(zip(fit.names, fit.sd, strict=True)), []
    for kind, words, values, unit in (
        ("position", "position", 1e3 * robot.tracker.sensor_position, "mm"),
        ("rotation", "rotation vector", robot.tracker.sensor_rotation_vector, "rad"),
    ):
        names = [f"tracker.sensor_{kind}.{axis}" for axis in "xyz"]
        if sd.keys() & names:
            widths = numbers((field_of(name).factor * sd.get(name, 0.0) for name in names), 3)
            said.append(f"{words} {numbers(values, 3)} {unit} ± {widths} {field_of(names[0]).unit}")
    if len(said) == 1 and not np.isfinite(fit.residual[:, 3:]).any():
        said.append("no rotation, as no orientation was measured")
    return [f"Found of the sensor, in the frame of the tip: {'; '.join(said)}."] if said else []


def outlier_rows(fit: Fit, readings: Measurements) -> list[int]:
    """Rows of the file whose readings hardly counted."""
    small = (fit.weights > 0) & (fit.weights < settings.OUTLIER_WEIGHT)  # 0: not fitted
    return readings.row[small.any(axis=1)].tolist()


def notices(robot: Robot, readings: Measurements, fit: Fit, few: Fit) -> list[str]:
    """Notices on a fit, in sentences; `few`: the fit to a part of its rows, where they are many."""
    unexplained = any(text.startswith(floors.UNEXPLAINED) for text in fit.warnings)
    explained = not unexplained or floors.explains(few, noise_of_readings(robot, readings))
    said = [wider.sentence for wider in widened(robot, fit.priors.scales)]
    said += [sentence(text) for text in floors.warnings(fit, explained) if not text.startswith(SAID_AS_DOUBTS)]
    if not fit.converged:
        said.append(f"The fit did not converge: {fit.status}.")
    outliers = outlier_rows(fit, readings)
    if outliers:
        share = len(outliers) / max(int(np.sum(fit.used)), 1)
        look = "looks like an outlier" if len(outliers) == 1 else "look like outliers"
        text = f"{_rows(np.array(outliers))} {look} ({wording.percent(share)}) and hardly counted"
        said.append(text + _of_runs(readings, fit.used, np.isin(readings.row, outliers)) + ".")
    return said


def limits(fit: Fit) -> list[str]:
    """Where a limit of several parameters together stopped a fit, in sentences."""
    return [sentence(text) for text in fit.warnings if text.startswith(STOPPED)]


def _of_runs(readings: Measurements, used: Mask, outlying: Mask) -> str:
    """How many of the used readings of each run are outliers, most first: a run that is off as a whole shows."""
    runs, count = np.unique(readings.run[outlying], return_counts=True)
    if len(np.unique(readings.run)) < 2:
        return ""
    every = [int(np.sum(used & (readings.run == run))) for run in runs]
    order = np.argsort(-count, kind="stable")
    return f": {listed([f'{count[k]} of {every[k]} in run {runs[k]}' for k in order])}"


def _rows(rows: Integers) -> str:
    text = listed(rows, LISTED)
    return f"{len(rows)} rows ({text})" if len(rows) > 1 else f"Row {text}"
