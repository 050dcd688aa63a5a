"""Robots, joints and loads for the tests of the compiled model."""

import numpy as np
from ctcr.frames import matrix_from_quaternion
from ctcr.robot.description import Actuation, Robot, Tracker, Tube, Uncertainty


def make_robot(n_tubes: int = 3, *, sensor: int = 1, gravity=None, **of_each_tube) -> Robot:
    """A robot of nested nitinol tubes, innermost longest; `of_each_tube` holds lists that replace fields."""
    tubes = [
        dict(
            youngs_modulus_GPa=58.0,
            poisson_ratio=0.3,
            density_kg_m3=6450.0,
            inner_diameter_mm=1.0 + 0.5 * i,
            outer_diameter_mm=1.4 + 0.5 * i,
            length_mm=150.0 + 100.0 * (n_tubes - i),
            curved_length_mm=40.0 + 10.0 * i,
            curvature_per_m=9.0 - 2.0 * i,
        )
        for i in range(n_tubes)
    ]
    for field, values in of_each_tube.items():
        for tube, value in zip(tubes, values, strict=True):
            tube[field] = value
    return Robot(
        name="test",
        gravity=gravity,
        tubes=[Tube(**tube) for tube in tubes],
        actuation=Actuation.model_construct(),
        tracker=Tracker.model_construct(sensor_on_tube=sensor),
        uncertainty=Uncertainty.model_construct(),
    )


def random_joints(robot: Robot, rows: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Joints (rows, N), (rows, N) with every gap between neighbouring bases and tips open."""
    random = np.random.default_rng(seed)
    lengths = np.array([tube.length for tube in robot.tubes])
    beta = np.empty((rows, robot.n_tubes))
    base, tip = np.zeros(rows), np.zeros(rows)
    for i in reversed(range(robot.n_tubes)):
        lowest = tip - lengths[i]
        beta[:, i] = lowest + random.uniform(0.05, 0.95, rows) * (base - lowest)
        base, tip = beta[:, i], beta[:, i] + lengths[i]
    return beta, random.uniform(-np.pi, np.pi, beta.shape)


def random_force(rows: int, seed: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.05, 0.05, (rows, 3))


def pose_of(answer) -> tuple[np.ndarray, np.ndarray]:
    assert answer.solved.all()
    return answer.position, matrix_from_quaternion(answer.quaternion)


def slope(plus, minus, width: float) -> np.ndarray:
    """Derivative (M, 6) between two sets of poses, rows as of a Jacobian."""
    spin = (plus[1] - minus[1]) / width @ (0.5 * (plus[1] + minus[1])).transpose(0, 2, 1)
    turn = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return np.hstack([(plus[0] - minus[0]) / width, turn])
