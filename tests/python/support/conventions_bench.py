"""Sessions of random robots for the tests of conventions: what the tracker reads, written as it should be."""

import numpy as np
from ctcr.model import simulation
from ctcr.robot.description import Actuation, Robot, Tracker, Tube, Uncertainty
from ctcr.table.measurements import Measurements

RUNS, STOPS = 8, 14


def design(random: np.random.Generator, n_tubes: int) -> Robot:
    """A robot of nested tubes, its tracker somewhere and its sensor on the innermost tube."""
    front = np.cumsum(random.uniform(0.035, 0.05, n_tubes))[::-1]  # [m] of each tip in front of the plate at home
    length = front + np.cumsum(random.uniform(0.09, 0.13, n_tubes))[::-1]
    inner = 0.9 + 0.45 * np.arange(n_tubes)
    tubes = [
        Tube(
            youngs_modulus_GPa=random.uniform(50, 70),
            poisson_ratio=0.3,
            density_kg_m3=6450.0,
            inner_diameter_mm=inner[i],
            outer_diameter_mm=inner[i] + 0.3,
            length_mm=1e3 * length[i],
            curved_length_mm=random.uniform(30, 45),
            curvature_per_m=random.uniform(8, 12) / (1 + i),
        )
        for i in range(n_tubes)
    ]
    turn = random.normal(size=3)
    return Robot(
        name="random",
        gravity=[0.0, -9.80665, 0.0],
        tubes=tubes,
        actuation=Actuation(
            translation_mm_per_rev=2.0,
            rotation_rev_per_rev=1.0,
            home_translation_mm=(1e3 * (front - length)).tolist(),
            home_rotation_deg=[0.0] * n_tubes,
        ),
        tracker=Tracker(
            sensor_on_tube=1,
            rate_Hz=40.0,
            jitter_mm=0.05,
            jitter_deg=0.05,
            accuracy_95_mm=0.88,
            accuracy_95_deg=0.48,
            position_mm=random.uniform(-150, 150, 3).tolist(),
            rotation_vector_rad=(random.uniform(1, 2.5) * turn / np.linalg.norm(turn)).tolist(),
        ),
        uncertainty=Uncertainty(
            tracker_frame_mm=0.5,
            tracker_frame_deg=0.3,
            rotation_offset_deg=1.0,
            translation_offset_mm=1.0,
            length_mm=1.0,
            curved_length_mm=2.5,
            curvature_percent=5.0,
            youngs_modulus_percent=15.0,
        ),
    )


def session(
    robot: Robot,
    random: np.random.Generator,
    noise: str = "jitter",
    hidden=None,
    runs: int = RUNS,
    stops: int = STOPS,
    weight: float = 0.1,
) -> Measurements:
    """Readings of a robot that differs from its description as real ones do, along straight lines out and back.

    `hidden`: a function of the robot as built that gives it effects. `weight` [N] hangs in every second run.
    """
    n, rows = robot.n_tubes, []
    home = 1e-3 * np.array(robot.actuation.home_translation_mm)
    retraction = 0.03 * np.linspace(1.0, 0.6, n)
    for run in range(runs):
        ends = [np.r_[home - random.uniform(0.1, 1) * retraction, random.uniform(-np.pi, np.pi, n)] for _ in range(2)]
        part = 1 - abs(1 - 2 * np.linspace(0, 1, stops))
        hung = [0.0, -weight * (run % 2), 0.0]
        rows += [[run, *(ends[0] + k * (ends[1] - ends[0])), *hung] for k in part]
    table = np.array(rows)
    beta, alpha, force = np.split(table[:, 1:], [n, 2 * n], axis=1)
    t, run = 2.0 * np.arange(len(table)), table[:, 0].astype(np.int64)
    plan = Measurements.of_joints(beta, alpha, t=t, run=run, force=force)
    built = simulation.as_built(robot, random)
    built.actuation.recorded_home_translation_mm = robot.actuation.home_translation_mm
    built.actuation.recorded_home_rotation_deg = robot.actuation.home_rotation_deg
    seed = int(random.integers(2**31))
    return simulation.simulate(hidden(built) if hidden else built, plan, noise, seed)
