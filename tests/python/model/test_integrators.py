"""Integration schemes other than the default: orders of convergence, refusals."""

import numpy as np
import pytest
from ctcr import Model
from model_bench import make_robot, random_force, random_joints


@pytest.mark.parametrize(("integrator", "order"), [("ssprk3", 3), ("rk4", 4), ("rk8", 8)])
def test_order(integrator, order):
    """Every integrator converges to the same answer at its order."""
    robot = make_robot(3)
    joints, force = random_joints(robot, 50), random_force(50)
    exact = Model(robot, steps=64).predict(*joints, force).position

    def error(steps: int) -> float:
        answer = Model(robot, steps=steps, integrator=integrator).predict(*joints, force)
        assert answer.solved.all()
        return np.linalg.norm(answer.position - exact, axis=1).mean()

    assert error(2) < 1e-9 if order == 8 else 0.7 * 2**order < error(8) / error(16) < 1.5 * 2**order


def test_names():
    """Integrators are known by name and give poses only."""
    robot = make_robot(2)
    with pytest.raises(ValueError, match="default, ssprk3, rk4, rk8"):
        Model(robot, integrator="euler")
    with pytest.raises(ValueError, match="default integrator"):
        Model(robot, integrator="rk4").predict(*random_joints(robot, 1), derivatives=True)
