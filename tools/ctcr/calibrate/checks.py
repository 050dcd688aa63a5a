"""What is wrong with, or worth knowing of, a table that is to be fitted."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Integers, Mask
from ctcr.compare.offsets import find_run_offsets
from ctcr.compare.sample import take_sample
from ctcr.compare.visits import find_revisits, find_stops
from ctcr.errors import InputError, Problem
from ctcr.fit.result import Fit, rms
from ctcr.fit.run_frames import error_with_frames
from ctcr.fit.widening import widened
from ctcr.frames import base_to_tracker
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.show import wording
from ctcr.show.wording import listed
from ctcr.table.measurements import Measurements

LISTED = 12


def start(robot: Robot, readings: Measurements) -> float:
    """The tip's usual distance from the insertion axis [m], by the model as it is.

    Raises InputError where nothing is measured or solved, and where the tracker frame is no start for a fit.
    """
    if readings.position is None or not np.isfinite(readings.position).any():
        raise InputError(Problem("no position is measured: columns x_m, y_m, z_m are missing or empty"))
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    answer = Model(robot.standard).predict(beta, alpha, readings.force)
    if not answer.solved.any():
        raise InputError(Problem("the model solves no row of the table: are these the joints of this robot?"))
    tip, _ = base_to_tracker(robot.tracker, answer.position, answer.quaternion)
    distance = np.linalg.norm(readings.position - tip, axis=1)
    usual, longest = float(np.nanmedian(distance)), robot.tubes[0].length
    if usual > longest:
        raise InputError(
            Problem(
                f"the measured tips lie {1e3 * usual:.0f} mm from those predicted, more than the robot is long: the "
                f"tracker frame (tracker.position_mm, rotation_vector_rad) or its unit is wrong; find it with "
                f"`ctcr calibrate registration`"
            )
        )
    return max(float(np.sqrt(np.nanmean(np.sum(answer.position[answer.solved, :2] ** 2, axis=1)))), 1e-3)


def usable_rows(readings: Measurements) -> tuple[Mask, list[str]]:
    """Rows that say something new, and what to say about the others."""
    columns = [readings.t[:, None], readings.run[:, None], readings.beta, readings.alpha, readings.force]
    columns += [part for part in (readings.position, readings.quaternion) if part is not None]
    content = np.nan_to_num(np.hstack(columns), nan=1e300)
    _, first = np.unique(content, axis=0, return_index=True)
    usable = np.zeros(len(readings), bool)
    usable[first] = True
    if usable.all():
        return usable, []
    repeated = readings.row[~usable]
    return usable, [f"{_rows(repeated)} repeat earlier rows exactly and are left out: they are no new measurements."]


def outlier_rows(fit: Fit, readings: Measurements) -> list[int]:
    """Rows of the file whose readings hardly counted."""
    small = (fit.weights > 0) & (fit.weights < settings.OUTLIER_WEIGHT)  # 0: not fitted
    return readings.row[small.any(axis=1)].tolist()


def notices(after: Robot, readings: Measurements, fit: Fit, frame_per_run: bool) -> list[str]:
    """What the user should know of a fit, in sentences."""
    said_as_doubts = "prior standard deviations"
    said = [sentence(wider.text) for wider in widened(after, fit.priors.scales)]
    said += [sentence(text) for text in fit.warnings if said_as_doubts not in text]
    if not fit.converged:
        said.append(f"The fit did not converge: {fit.status}.")
    outliers = outlier_rows(fit, readings)
    if outliers:
        share = len(outliers) / max(int(np.sum(fit.used)), 1)
        said.append(f"{_rows(np.array(outliers))} look like outliers ({wording.percent(share)}) and hardly counted.")
    return said if frame_per_run else said + _run_frames(after, readings, fit)


def may_share_no_frame(readings: Measurements, fit: Fit) -> bool:
    """Whether a fit of one frame and other parameters leaves so large an error that the runs may not share a frame."""
    kinds = {name.startswith("tracker.") for name in fit.names}
    large = 1e3 * rms(fit.residual[:, :3]) > settings.FRAMES_BEYOND * fit.expected_mm()
    several = len(kinds) == 2 and len(np.unique(readings.run)) > 1
    return several and large


def sentence(text: str) -> str:
    """A warning of a fit as a sentence."""
    first = text if "." in text.split()[0] else text[0].upper() + text[1:]  # a parameter keeps its name
    return first + ("" if text.endswith(".") else ".")


def _run_frames(robot: Robot, readings: Measurements, fit: Fit) -> list[str]:
    """A sentence where the runs do not share one frame: an error far beyond the expected one disappears with a frame
    for each, or the same joints give other positions in other runs."""
    if len(np.unique(readings.run)) < 2:
        return []
    if found := _errors_if_framed(robot, readings, fit):
        text = f"The runs do not share one frame: a frame for each leaves {found[1]} of the {found[0]} RMS error."
        return [f"{text} --frame-per-run fits them."]
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    sample = take_sample(robot, readings, Model(robot.standard).predict(beta, alpha, readings.force))
    revisits = find_revisits(find_stops(sample), sample.lever)
    offsets = find_run_offsets(sample, revisits)
    if not offsets.found:
        return []
    share = wording.percent(offsets.share)
    text = f"The runs do not share one frame or homing: an offset for each explains {share} of the squared error that "
    text += "is left"
    if offsets.outlying:
        far = wording.join([str(run) for run in offsets.outlying[:8]])
        text += f"; runs {far} lie about {wording.mm(offsets.outlying_mm)} from the others"
    return [text + ". --frame-per-run fits a frame for each."]


def _errors_if_framed(robot: Robot, readings: Measurements, fit: Fit) -> tuple[str, str] | None:
    """RMS errors with one frame and with a frame for each run, in words; None where the second explains little."""
    before_mm, after_mm = error_with_frames(robot, readings, fit.noise)
    if before_mm > settings.FRAMES_BEYOND * fit.expected_mm() and after_mm < settings.FRAMES_LEAVE * before_mm:
        return wording.mm(before_mm), wording.mm(after_mm)
    return None


def _rows(rows: Integers) -> str:
    text = listed(rows, LISTED)
    return f"{len(rows)} rows ({text})" if len(rows) > 1 else f"Row {text}"
