"""Small sessions with a hidden effect, made by the library's own model."""

import dataclasses

import numpy as np
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.model import parameters, recording
from ctcr.table.measurements import Measurements


def session(robot, random, runs=8, stops=6):
    """Joints of runs that go out and come back through the same stops, every second one with a weight."""
    home = 1e-3 * np.array(robot.actuation.home_translation_mm)
    rows = []
    for run in range(runs):
        ends = [
            (
                home - random.uniform(0, 0.03) + np.array([-0.02, -0.01, 0]) * random.uniform(0.2, 1),
                random.uniform(-3, 3, 3),
            )
            for _ in range(3)
        ]
        way = [
            (a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]))
            for a, b in zip(ends, ends[1:], strict=False)
            for u in np.linspace(0, 1, stops // 2, endpoint=False)
        ]
        for beta, alpha in [*way, *reversed(way)]:
            rows.append((2.0 * len(rows), run, beta, alpha, (0, -0.1 * (run % 2), 0)))
    t, run, beta, alpha, force = (np.array(column) for column in zip(*rows, strict=True))
    position, quaternion = np.full((len(t), 3), np.nan), np.full((len(t), 4), np.nan)
    given = {"t": t, "run": run, "force": force.astype(float), "position": position, "quaternion": quaternion}
    return Measurements.of_joints(beta, alpha, **given)


def measured(robot, random, hidden, calibration=0.5, fixed=None):
    """Readings of a robot that differs from its file as its uncertainties say, and has a hidden effect."""
    names = parameters.expand("standard", robot)
    mean, sd, _, _ = parameters.priors(robot, names)
    truth = mean + calibration * sd * random.normal(size=len(names))
    table = session(robot, random)
    centred = dataclasses.replace(table, position=np.zeros((len(table), 3)))
    core = recording.recording_of(robot, centred, [*names, *hidden], fixed=fixed, steps=4)
    core.residual(np.array([*truth, *hidden.values()]))
    position, quaternion = core.predicted()
    jitter = quaternion_from_rotation_vector(np.deg2rad(robot.tracker.jitter_deg) * random.normal(size=(len(table), 3)))
    position = position + 1e-3 * robot.tracker.jitter_mm * random.normal(size=position.shape)
    return dataclasses.replace(table, position=position, quaternion=product(jitter, quaternion))


def measured_session(robot, runs=8):
    table = session(robot, np.random.default_rng(0), runs)
    return dataclasses.replace(table, position=np.zeros((len(table), 3)))
