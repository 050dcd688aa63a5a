"""A surrogate robot for the tests of `ctcr compare`: a simple formula gives its tip, and its errors are planted."""

from types import SimpleNamespace

import numpy as np
from ctcr.frames import matrix_from_rotation_vector, quaternion_from_rotation_vector
from ctcr.table.measurements import Measurements

JITTER_MM = 0.05
LENGTHS = (0.30, 0.20)


def robot(jitter_mm=JITTER_MM, roll="known", turn=(0.3, -0.2, 0.9)):
    """Two tubes, and a tracker frame that is turned by the rotation vector `turn` and shifted."""
    return SimpleNamespace(
        name="surrogate",
        lengths=np.array(LENGTHS),
        actuation=SimpleNamespace(screw_pitch=0.0),
        tracker=SimpleNamespace(
            rotation_vector_rad=list(turn),
            rotation=matrix_from_rotation_vector(turn),
            position=np.array([0.05, -0.02, 0.01]),
            sensor_on_tube=1,
            sensor_position=np.zeros(3),
            sensor_rotation_vector=np.zeros(3),
            sensor_rotation_known=roll == "known",
            jitter_mm=jitter_mm,
            jitter_deg=0.05,
            accuracy_95_mm=None,
            accuracy_95_deg=None,
        ),
    )


def tips(joints):
    """Tip (M, 3) and its orientation (M, 4) of joints (M, 4) = beta1, beta2, alpha1, alpha2, base frame."""
    b1, b2, a1, a2 = joints.T
    radius = 0.02 + 0.1 * (b1 - b2 + 0.24) + 0.004 * np.cos(a1 - a2)
    position = np.column_stack([radius * np.cos(a1), radius * np.sin(a1), LENGTHS[0] + b1])
    return position, quaternion_from_rotation_vector(np.column_stack([0 * a1, 0 * a1, a1]))


def stop_and_go(random, runs=10, stops=9, shared=False):
    """Joints, run and time of runs that go out, come back, and stop once more where they stopped on the way out."""
    joints, run = [], []
    for number in range(runs):
        if number == 0 or not shared:
            start = _corner(random)
            end = start + random.choice([-1, 1], 4) * random.uniform(0.3, 1.0, 4) * np.array([0.02, 0.02, 2.5, 2.5])
        out = start + np.linspace(0, 1, stops)[:, None] * (end - start)
        joints.append(np.vstack([out, out[-2::-1], out[stops // 2]]))
        run.append(np.full(len(joints[-1]), number))
    joints, run = np.vstack(joints), np.concatenate(run)
    return joints, run, 2.0 * np.arange(len(run))


def stream(random, seconds=60.0, rate=20.0):
    """One run out and back along a curve with changing speed; the readings of the return fall between the others."""
    t = np.arange(0, seconds, 1 / rate)
    phase = np.pi * np.sin(np.pi * (t + 0.013) / seconds)
    start, size = _corner(random), np.array([0.02, 0.015, 2.0, 1.5])
    joints = start + size * np.column_stack([np.sin(k * phase / 2 + k) for k in (1, 1, 2, 3)])
    return joints, np.zeros(len(t), int), t


def _corner(random):
    return np.array([-0.16, -0.08, 0, 0]) + random.uniform(-1, 1, 4) * np.array([0.02, 0.02, np.pi, np.pi])


def bench(random, path, error=None, noise_mm=JITTER_MM, quaternion=None, **options):
    """Robot, measurements and prediction with a planted error.

    error(joints, t, run): error vector (M, 3) in the base frame [m]; noise_mm: standard deviation per axis.
    """
    joints, run, t = path
    description = robot(**options)
    position, orientation = tips(joints)
    planted = np.zeros_like(position) if error is None else error(joints, t, run)
    measured = (position + planted) @ description.tracker.rotation.T + description.tracker.position
    measured = measured + random.normal(0, noise_mm * 1e-3, position.shape)
    given = {"t": np.asarray(t, float), "run": np.asarray(run), "position": measured, "quaternion": quaternion}
    readings = Measurements.of_joints(*np.hsplit(joints, 2), **given)
    prediction = SimpleNamespace(position=position, quaternion=orientation, status=np.zeros(len(run), int))
    return description, readings, prediction


def outward(joints, run):
    """+1 on the way out, -1 on the way back: the direction of the first joint's last step."""
    sign = np.ones(len(run))
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        steps = np.sign(np.diff(joints[rows, 0]))
        sign[rows[1:]] = steps * steps[0]
    return sign
