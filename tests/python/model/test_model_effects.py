"""Effects in ctcr.Model: poses, derivatives and shapes, against recordings of the same rows and differences."""

import numpy as np
import pytest
from ctcr import Model
from ctcr.effects import catalogue
from ctcr.errors import InputError
from ctcr.model import table_poses
from ctcr.robot.description import Actuation, Tracker
from ctcr.table.measurements import Measurements
from model_bench import make_robot, pose_of, random_force, random_joints, slope

STRENGTHS = {  # effects without a path, strong enough to matter
    "tip_load": {"mass": 0.002, "force_x": 0.01},
    "precurvature_profile": {},
    "softening": {"gamma": 0.01},
    "anisotropy": {},
    "straight_curvature": {},
    "clearance": {"tilt": 0.01},
    "torsional_compliance": {},
    "periodic_rotation": {},
    "periodic_translation": {},
    "entry_compliance": {},
    "entry_clearance": {},
    "helical_precurvature": {},
    "contact": {"stiffness": 50.0, "distance": 0.05, "azimuth": 0.4, "elevation": 0.2},
}


def with_effects(robot, *identities: str):
    """The robot with effects at the values above, or half a sigma from neutral."""
    chosen = {}
    for identity in identities:
        effect, given = catalogue.get(identity, robot.n_tubes), STRENGTHS[identity]
        chosen[identity] = {}
        for p in effect.parameters:
            usual = p.neutral if given or p.full_names[0] not in effect.amplitudes else p.neutral + 0.5 * p.sigma
            value = float(given.get(p.name, usual))
            chosen[identity][p.name] = [value] * robot.n_tubes if p.per_tube else value
    return robot.model_copy(update={"effects": chosen})


def bench_robot(sensor: int = 1):
    """Three tubes under gravity whose table and robot agree about homes and the tracker's frame."""
    robot = make_robot(3, gravity=[1.0, -2.0, -9.0], sensor=sensor)
    robot.actuation = Actuation(
        translation_mm_per_rev=2.0, rotation_rev_per_rev=1.0, home_translation_mm=[0.0] * 3, home_rotation_deg=[0.0] * 3
    )
    robot.tracker = Tracker.model_construct(
        sensor_on_tube=sensor, position_mm=[5.0, -3.0, 20.0], rotation_vector_rad=[0.1, 0.2, -0.3]
    )
    return robot


def table_of(beta, alpha, force) -> Measurements:
    return Measurements.of_joints(beta, alpha, t=np.full(len(beta), np.nan), force=force)


@pytest.mark.parametrize("identity", STRENGTHS)
@pytest.mark.parametrize("sensor", [1, 2])
def test_poses(identity, sensor):
    """Poses are the readings of the same rows in a recording, and differ from those of the standard model."""
    robot = with_effects(bench_robot(sensor), identity)
    beta, alpha = random_joints(robot, 20)
    force = random_force(20)
    seen = table_poses.readings(robot, table_of(beta, alpha, force), steps=4)
    answer = Model(robot, steps=4).predict(beta, alpha, force)
    assert answer.solved.all()
    np.testing.assert_allclose(answer.position, seen.position, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(answer.quaternion * seen.quaternion, axis=1)), 1, atol=1e-12)
    plain = Model(robot.standard, steps=4).predict(beta, alpha, force).position
    assert np.linalg.norm(answer.position - plain, axis=1).max() > 1e-6


def test_effects_with_a_path():
    """A model refuses effects that depend on the path, and these tests cover all others."""
    of_poses = {
        identity
        for identity, effect in catalogue.catalogue(3).items()
        if effect.acts_on != {"reading"} and not effect.needs & {"order", "time"}
    }
    assert of_poses == set(STRENGTHS)
    robot = bench_robot().model_copy(update={"effects": {"friction": {"coefficient": [0.1, 0.1, 0.1]}}})
    with pytest.raises(InputError, match="friction need the rows in their order"):
        Model(robot)


@pytest.mark.parametrize("sensor", [1, 2])
@pytest.mark.parametrize("identities", [tuple(STRENGTHS), ("contact",), ("periodic_rotation", "periodic_translation")])
def test_jacobian_and_compliance(sensor, identities):
    """Derivatives by joints and loads are central differences of poses."""
    robot = with_effects(bench_robot(sensor), *identities)
    model, n, rows = Model(robot, steps=4), 3, 6
    beta, alpha = random_joints(robot, rows, seed=5)
    load = np.hstack([random_force(rows), 0.01 * random_force(rows, seed=3)])
    answer = model.predict(beta, alpha, load[:, :3], load[:, 3:], by_parameters=True)
    assert answer.by_parameters.shape == (rows, 6, len(model.parameters))
    x = np.hstack([beta, alpha, load])
    derivative = np.concatenate([answer.jacobian, answer.compliance], axis=2)

    def pose(x):
        return pose_of(model.predict(x[:, :n], x[:, n : 2 * n], x[:, 2 * n : 2 * n + 3], x[:, 2 * n + 3 :]))

    step = 1e-6
    for column in range(x.shape[1]):
        change = step * (np.arange(x.shape[1]) == column)
        numeric = slope(pose(x + change), pose(x - change), 2 * step)
        scale = 1 + np.abs(derivative[:, :, column]).max()
        np.testing.assert_allclose(derivative[:, :, column], numeric, atol=2e-5 * scale)


def test_by_parameters():
    """Derivatives by the parameters of effects are central differences of poses."""
    robot = with_effects(bench_robot(), *STRENGTHS)
    beta, alpha = random_joints(robot, 5, seed=5)
    model, force = Model(robot, steps=4), random_force(5)
    by = model.predict(beta, alpha, force, by_parameters=True).by_parameters
    for name, p in catalogue.parameter_of(3).items():
        if name not in model.parameters or p.kind == "choice":
            continue
        width, poses = 1e-4 * p.sigma, []
        for sign in (1, -1):
            value = catalogue.value_of(robot)[name] + sign * width
            changed = robot.model_copy(update={"effects": catalogue.as_section([name], [value], robot)})
            poses.append(pose_of(Model(changed, steps=4).predict(beta, alpha, force)))
        numeric, exact = slope(*poses, 2 * width), by[:, :, model.parameters.index(name)]
        np.testing.assert_allclose(exact, numeric, atol=1e-4 * np.abs(exact).max() + 1e-6 / p.sigma, err_msg=name)


@pytest.mark.parametrize("identities", [tuple(STRENGTHS), ("softening",), ("contact", "tip_load")])
def test_shape(identities):
    """A shape ends at the predicted tip, with every moment known."""
    robot = with_effects(bench_robot(), *identities)
    model = Model(robot, steps=16)
    beta, alpha = random_joints(robot, 5, seed=5)
    force, moment = random_force(5), 0.01 * random_force(5, seed=3)
    tips = model.predict(beta, alpha, force, moment)
    assert tips.solved.all() and np.isfinite(tips.stability).all()
    for row in range(5):
        shape = model.shape(beta[row], alpha[row], force[row], moment[row])
        np.testing.assert_allclose(shape.position[-1], tips.position[row], atol=1e-8)
        assert np.isfinite(shape.tube_moment[0]).all()
