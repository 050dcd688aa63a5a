"""The tables in examples/data/calibration: one new robot as its data sheet says, and all that is measured of it.

Run from anywhere: python tools/oracle/make_calibration.py (ten seconds; the seed is fixed). The bench is off its data
sheet by 0.7 of the stated uncertainties and has no hidden effect. Tables are written as a person would: mm and deg.
"""

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path

import numpy as np
from energy import Load
from equilibrium import Pose, solve_pose
from make_demo import draw_runs
from robot import from_description, read_description
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from simulate import DWELL, Bench, Tracker, approach_time, draw_bench
from tables import pose_fields, write_robot, write_table

ROOT = Path(__file__).resolve().parents[2]
SOURCE, OUTPUT = ROOT / "examples" / "robots" / "table2.yaml", ROOT / "examples" / "data" / "calibration"
SEED = 7
DRAG = np.deg2rad(0.3)  # a tube that turns alone lags this far behind its motor
STEP = 20.0  # [deg] between the readings of a circle
DEPLOYED = 0.09  # [m] of the tube on a circle
POINTS = {  # [mm] in the base frame: holes of the base plate, and the tool's way as target
    "A": (-60, -40, -20),
    "B": (60, -40, -20),
    "C": (60, 40, -20),
    "D": (-60, 40, -20),
    "E": (-60, -40, -180),
    "F": (60, -40, -180),
    "G": (60, 40, -180),
    "H": (-60, 40, -180),
    "tool": (0, 0, 150),
}
READ_EACH, PLACEMENT = (3, 0.1e-3)  # probe readings of a point; how far the probe's tip sits from it, per axis [m]
HAND, FLUSH = 0.6e-3, 0.15e-3  # [m] a ruler; a tip brought flush with the plate
CANTILEVER_LENGTH, HUNG = 0.080, (5, 10, 20, 30, 40, 50)  # [m] of tube 1; [g]
DIAL = 0.03e-3  # [m] of a deflection
PIXELS, CLICK = 12.0e3, 1.2  # per metre; standard deviation of a clicked point


def circles(bench: Bench, tracker: Tracker, ratio: float, rng: np.random.Generator) -> Iterator[list[str]]:
    """Each tube alone, turned forward and back."""
    forward = np.arange(0, 360 + STEP / 2, STEP)
    for number, tube in enumerate(from_description(bench.description).tubes, start=1):
        bend = tube.curvature * tube.curved_length
        straight = DEPLOYED - tube.curved_length
        side, height = (1 - np.cos(bend)) / tube.curvature, straight + np.sin(bend) / tube.curvature
        for direction, angles in ((1, forward), (-1, forward[::-1])):
            for angle in angles:
                alpha = ratio * np.deg2rad(angle) + bench.alpha_offset[number - 1] - DRAG * direction * np.sign(ratio)
                turn = Rotation.from_euler("z", alpha)
                pose = Pose(turn.apply([0, -side, height]), (turn * Rotation.from_euler("x", bend)).as_matrix())
                yield [str(number), f"{angle:g}", str(direction), *_mm(tracker.read(pose)[0])]


def points(bench: Bench, tracker: Tracker, rng: np.random.Generator) -> Iterator[list[str]]:
    """Named points read with the probe, and one that cannot be read."""
    for name, cad in POINTS.items():
        place = 1e-3 * np.array(cad) + rng.normal(0, PLACEMENT, 3)
        for _ in range(READ_EACH if name != "tool" else 1):
            reading = _mm(tracker.read(Pose(place, np.eye(3)))[0]) if name != "tool" else ["", "", ""]
            yield [name, *map(str, cad), *reading]


def home(bench: Bench, description: dict, rng: np.random.Generator) -> Iterator[list[str]]:
    """Distances by ruler, twice, and the motor turns that bring each tip flush with the plate."""
    actuation = description["actuation"]
    beta = 1e-3 * np.array(actuation["home_translation_mm"]) + bench.beta_offset
    for number, tube in enumerate(from_description(bench.description).tubes, start=1):
        turns = -(tube.length + beta[number - 1]) / (1e-3 * actuation["translation_mm_per_rev"])
        for _ in range(2):
            distance = 1e3 * (-beta[number - 1] + rng.normal(0, HAND))
            flush = turns + rng.normal(0, FLUSH) / (1e-3 * actuation["translation_mm_per_rev"])
            yield [str(number), f"{distance:.1f}", f"{flush:.3f}"]


