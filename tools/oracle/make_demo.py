"""The demonstration set in examples/data/demo: a bench measured with a hidden effect, dry friction between the tubes.

Run from anywhere: python tools/oracle/make_demo.py (two minutes on one core; the seed is fixed).
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from friction import FrictionalRobot, FrictionLaw
from robot import from_description, read_description
from simulate import DWELL, Run, Tracker, approach_time, draw_bench
from tables import pose_fields, write_robot, write_table

ROOT = Path(__file__).resolve().parents[2]
SOURCE, OUTPUT = ROOT / "examples" / "robots" / "table2.yaml", ROOT / "examples" / "data" / "demo"
LAW = FrictionLaw(coefficient=0.006, contact_stiffness=0.1)
SEED = 2024
RUNS, STOPS = 14, 20
MASSES = (0.0, 0.010, 0.020)  # [kg]
ELEMENT_LENGTH = 4e-3  # [m], one grid: tip error of micrometres, far below the jitter
LARGEST_RETRACTION = np.array([0.060, 0.045, 0.045])  # [m] from the home position
MARGIN = 5e-3  # [m] kept between the bases and between the tips, more than the true lengths and offsets can be off


def draw_runs(description: dict, rng: np.random.Generator) -> list[Run]:
    """Straight lines between random joints; two runs of three only rotate, the third also translates."""
    home = 1e-3 * np.array(description["actuation"]["home_translation_mm"])
    length = 1e-3 * np.array([tube["length_mm"] for tube in description["tubes"]])

    def draw_beta() -> np.ndarray:
        while True:
            beta = home - rng.uniform(0, 1, 3) * LARGEST_RETRACTION
            if np.all(np.diff(beta) > MARGIN) and np.all(np.diff(length + beta) < -MARGIN):
                return beta

    runs = []
    for k in range(RUNS):
        beta, alpha = draw_beta(), rng.uniform(-np.pi, np.pi, 3)
        end_beta = draw_beta() if k % 3 == 2 else beta
        end_alpha = alpha - np.sign(alpha) * np.deg2rad(rng.uniform(40, 160, 3))  # stays within half a turn
        start, end = np.concatenate([beta, alpha]), np.concatenate([end_beta, end_alpha])
        stops = start + np.linspace(0, 1, STOPS)[:, None] * (end - start)
        runs.append(Run(stops.round(9), MASSES[k // 2 % len(MASSES)]))
    return runs


def measure(description: dict) -> Iterator[list[float]]:
    """Rows (t, run, joints, force, pose in the tracker frame) of the session, which starts at rest at home."""
    rng = np.random.default_rng(SEED)
    runs, bench = draw_runs(description, rng), draw_bench(description, rng)
    tracker = Tracker(description, bench, rng)
    offset = np.concatenate([bench.beta_offset, bench.alpha_offset])
    joints = np.concatenate(
        [
            1e-3 * np.array(description["actuation"]["home_translation_mm"]),
            np.deg2rad(description["actuation"]["home_rotation_deg"]),
        ]
    )
    true = from_description(bench.description)
    robot = FrictionalRobot(true, LAW, *np.split(joints + offset, 2), ELEMENT_LENGTH)
    time = 0.0
    for number, run in enumerate(runs):
        force = run.mass * true.gravity
        for visit, target in enumerate(run.visits()):
            time += DWELL if 0 < visit < 2 * STOPS - 1 else approach_time(joints, target)
            pose = robot.move_to(*np.split(target + offset, 2), force)
            yield [time, number, *target, *force, *pose_fields(*tracker.read(pose))]
            joints = target


def main() -> None:
    description = read_description(SOURCE) | {"name": "demo"}
    write_robot(OUTPUT / "robot.yaml", description)
    write_table(OUTPUT / "measurements.csv", measure(description), 3, ("force",), ("t_s", "run"))


if __name__ == "__main__":
    main()
