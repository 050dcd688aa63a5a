"""The oracle obeys closed forms and symmetries, its derivatives are exact, the stored data are its own."""

import csv
from itertools import islice
from pathlib import Path

import make_demo
import make_reference
import numpy as np
import pytest
from energy import Energy, Load
from equilibrium import solve_pose
from friction import Contacts, FrictionalRobot, FrictionLaw
from grid import make_grid
from numpy.testing import assert_allclose
from robot import Robot, from_description, load, read_description
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parents[3]

REFERENCE = ROOT / "tests" / "data" / "reference"
SHARED = ROOT.parent / "shared" / "data" / "reference"
NOTHING, E1, E2, E3 = np.zeros(3), *np.eye(3)
CASES = range(4)


def design(name: str, gravity: np.ndarray = NOTHING) -> Robot:
    return from_description(make_reference.describe(name, list(gravity)))


def random_case(name: str, seed: int) -> tuple[Robot, np.ndarray, np.ndarray, Load]:
    """Robot with weight, joints and a tip load with force and moment."""
    rng = np.random.default_rng(seed)
    robot = design(name, rng.normal(0, 6, 3))
    beta, alpha = make_reference.draw_joints(robot, "any", rng)
    return robot, beta, alpha, make_reference.draw_load(robot, beta, 2, rng)


def straight_tube(gravity: np.ndarray = NOTHING) -> Robot:
    description = make_reference.describe("one_tube", list(gravity))
    description["tubes"][0]["curvature_per_m"] = 0.0
    return from_description(description)


def assert_pose(pose, position, rotation, *, metres=1e-9, radians=1e-9):
    assert_allclose(pose.position, position, rtol=0, atol=metres)
    assert (Rotation.from_matrix(pose.rotation) * Rotation.from_matrix(rotation).inv()).magnitude() < radians


@pytest.mark.parametrize("case", CASES)
def test_single_tube(case):
    """A single tube is a line and an arc that bends about its x axis."""
    robot, rng = design("one_tube"), np.random.default_rng(case)
    tube = robot.tubes[0]
    reach, alpha = rng.uniform(0.01, 0.2), rng.uniform(-3, 3)
    arc = min(reach, tube.curved_length)
    turn = tube.curvature * arc
    in_plane = np.array([0, -(1 - np.cos(turn)), np.sin(turn)]) / tube.curvature + (reach - arc) * E3
    base = Rotation.from_rotvec(alpha * E3)
    pose = solve_pose(robot, np.array([reach - tube.length]), np.array([alpha]))
    assert_pose(pose, base.apply(in_plane), (base * Rotation.from_rotvec(turn * E1)).as_matrix())


def test_straight_tube():
    """A straight tube under a moment is an arc with uniform twist."""
    robot, reach = straight_tube(), 0.12
    tube, beta = robot.tubes[0], np.array([reach - robot.tubes[0].length])
    bent = solve_pose(robot, beta, np.zeros(1), Load(NOTHING, 0.02 * E2))
    turn = 0.02 / tube.bending_stiffness * reach
    arc = reach / turn * np.array([1 - np.cos(turn), 0, np.sin(turn)])
    assert_pose(bent, arc, Rotation.from_rotvec(turn * E2).as_matrix())
    twisted = solve_pose(robot, beta, np.zeros(1), Load(NOTHING, 0.002 * E3))
    whole_length = 0.002 / tube.torsional_stiffness * tube.length  # behind the plate too
    assert_pose(twisted, reach * E3, Rotation.from_rotvec(whole_length * E3).as_matrix())


def test_small_loads():
    """A small force or weight bends a straight tube like a cantilever."""
    reach, small = 0.1, 1e-4
    robot = straight_tube(small * E1)
    tube, beta = robot.tubes[0], np.array([reach - robot.tubes[0].length])
    by_force = solve_pose(robot, beta, np.zeros(1), Load(small * E2, NOTHING)).position[1]
    assert by_force == pytest.approx(small * reach**3 / (3 * tube.bending_stiffness), rel=1e-6)
    by_weight = solve_pose(robot, beta, np.zeros(1)).position[0]
    assert by_weight == pytest.approx(small * tube.mass_per_length * reach**4 / (8 * tube.bending_stiffness), rel=1e-6)


