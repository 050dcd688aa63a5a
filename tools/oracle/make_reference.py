"""Reference poses in tests/data/reference: robots, joints and loads chosen to reach every case the model must handle.

Run from anywhere: python tools/oracle/make_reference.py (one minute on one core).
"""

from pathlib import Path

import numpy as np
from energy import Energy, Load
from equilibrium import minimise, solve_pose, tip_pose
from grid import make_grid
from robot import Robot, from_description
from tables import pose_fields, write_robot, write_table

OUTPUT = Path(__file__).resolve().parents[2] / "tests" / "data" / "reference"
WEIGHT = [3.0, -8.6, 3.6]  # [m/s^2] not along an axis, so that a wrong frame shows

# inner diameter, outer diameter, length, curved length [mm], curvature [1/m]
DESIGNS = {
    "one_tube": [(1.0, 1.4, 250.0, 80.0, 12.0)],
    "two_tubes": [(0.6, 0.9, 300.0, 60.0, 12.0), (1.0, 1.3, 180.0, 180.0, 6.0)],
    "table2": [(1.3, 1.52, 463.0, 50.0, 10.0), (1.62, 1.8, 330.5, 50.0, 5.0), (2.03, 2.35, 199.0, 50.0, 7.0)],
    "straight_sheath": [(0.8, 1.0, 400.0, 50.0, 14.0), (1.1, 1.5, 280.0, 60.0, 7.0), (1.6, 2.4, 150.0, 0.0, 0.0)],
    "four_tubes": [
        (0.7, 0.9, 420.0, 40.0, 12.0),
        (1.0, 1.25, 320.0, 50.0, 6.0),
        (1.35, 1.7, 230.0, 45.0, 5.0),
        (1.8, 2.3, 140.0, 60.0, 0.0),
    ],
}
# how many rows with (no tip load, force, force and moment), without and with weight
ROWS = {False: (26, 8, 8), True: (4, 3, 3)}
LARGEST_TURN = 0.5  # [rad] tip loads bend a straight robot of that length by at most about this
JOINT_CASES = (
    "any",
    "any",
    "flush tips",
    "shared breakpoint",
    "flush with the plate",
    "curved start at the plate",
    "grasped in the plate",
)


# A pose in the base frame needs none of these, but the file format wants them: drives and tracker are perfect.
ACTUATION = {"translation_mm_per_rev": 1.0, "rotation_rev_per_rev": 1.0}
TRACKER = {
    "sensor_on_tube": 1,
    "rate_Hz": None,
    "jitter_mm": 0.0,
    "jitter_deg": 0.0,
    "accuracy_95_mm": 0.0,
    "accuracy_95_deg": 0.0,
    "position_mm": [0.0] * 3,
    "rotation_vector_rad": [0.0] * 3,
}
UNCERTAINTY = dict.fromkeys(
    (
        "tracker_frame_mm",
        "tracker_frame_deg",
        "rotation_offset_deg",
        "translation_offset_mm",
        "length_mm",
        "curved_length_mm",
        "curvature_percent",
        "youngs_modulus_percent",
    ),
    0.0,
)


def describe(name: str, gravity: list[float]) -> dict:
    """Content of the robot.yaml."""
    keys = ("inner_diameter_mm", "outer_diameter_mm", "length_mm", "curved_length_mm", "curvature_per_m")
    material = {"youngs_modulus_GPa": 58.0, "poisson_ratio": 0.3, "density_kg_m3": 6450.0}
    tubes = DESIGNS[name.removesuffix("_weight")]
    home = {"home_translation_mm": [-tube[2] for tube in tubes], "home_rotation_deg": [0.0 for _ in tubes]}
    return {
        "name": name,
        "gravity": gravity,
        "tubes": [material | dict(zip(keys, tube, strict=True)) for tube in tubes],
        "actuation": ACTUATION | home,
        "tracker": TRACKER,
        "uncertainty": UNCERTAINTY,
    }


