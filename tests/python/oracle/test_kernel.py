"""The fast energy is the slow one, its derivatives are exact, what dissipates lags."""

from pathlib import Path

import make_reference
import numpy as np
import pytest
from benches import describe
from energy import Energy
from friction import FrictionalRobot, FrictionLaw
from grid import make_grid
from kernel import Problem
from mechanics import Joint, Mechanics, Yielding, configure
from numpy.testing import assert_allclose
from robot import from_description, load
from scipy.spatial.transform import Rotation
from session import ELEMENT_LENGTH
from specimen import Specimen, small_moves

ROOT = Path(__file__).parents[3]

STORED = sorted((ROOT / "tests" / "data" / "reference").glob("*/poses.csv"))
SHARED = ROOT.parent / "shared" / "data" / "reference"
NOTHING = np.zeros(3)


def read_columns(path: Path) -> dict[str, np.ndarray]:
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


def assert_poses(robot_file: Path, table: Path, *, metres: float, radians: float, every: int):
    robot, columns = load(robot_file), read_columns(table)
    tubes = range(1, len(robot.tubes) + 1)

    def pick(*names: str) -> np.ndarray:
        return np.stack([columns.get(name, np.zeros(len(columns["x_m"]))) for name in names], axis=1)[::every]

    specimen = Specimen(Mechanics(robot), ELEMENT_LENGTH)
    joints = pick(*(f"beta{i}_m" for i in tubes)), pick(*(f"alpha{i}_rad" for i in tubes))
    for beta, alpha, force, place, turn in zip(
        *joints, pick("fx_N", "fy_N", "fz_N"), pick("x_m", "y_m", "z_m"), pick("qw", "qx", "qy", "qz"), strict=True
    ):
        pose = specimen.settle(beta, alpha, force)
        assert np.linalg.norm(pose.position - place) < metres
        error = Rotation.from_matrix(pose.rotation) * Rotation.from_quat(turn, scalar_first=True).inv()
        assert error.magnitude() < radians


@pytest.mark.parametrize("table", STORED, ids=lambda path: path.parent.name)
def test_stored_reference(table):
    """The poses of a session agree with the stored reference: errors of hundreds of readings must not add up."""
    assert_poses(table.parent / "robot.yaml", table, metres=1e-7, radians=1e-6, every=5)


@pytest.mark.parametrize("name", ["table2", "robot_b"])
def test_shared_reference(name):
    """The poses of a session agree with the shared reference."""
    if not SHARED.is_dir():
        pytest.skip("the shared reference poses are not here")
    assert_poses(SHARED / f"{name}.yaml", SHARED / f"{name}_poses.csv", metres=1e-7, radians=1e-6, every=5)


def test_slow_energy():
    """The fast energy of the standard robot equals the slow one."""
    robot = from_description(make_reference.describe("table2", [1.0, -9.0, 2.0]))
    beta, alpha, force = (np.array([-0.33, -0.235, -0.16]), np.array([0.3, -1.0, 2.0]), np.array([0.02, 0.1, -0.05]))
    grid = make_grid(robot, beta, 6e-3)
    slow = Energy(robot, grid, beta, alpha, force)
    fast = configure(Mechanics(robot), beta, alpha, 6e-3).problem(force)
    rng, values = np.random.default_rng(1), []
    for _ in range(3):
        x = slow.initial_guess() + rng.normal(0, 0.4, slow.size)
        y = x.copy()
        fast.rotation_vectors(y)[:] = grid.h[:, None] * slow.curvature(x)
        value, gradient, _ = fast.energy(y)
        values.append(value - slow.value(x))  # the slow one leaves a constant out
        fast.rotation_vectors(gradient)[:] *= grid.h[:, None]
        assert_allclose(gradient, slow.gradient(x), rtol=0, atol=1e-12)
    assert np.ptp(values) < 1e-13