@pytest.mark.parametrize("name", make_reference.DESIGNS)
def test_derivatives(name):
    """Gradient and Hessian of the energy agree with differences."""
    robot, beta, alpha, tip_load = random_case(name, 1)
    energy = Energy(robot, make_grid(robot, beta, 0.02), beta, alpha, tip_load.force)
    x = energy.initial_guess() + np.random.default_rng(2).normal(0, 0.5, energy.size)
    complex_step = 1e-30j * np.eye(energy.size)
    gradient = [energy.value(x + step).imag / 1e-30 for step in complex_step]
    hessian = [energy.gradient(x + step).imag / 1e-30 for step in complex_step]
    assert_allclose(energy.gradient(x), gradient, rtol=0, atol=1e-13 * np.max(np.abs(gradient)))
    assert_allclose(energy.hessian(x), hessian, rtol=0, atol=1e-6 * np.max(np.abs(hessian)))


def test_moment():
    """The generalised force of a moment is its work on the rotation of the tip."""
    robot, beta, alpha, tip_load = random_case("two_tubes", 3)
    energy = Energy(robot, make_grid(robot, beta, 0.02), beta, alpha, NOTHING)
    x = energy.initial_guess() + np.random.default_rng(4).normal(0, 0.5, energy.size)
    force, stiffness = energy.moment_residual(x, tip_load.moment)

    def tip(y: np.ndarray) -> Rotation:
        turn = Rotation.from_rotvec(energy.theta(y, 0)[-1] * E3)
        return Rotation.from_matrix(energy.backbone(y).rotation[-1]) * turn

    steps = 1e-5 * np.eye(energy.size)
    work = [(tip(x + d) * tip(x - d).inv()).as_rotvec() @ tip_load.moment / 2e-5 for d in steps]
    assert_allclose(force, work, rtol=0, atol=1e-8 * np.max(np.abs(force)))
    slope = [
        (energy.moment_residual(x + d, tip_load.moment)[0] - energy.moment_residual(x - d, tip_load.moment)[0]) / 2e-5
        for d in steps
    ]
    assert_allclose(stiffness, np.transpose(slope), rtol=0, atol=2e-3 * np.max(np.abs(stiffness)))


@pytest.mark.parametrize("name", make_reference.DESIGNS)
def test_rotation(name):
    """A rotation of everything about the insertion axis rotates the pose."""
    robot, beta, alpha, tip_load = random_case(name, 5)
    turn = Rotation.from_rotvec(0.7 * E3)
    turned_load = Load(turn.apply(tip_load.force), turn.apply(tip_load.moment))
    pose = solve_pose(robot, beta, alpha, tip_load)
    turned = solve_pose(Robot(robot.tubes, turn.apply(robot.gravity)), beta, alpha + 0.7, turned_load)
    assert_pose(turned, turn.apply(pose.position), turn.as_matrix() @ pose.rotation)


