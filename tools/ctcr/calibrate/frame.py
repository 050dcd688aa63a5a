"""The tracker frame T_ref from poses of the tip, with no start: a registration in closed form, then a fit.

Homes and tubes keep the values of the robot file, as the frame alone is written there: fitted with it, they could move
far where the model misses something, and the frame would move far to make up for them. Their uncertainty counts in that
of the frame (consider covariance). Ref: Tapley, Schutz and Born, "Statistical Orbit Determination", 2004, chapter 6.
"""

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.audit import sensor_pose
from ctcr.calibrate.outcome import Outcome, Row, frame_rows
from ctcr.calibrate.procedure_figures import frame_scene
from ctcr.conventions import tips
from ctcr.conventions.alignment import aligned
from ctcr.conventions.hypotheses import with_frame
from ctcr.errors import InputError, Problem
from ctcr.fit import folds, joint
from ctcr.fit.result import Fit, Priors
from ctcr.frames import matrix_from_quaternion, nearest_rotation, of_sensor
from ctcr.model import parameters, user_recording
from ctcr.model.table_poses import standard_tips
from ctcr.robot.description import Robot
from ctcr.show.wording import sentence
from ctcr.table.measurements import Measurements

AXES = "xyz"
SD = parameters.ANYWHERE | {"position": settings.CONVENTION_ANYWHERE}  # [m], [rad] about the registration


def tracker_frame(robot: Robot, readings: Measurements) -> Outcome:
    """T_ref, wherever it is, that fits best with the homes and tubes of the robot file; its standard deviation where
    these are as far off as the file's uncertainty says.

    Raises InputError where fewer than three positions can be predicted.
    """
    start = registered(robot, readings)
    names = [f"tracker.{kind}.{axis}" for kind in SD for axis in AXES]
    anywhere = {name: SD[name.split(".")[1]] for name in names}
    # Where the sensor is lost too, a fit of frame and sensor alone may stop far off; free homes and tubes lead it on.
    near = joint.fit(start, readings, "standard", rows=folds.few_of(readings.measured), sd=anywhere)
    start = start.model_copy(update={"tracker": near.apply(start).tracker})
    fit = joint.fit(start, readings, names, sd=anywhere)
    own = [fit.names.index(name) for name in names]
    found, covariance = fit.apply(robot=start).tracker, considered(start, readings, fit)[np.ix_(own, own)]
    before, after = sensor_pose.placed(robot, readings)[0], robot.model_copy(update={"tracker": found})
    sd = np.sqrt(np.diag(covariance))
    vector = np.array(found.rotation_vector_rad)
    rows = frame_rows(robot, np.array(found.position_mm), 1e3 * sd[:3], vector, sd[3:], prior=False)
    before_mm, after_mm = (rms_mm(one, readings) for one in (before, after))
    rows.append(Row("error of the tip, RMS", "mm", after_mm, old=before_mm))
    figures = {"rms_mm": {"before": before_mm, "after": after_mm}, "rotation_sd_deg": np.degrees(sd[3:]).tolist()}
    notices = [*map(sentence, [*unknown(covariance), *fit.warnings])]
    view = frame_scene(readings, tips.predicted(robot, readings), {"robot file": robot.tracker, "found": after.tracker})
    return Outcome("Tracker frame", rows, notices, figures, view=view)


def considered(robot: Robot, readings: Measurements, fit: Fit) -> Array:
    """Covariance (n, n) of a fit to the readings that left homes and tubes as they are, with their uncertainty."""
    others = [name for name in parameters.uncertain(robot) if name not in fit.names]
    if not others:
        return fit.covariance
    robot, readings, _ = sensor_pose.usable(fit.apply(robot), readings)
    recorded = user_recording.recording_of(robot, readings, others)
    recorded.activate(fit.used.tolist())
    by_others = recorded.residual(recorded.nominal(), True)[1].reshape(len(readings), 6, -1)
    factor = Priors.of(robot, others, readings.beta).factor
    moved = fit.covariance @ fit.whitened()[1].T @ fit.whiten(by_others) @ factor
    return fit.covariance + moved @ moved.T


def registered(robot: Robot, readings: Measurements) -> Robot:
    """The robot in the frame that carries the predicted sensor, and where measured its z axis, to the readings; with a
    pose of the sensor where its file does not know it."""
    tip = standard_tips(robot, readings)
    place, measured = np.where(tip.solved[:, None], tip.position, np.nan), readings.positions
    count = int(np.isfinite(place + measured).all(axis=1).sum())
    if count < 3:
        text = f"the model predicts {count} of the measured positions: a tracker frame needs three or more"
        raise InputError(Problem(text, readings.source))

    def carrying(robot: Robot) -> Robot:
        predicted = of_sensor(robot.tracker, place, tip.quaternion)
        ahead = [
            there + settings.JOINT_LEVER * matrix_from_quaternion(turn)[:, :, 2]
            for there, turn in (predicted, (measured, readings.quaternions))
        ]
        points = (np.concatenate(pair) for pair in zip((predicted[0], measured), ahead, strict=True))
        return with_frame(robot, *aligned(*points)[:2])

    tracker, oriented = robot.tracker, tip.solved & readings.oriented
    if tracker.sensor_position_mm is not None and tracker.sensor_rotation_known:
        return carrying(robot)
    framed = carrying(robot)
    if not tracker.sensor_rotation_known and oriented.any():
        turn = world_rotation(*(matrix_from_quaternion(q[oriented]) for q in (tip.quaternion, readings.quaternions)))
        framed = with_frame(robot, turn, np.nanmean(measured - place @ turn.T, axis=0))
    for _ in range(settings.PLACINGS):
        found = carrying(sensor_pose.placed(framed, readings, tip)[0])
        framed = with_frame(robot, found.tracker.rotation, found.tracker.position)
    return found


def world_rotation(tips: Array, seen: Array) -> Array:
    """R_tracker_base (3, 3) from rotations (K, 3, 3) of tips, base frame, and of the sensor on them, tracker frame.

    Both it and R_tip_sensor are unknown: seen = R_tracker_base tips R_tip_sensor, linear in the products of their
    entries. Ref: Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", 2013.
    """
    both = np.einsum("kij,klm->iljm", tips, seen).reshape(9, 9)
    first = np.linalg.svd(both)[0][:, 0].reshape(3, 3).T
    return nearest_rotation(first * np.sign(np.linalg.det(first)))


def rms_mm(robot: Robot, readings: Measurements) -> float:
    """RMS distance of the readings from the positions that the standard model predicts, where it has a solution."""
    return 1e3 * float(np.sqrt(np.nanmean(tips.errors(robot, readings) ** 2)))


def unknown(covariance: Array) -> list[str]:
    """Sentences on the directions of position and rotation (6, 6) that the readings do not determine."""
    said = []
    for part, kind, what in ((slice(0, 3), "position", "the shift along"), (slice(3, 6), "rotation", "the turn about")):
        variance, axes = np.linalg.eigh(covariance[part, part])
        for axis in axes.T[np.sqrt(variance) > settings.UNDETERMINED * SD[kind]]:
            words = ", ".join(f"{x + 0.0:.2f}" for x in axis)
            said.append(f"the readings do not determine {what} ({words}) in the tracker's axes: any value is as good")
    return said
