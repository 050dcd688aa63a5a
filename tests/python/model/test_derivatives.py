"""Derivatives of the compiled model through ctcr.Model, against differences of its poses."""

import numpy as np
import pytest
from ctcr import Model
from ctcr.model import parameters
from ctcr.robot.description import Actuation, Robot
from model_bench import make_robot, pose_of, random_force, random_joints, slope


@pytest.mark.parametrize(("n_tubes", "sensor"), [(1, 1), (2, 1), (2, 2), (3, 1), (3, 2), (3, 3), (4, 1), (4, 3)])
@pytest.mark.parametrize("loaded", [False, True])
def test_by_joints(n_tubes, sensor, loaded):
    """Derivatives are those of the prediction."""
    robot = make_robot(n_tubes, gravity=[0.0, 0.0, -9.81] if loaded else None, sensor=sensor)
    model = Model(robot, steps=8)  # fine: with and without load the equations are integrated differently
    beta, alpha = random_joints(robot, 20)
    load = np.hstack([random_force(20), 0.01 * random_force(20, seed=3)]) * loaded
    answer = model.predict(beta, alpha, load[:, :3], load[:, 3:], derivatives=True)
    x = np.hstack([beta, alpha, load])
    derivative = np.concatenate([answer.jacobian, answer.compliance], axis=2)

    def pose(x):
        n = n_tubes
        return pose_of(model.predict(x[:, :n], x[:, n : 2 * n], x[:, 2 * n : 2 * n + 3], x[:, 2 * n + 3 :]))

    step = 1e-5
    for column in range(x.shape[1]):
        change = step * (np.arange(x.shape[1]) == column)
        numeric = slope(pose(x + change), pose(x - change), 2 * step)
        scale = 1 + np.abs(derivative[:, :, column]).max()
        np.testing.assert_allclose(derivative[:, :, column], numeric, atol=1e-5 * scale)


@pytest.mark.parametrize("sensor", [1, 3])
@pytest.mark.parametrize("loaded", [False, True])
def test_by_all_parameters(sensor, loaded):
    """Derivatives by all parameters are those of the prediction."""
    robot = make_robot(3, gravity=[1.0, -2.0, -9.0] if loaded else None, sensor=sensor)
    robot.actuation = Actuation.model_validate(
        {
            "translation_mm_per_rev": 2.0,
            "rotation_rev_per_rev": -0.5,
            "home_translation_mm": [-300.0, -200.0, -100.0],
            "home_rotation_deg": [10.0, 20.0, -30.0],
        }
    )
    beta, alpha = random_joints(robot, 10)
    force = random_force(10) * loaded
    model = Model(robot, steps=8)
    answer = model.predict(beta, alpha, force, by_parameters=True)
    assert answer.by_parameters.shape == (10, 6, len(model.parameters))
    names = list(model.parameters)
    values = parameters.values(robot, names)

    def pose(name, change):
        """The same motors hold a robot with another parameter."""
        other = parameters.applied(robot, [name], [values[names.index(name)] + change])
        q = []
        for kind, joints in (("translation", beta), ("rotation", alpha)):
            old, new = (_transmission(r, kind) for r in (robot, other))
            q.append(new[0] * (joints - old[1]) / old[0] + new[1])
        return pose_of(Model(other, steps=8).predict(*q, force))

    for k, name in enumerate(names):
        if name.endswith("bending_stiffness"):
            assert not answer.by_parameters[:, :, k].any()  # not given
            continue
        step = 1e-5 if name.endswith("length") or "home" in name else 1e-4 * (abs(values[k]) or 10.0)
        numeric = slope(pose(name, step), pose(name, -step), 2 * step)
        scale = np.abs(numeric).max() + 1e-3 / (abs(values[k]) or 10.0)
        np.testing.assert_allclose(answer.by_parameters[:, :, k], numeric, atol=1e-4 * scale, err_msg=name)


def _transmission(robot: Robot, kind: str) -> tuple[float, np.ndarray]:
    names = [f"actuation.home_{kind}.{i}" for i in (1, 2, 3)]
    *home, ratio = parameters.values(robot, [*names, f"actuation.{kind}_ratio"])
    return ratio, np.array(home)


def test_compliance_symmetric():
    """Compliance to forces is symmetric without load."""
    robot = make_robot(3)
    answer = Model(robot, steps=20).predict(*random_joints(robot, 50), derivatives=True)
    np.testing.assert_allclose(answer.compliance, answer.compliance.transpose(0, 2, 1), atol=1e-5)