def cantilever(bench: Bench, rng: np.random.Generator) -> Iterator[list[str]]:
    """Masses hung from the end of a straight piece of tube 1, clamped level."""
    stiffness = from_description(bench.description).tubes[0].bending_stiffness

    def end(force: float, slope: float) -> np.ndarray:
        """(angle, curvature, x, y) at the free end of a beam that leaves the clamp with curvature `slope`."""
        beam = lambda _, y: [y[1], -force / stiffness * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]  # noqa: E731
        return solve_ivp(beam, (0, CANTILEVER_LENGTH), [0, slope, 0, 0], rtol=1e-10, atol=1e-12).y[:, -1]

    for mass in HUNG:
        force = 9.80665e-3 * mass
        slope = brentq(lambda k, force=force: end(force, k)[1], 0, 2 * force * CANTILEVER_LENGTH / stiffness)
        deflection = end(force, slope)[3] + rng.normal(0, DIAL)
        yield [str(mass), f"{1e3 * deflection:.3f}", f"{1e3 * CANTILEVER_LENGTH:.1f}"]


def picture(bench: Bench, rng: np.random.Generator) -> Iterator[list[str]]:
    """Clicked points along the photograph of tube 2, lying askew."""
    tube = from_description(bench.description).tubes[1]
    for s in np.concatenate([np.linspace(-0.07, 0, 15)[:-1], np.linspace(0, tube.curved_length, 22)]):
        bent = tube.curvature * max(s, 0.0)
        place = np.array([np.sin(bent) / tube.curvature + min(s, 0.0), (1 - np.cos(bent)) / tube.curvature])
        askew = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
        yield [f"{value:.1f}" for value in PIXELS * (askew @ place) + [1100, 300] + rng.normal(0, CLICK, 2)]


def poses(description: dict, bench: Bench, tracker: Tracker, rng: np.random.Generator) -> Iterator[list[float]]:
    """Rows (t, run, joints, force, pose) of a session; joints as the data sheet's homes give them."""
    true, time, n = from_description(bench.description), 0.0, len(description["tubes"])
    joints = np.concatenate([1e-3 * np.array(description["actuation"]["home_translation_mm"]), np.zeros(n)])
    for number, run in enumerate(draw_runs(description, rng)[:12]):
        for visit, target in enumerate(run.stops[::2]):
            time += DWELL if visit else approach_time(joints, target)
            beta, alpha = target[:n] + bench.beta_offset, target[n:] + bench.alpha_offset
            pose = solve_pose(true, beta, alpha, Load(run.mass * true.gravity, np.zeros(3)), refinements=(1, 2))
            yield [time, number, *target, *(run.mass * true.gravity), *pose_fields(*tracker.read(pose))]
            joints = target


def main() -> None:
    description = deepcopy(read_description(SOURCE)) | {"name": "new robot"}
    rng = np.random.default_rng(SEED)
    bench = draw_bench(description, rng)
    tracker = Tracker(description, bench, rng)
    ratio = description["actuation"]["rotation_rev_per_rev"]
    write_robot(OUTPUT / "robot.yaml", description)
    for name, header, rows in (
        ("circles", "tube,motor_angle_deg,direction,x_mm,y_mm,z_mm", circles(bench, tracker, ratio, rng)),
        ("points", "point,cad_x_mm,cad_y_mm,cad_z_mm,x_mm,y_mm,z_mm", points(bench, tracker, rng)),
        ("home", "tube,distance_mm,flush_angle_rev", home(bench, description, rng)),
        ("cantilever", "load_g,deflection_mm,free_length_mm", cantilever(bench, rng)),
        ("picture", "x_px,y_px", picture(bench, rng)),
    ):
        text = "\n".join([header, *(",".join(row) for row in rows)])
        (OUTPUT / f"{name}.csv").write_text(text + "\n", encoding="utf-8")
    rows = poses(description, bench, tracker, rng)
    write_table(OUTPUT / "measurements.csv", rows, len(description["tubes"]), ("force",), ("t_s", "run"))
    print(bench)


def _mm(position: np.ndarray) -> list[str]:
    return [f"{1e3 * value:.3f}" for value in position]


if __name__ == "__main__":
    main()