def read_poses(path: Path) -> list[dict[str, float]]:
    with path.open(encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def assert_stored_pose(robot: Robot, row: dict[str, float], *, metres: float, radians: float, **grid):
    n = range(1, len(robot.tubes) + 1)

    def pick(*names: str) -> np.ndarray:
        return np.array([row.get(name, 0.0) for name in names])

    beta, alpha = pick(*(f"beta{i}_m" for i in n)), pick(*(f"alpha{i}_rad" for i in n))
    tip_load = Load(pick("fx_N", "fy_N", "fz_N"), pick("mx_Nm", "my_Nm", "mz_Nm"))
    rotation = Rotation.from_quat(pick("qw", "qx", "qy", "qz"), scalar_first=True).as_matrix()
    pose = solve_pose(robot, beta, alpha, tip_load, **grid)
    assert_pose(pose, pick("x_m", "y_m", "z_m"), rotation, metres=metres, radians=radians)


@pytest.mark.parametrize("table", sorted(REFERENCE.glob("*/*poses.csv")), ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_stored_poses(table):
    """Another grid gives the stored poses."""
    robot = load(table.parent / "robot.yaml")
    for row in read_poses(table)[::6]:
        assert_stored_pose(robot, row, metres=3e-7, radians=1e-5, element_length=7e-3, refinements=(1, 2, 3))


@pytest.mark.parametrize("name", ["table2", "robot_b"])
def test_shared_reference(name):
    """The poses agree with the shared reference poses."""
    if not SHARED.is_dir():
        pytest.skip("the shared reference poses are not here")
    robot = load(SHARED / f"{name}.yaml")
    for row in read_poses(SHARED / f"{name}_poses.csv")[:10]:
        assert_stored_pose(robot, row, metres=1e-6, radians=1e-5)


def test_grid():
    """Every breakpoint is a node of the grid; joints out of order are refused."""
    robot = design("four_tubes")
    beta = np.array([-0.3, -0.25, -0.18, -0.11])
    nodes = np.concatenate([[0], np.cumsum(make_grid(robot, beta, 5e-3).h)])
    for tube, b in zip(robot.tubes, beta, strict=True):
        for point in (tube.length + b, max(tube.length + b - tube.curved_length, 0)):
            assert np.min(np.abs(nodes - point)) < 1e-15
    for wrong in (beta[[1, 0, 2, 3]], np.array([-0.3, -0.15, -0.1, -0.05]), beta + 0.2):
        with pytest.raises(ValueError, match="out of order"):
            make_grid(robot, wrong, 5e-3)


def test_contact_forces():
    """Contact forces are the gradient of the incremental energy."""
    rng = np.random.default_rng(6)
    x, n = rng.normal(size=12), 40  # some joints stick, some slip
    contacts = Contacts(
        rng.integers(6, size=n),
        6 + rng.integers(6, size=n),
        rng.uniform(0, 2, n),
        rng.normal(size=(n, 2)),
        rng.normal(size=n),
        1.0,
    )
    gradient, hessian = np.zeros(12), np.zeros((12, 12))
    contacts.add_gradient(x, gradient)
    contacts.add_hessian(x, hessian)
    slope = [(contacts.value(x + d) - contacts.value(x - d)) / 2e-6 for d in 1e-6 * np.eye(12)]
    assert_allclose(gradient, slope, atol=1e-7)

    def gradient_at(y: np.ndarray) -> np.ndarray:
        result = np.zeros(12)
        contacts.add_gradient(y, result)
        return result

    slope = [(gradient_at(x + d) - gradient_at(x - d)) / 2e-6 for d in 1e-6 * np.eye(12)]
    assert_allclose(hessian, slope, atol=1e-6)


def test_friction():
    """The tip lags behind the base, and the lag vanishes with the coefficient."""
    robot, beta = design("two_tubes"), np.array([-0.16, -0.1])
    start, middle, end = (np.array([angle, 0.0]) for angle in (0.2, 0.8, 1.4))

    def visit_twice(coefficient: float) -> list[np.ndarray]:
        moving = FrictionalRobot(robot, FrictionLaw(coefficient, 0.05), beta, start, 8e-3)
        visits = [moving.move_to(beta, stop, NOTHING) for stop in (middle, end, middle)]
        return [visits[0].rotation, visits[2].rotation]

    free = solve_pose(robot, beta, middle, refinements=(1,), element_length=8e-3).rotation
    for rotation in visit_twice(0.0):
        assert_allclose(rotation, free, atol=1e-9)
    forward, back = (Rotation.from_matrix(r @ free.T).as_rotvec() @ free[:, 2] for r in visit_twice(0.003))
    assert forward < -1e-3
    assert back > 1e-3


def test_demonstration():
    """The shipped demonstration is what its program makes."""
    folder = ROOT / "examples" / "data" / "demo"
    stored = read_poses(folder / "measurements.csv")
    for made, row in zip(islice(make_demo.measure(read_description(folder / "robot.yaml")), 1), stored, strict=False):
        assert_allclose(made, list(row.values()), rtol=0, atol=1e-7)
