"""Tubes with centre lines of their own: exact derivatives, tubes that fit, and beams in a bore by hand."""

import benches
import bore
import numpy as np
import pytest
from energy import Load
from equilibrium import solve_pose
from numpy.testing import assert_allclose
from robot import Robot, Tube, from_description

UNLOADED = np.zeros(3)


def random_case(name: str, seed: int) -> tuple[Robot, np.ndarray, np.ndarray, np.ndarray]:
    """Robot, beta, alpha, tip force."""
    description, random = benches.describe(name), np.random.default_rng(seed)
    beta, alpha = np.split(benches.joint_range(description).draw(random), 2)
    return from_description(description), beta, alpha, random.normal(0, 0.1, 3)


@pytest.mark.parametrize("name", benches.ROBOTS)
def test_derivatives(name):
    """The gradient and the Hessian of the energy agree with central differences."""
    robot, beta, alpha, force = random_case(name, 1)
    here = bore.loose(robot, beta, alpha, force, 0.1 * bore.radial_gaps(robot))
    energy = bore.LooseEnergy(here, 1e5)
    random = np.random.default_rng(2)
    x = bore.settle(here) + random.normal(0, 0.1, here.offset[-1])
    way, step = random.normal(size=x.size), 1e-6
    ahead, behind = x + step * way, x - step * way
    slope = (energy.value(ahead) - energy.value(behind)) / (2 * step)
    assert_allclose(energy.gradient(x) @ way, slope, rtol=1e-6)
    curve = (energy.gradient(ahead) - energy.gradient(behind)) @ way / (2 * step)
    assert_allclose(way @ energy.hessian(x) @ way, curve, rtol=1e-4)


def test_one_tube():
    """A single tube, which no bore holds, has the pose of the standard robot."""
    robot, beta, alpha, force = random_case("two_tubes", 3)
    alone = Robot(robot.tubes[:1], robot.gravity)
    expected = solve_pose(alone, beta[:1], alpha[:1], Load(force, UNLOADED))
    found = bore.loose_pose(alone, beta[:1], alpha[:1], force, np.zeros(0))
    assert_allclose(found.position, expected.position, atol=5e-6)  # one grid against an extrapolation
    assert_allclose(found.rotation, expected.rotation, atol=1e-4)


@pytest.mark.parametrize("name", benches.ROBOTS)
def test_lean_in_the_bore(name):
    """A tube stays in its bore, and the tip moves with the square root of the gap."""
    robot, beta, alpha, force = random_case(name, 4)
    fitting, gap = solve_pose(robot, beta, alpha, Load(force, UNLOADED)).position, bore.radial_gaps(robot)

    def off(share: float) -> float:
        here = bore.loose(robot, beta, alpha, force, share * gap)
        x, energy = bore.settle(here), bore.LooseEnergy(here, bore.CONTACT_STIFFNESS[-1])
        for pair in range(here.n - 1):
            assert energy.distance(x, pair).max() < here.gap[pair] + 3e-6
        return float(np.linalg.norm(bore.tip_of(here, x).position - fitting))

    assert 1.5 < off(0.2) / off(0.05) < 2.7  # 2 where no curve starts near the end of an outer tube


def test_tight_tubes(monkeypatch):
    """Without a gap, harder contacts approach the standard robot."""
    robot, beta, alpha, force = random_case("two_tubes", 5)
    fitting, off = solve_pose(robot, beta, alpha, Load(force, UNLOADED)).position, []
    for hardest in (1e8, 1e9, 1e10):
        monkeypatch.setattr(bore, "CONTACT_STIFFNESS", (1e5, 1e7, hardest))
        found = bore.loose_pose(robot, beta, alpha, force, np.array([1e-9]))
        off.append(np.linalg.norm(found.position - fitting))
    assert off[0] > 2 * off[1] > 4 * off[2]


@pytest.mark.parametrize("gap", [0.02e-3, 0.05e-3, 0.1e-3])
def test_lean_at_the_end(gap):
    """Where a curved outer tube ends, a straight inner one leans like a beam in a bore."""
    inner = Tube(60e9, 0.3, 0.0, 0.8e-3, 1.2e-3, 0.16, 0.02, 0.0)
    outer = Tube(60e9, 0.3, 0.0, 1.2e-3 + 2 * gap, 1.7e-3, 0.10, 0.04, 8.0)  # curved only well beyond the plate
    robot, beta, alpha = Robot((inner, outer), UNLOADED), np.array([-0.03, -0.02]), np.zeros(2)

    def turn(rotation: np.ndarray) -> float:
        return float(np.arccos(rotation[2, 2]))

    lean = turn(solve_pose(robot, beta, alpha).rotation) - turn(
        bore.loose_pose(robot, beta, alpha, UNLOADED, np.array([gap])).rotation
    )
    k, K = inner.bending_stiffness, outer.bending_stiffness
    moment = k * K / (k + K) * outer.curvature
    assert_allclose(lean, np.sqrt(3 * gap * moment / (1 / k + 1 / K)) / k, rtol=0.04)