def everything(seed: int) -> tuple[Problem, np.ndarray]:
    """A small problem with every kind of term (odd seeds: sections that soften), and a place in its unknowns."""
    rng, robot = np.random.default_rng(seed), from_description(describe("two_tubes"))
    mechanics = Mechanics(
        robot,
        ellipticity=None if seed % 2 else rng.uniform(-0.1, 0.1, (2, 2)),
        tangent=np.linspace(1.0, 0.4, 41) * np.ones((2, 1)) if seed % 2 else None,
        table_step=0.7,
        drive_compliance=np.array([3.0, 1.0]),
        drive_hardening=200.0,
        entry=Joint(stiffness=2.0, arm=0.01),
        sleeve={1: Joint(stiffness=50.0, centring=0.2, gap=0.01)},
        obstacle=np.array([[0.02, 0.0, 0.1, 0.05, 2e3]]),
        yielding=Yielding(0.3, 2.0),
    )
    here = configure(mechanics, np.array([-0.25, -0.16]), np.array([0.4, -1.5]), 0.02)
    inner = 2 * here.h.size
    outer = inner + here.tip_node[0] + 1
    contact = {
        "contact_node": np.array([[inner, outer], [inner + 2, outer + 2]]),
        "contact": np.array([[0.02, 0.1, 0.0, 0.0, 0.3], [1.0, 0.1, 0.2, 0.1, 0.0]]),
        "plastic_anchor": rng.normal(0, 2, (2, here.h.size, 2)),
    }
    problem = here.problem(np.array([0.1, -0.1, 0.05]), **contact)
    x = problem.minimise(np.zeros(problem.size))
    return problem, x + rng.normal(0, 0.02, x.size)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives(seed):
    """Derivatives of every term agree with differences."""
    problem, x = everything(seed)
    _, gradient, hessian = problem.energy(x)
    steps = 1e-6 * np.eye(x.size)
    slope = [(problem.energy(x + d)[0] - problem.energy(x - d)[0]) / 2e-6 for d in steps]
    assert_allclose(gradient, slope, rtol=0, atol=1e-6 * np.max(np.abs(gradient)))
    curvature = [(problem.energy(x + d)[1] - problem.energy(x - d)[1]) / 2e-6 for d in steps]
    # the work of loads leaves out terms of the order of the squared turn of one element, the obstacle its roundness
    assert_allclose(hessian, curvature, rtol=0, atol=2e-3 * np.max(np.abs(hessian)))


def test_minimum():
    """At the minimum the gradient vanishes and the Hessian is positive definite."""
    problem, x = everything(7)
    _, gradient, hessian = problem.energy(problem.minimise(x))
    assert np.max(np.abs(gradient)) < 1e-9
    assert np.linalg.eigvalsh(hessian)[0] > 0


def walk(mechanics: Mechanics, corners: list[np.ndarray]) -> list[Rotation]:
    """Tip rotations at the corners after the first, reached in small moves."""
    specimen, n = Specimen(mechanics, 8e-3, refinements=(1,)), corners[0].size // 2
    pose = specimen.settle(*np.split(corners[0], 2), NOTHING)
    reached = []
    for start, end in zip(corners[:-1], corners[1:], strict=True):
        for move in small_moves(start, end):
            pose = specimen.settle(move[:n], move[n:], NOTHING)
        reached.append(Rotation.from_matrix(pose.rotation))
    return reached


def test_friction():
    """Friction in the kernel gives the poses of the slow energy minimisation."""
    robot, law = from_description(describe("two_tubes")), FrictionLaw(0.03, 0.05)
    start, end = np.array([-0.25, -0.16, -0.4, 0.0]), np.array([-0.248, -0.16, -0.1, 0.1])
    slow = FrictionalRobot(robot, law, *np.split(start, 2), 8e-3)
    fast = walk(Mechanics(robot, friction=law), [start, end, start])
    for corner, rotation in zip((end, start), fast, strict=True):
        pose = slow.move_to(*np.split(corner, 2), NOTHING)
        assert (rotation * Rotation.from_matrix(pose.rotation).inv()).magnitude() < 1e-9
    free = walk(Mechanics(robot), [start, end, start])[1]
    assert (fast[1] * free.inv()).magnitude() > 1e-3


@pytest.mark.parametrize("cause", ["friction", "yielding"])
def test_dissipation(cause):
    """Dissipation causes a lag, which vanishes with its size."""
    robot = from_description(describe("two_tubes"))
    corners = [np.array([-0.25, -0.16, angle, 0.0]) for angle in (-0.4, 0.8, 1.8, 0.8)]

    def middle_visits(size: float) -> tuple[Rotation, Rotation]:
        mechanics = Mechanics(robot)
        if cause == "friction":
            mechanics.friction = FrictionLaw(0.05 * size, 0.05)
        else:
            mechanics.yielding = Yielding(0.4 * size, 1.0)
        forward, _, back = walk(mechanics, corners)
        return forward, back

    free = walk(Mechanics(robot), corners[:2])[0]
    for visit in middle_visits(0.0):
        assert (visit * free.inv()).magnitude() < 1e-7
    axis = free.as_matrix()[:, 2]
    forward, back = ((visit * free.inv()).as_rotvec() @ axis for visit in middle_visits(1.0))
    assert forward < back - 1e-3  # turning forward the tip is behind the tip turning back
    if cause == "friction":
        assert forward < 0 < back