def draw_joints(robot: Robot, case: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Valid (beta, alpha) of one of the JOINT_CASES; lengths in whole micrometres so that coincidences are exact."""
    length = np.array([tube.length for tube in robot.tubes])
    curved_length = np.array([tube.curved_length for tube in robot.tubes])
    while True:
        tip = np.sort(rng.uniform(0.01, 0.16, length.size))[::-1].round(6)
        i, j = rng.integers(length.size, size=2)
        if case == "flush tips":
            tip[min(i, j) : max(i, j) + 1] = tip[min(i, j)]
        elif case == "shared breakpoint":
            tip[i] = tip[j] + curved_length[i]
        elif case == "flush with the plate":
            tip[max(i, 1) :] = 0.0
        elif case == "curved start at the plate":
            tip[i] = curved_length[i]
        elif case == "grasped in the plate":
            tip[-1] = length[-1]
            tip[:-1] += length[-1]
        beta = (tip - length).round(6)
        if tip[0] > 0.01 and np.all(np.diff(tip) <= 0) and np.all(np.diff(beta) >= 0) and beta[-1] <= 0:
            return beta, rng.uniform(-np.pi, np.pi, length.size).round(6)


def draw_load(robot: Robot, beta: np.ndarray, kind: int, rng: np.random.Generator) -> Load:
    """No load (0), force (1), force and moment (2), scaled to the stiffness of the innermost tube."""
    reach = robot.tubes[0].length + beta[0]
    direction = rng.normal(size=(2, 3))
    direction *= rng.uniform(0.2, 1.0, (2, 1)) / np.linalg.norm(direction, axis=1, keepdims=True)
    stiffness = LARGEST_TURN * robot.tubes[0].bending_stiffness / reach
    force, moment = direction[0] * 2 * stiffness / reach, direction[1] * stiffness
    return Load(force.round(6) * (kind > 0), moment.round(8) * (kind > 1))


def is_unique(robot: Robot, beta: np.ndarray, alpha: np.ndarray, load: Load, rng: np.random.Generator) -> bool:
    """Whether searches from scattered starts end in one equilibrium: a bistable robot has no single right pose."""
    energy = Energy(robot, make_grid(robot, beta, 5e-3), beta, alpha, load.force)
    tips = []
    for start in range(6):
        x = energy.initial_guess()
        if start:
            for i in range(alpha.size):
                energy.theta(x, i)[:] += rng.uniform(-np.pi, np.pi)
        tips.append(tip_pose(energy, minimise(energy, x), 0).position)
    return bool(np.ptp(tips, axis=0).max() < 1e-7)


def make_rows(robot: Robot, kind: int, count: int, rng: np.random.Generator) -> tuple[list[list[float]], float]:
    """Rows (joints, force, moment, pose), and the largest distance between the two finest extrapolations [m]."""
    rows, worst = [], 0.0
    while len(rows) < count:
        beta, alpha = draw_joints(robot, JOINT_CASES[len(rows) % len(JOINT_CASES)], rng)
        load = draw_load(robot, beta, kind, rng)
        if not is_unique(robot, beta, alpha, load, rng):
            continue
        pose = solve_pose(robot, beta, alpha, load)
        coarser = solve_pose(robot, beta, alpha, load, refinements=(1, 2))
        worst = max(worst, float(np.linalg.norm(pose.position - coarser.position)))
        rows.append([*beta, *alpha, *load.force, *load.moment, *pose_fields(pose.position, pose.rotation)])
    return rows, worst


def without_moment(rows: list[list[float]], n_tubes: int) -> list[list[float]]:
    """The rows in the format of measurements, which knows no tip moment."""
    first = 2 * n_tubes + 3
    return [row[:first] + row[first + 3 :] for row in rows]


def main() -> None:
    for design in DESIGNS:
        for weight in (False, True):
            name = design + "_weight" * weight
            description = describe(name, WEIGHT if weight else [0.0, 0.0, 0.0])
            robot, rng = from_description(description), np.random.default_rng([len(design), weight])
            n_tubes = len(robot.tubes)
            rows, worst = zip(*(make_rows(robot, kind, n, rng) for kind, n in enumerate(ROWS[weight])), strict=True)
            write_robot(OUTPUT / name / "robot.yaml", description)
            write_table(OUTPUT / name / "poses.csv", without_moment(rows[0] + rows[1], n_tubes), n_tubes, ("force",))
            write_table(OUTPUT / name / "moment_poses.csv", rows[2], n_tubes, ("force", "moment"))
            print(f"{name}: {sum(ROWS[weight])} poses, extrapolations within {1e6 * max(worst):.4f} micrometres")


if __name__ == "__main__":
    main()
