"""The compiled model through ctcr.Model: laws, conversions, refusals."""

import threading
import tracemalloc

import numpy as np
import pytest
from ctcr import Model, _core
from ctcr.errors import ArgumentError
from ctcr.frames import angle_between, matrix_from_quaternion, product, quaternion_from_rotation_vector
from ctcr.model.model import status_text
from model_bench import make_robot, random_force, random_joints


def turn_about_z(angle: float) -> np.ndarray:
    return quaternion_from_rotation_vector([0.0, 0.0, angle])


def test_one_tube():
    """One tube is straight then an arc."""
    robot = make_robot(1)
    tube = robot.tubes[0]
    beta, alpha = random_joints(robot, 200)
    answer = Model(robot).predict(beta, alpha)
    out = tube.length + beta[:, 0]
    arc = np.minimum(out, tube.curved_length)
    bend = tube.curvature * arc
    # Curvature about x bends the tip towards -y.
    y = -(1 - np.cos(bend)) / tube.curvature
    z = out - arc + np.sin(bend) / tube.curvature
    expected = np.column_stack([-np.sin(alpha[:, 0]) * y, np.cos(alpha[:, 0]) * y, z])
    assert answer.solved.all()
    np.testing.assert_allclose(answer.position, expected, atol=1e-12)
    turned = product(
        np.stack([turn_about_z(a) for a in alpha[:, 0]]),
        quaternion_from_rotation_vector(bend[:, None] * [1.0, 0.0, 0.0]),
    )
    assert angle_between(answer.quaternion, turned).max() < 1e-12


@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
def test_turned(n_tubes):
    """Turning everything turns the answer."""
    gravity = np.array([3.0, -2.0, -9.0])
    robot = make_robot(n_tubes, gravity=gravity.tolist())
    beta, alpha = random_joints(robot, 50)
    force, moment = random_force(50), 0.01 * random_force(50, seed=3)
    turn = matrix_from_quaternion(turn_about_z(0.7))
    turned_robot = make_robot(n_tubes, gravity=(turn @ gravity).tolist())
    before = Model(robot).predict(beta, alpha, force, moment)
    after = Model(turned_robot).predict(beta, alpha + 0.7, force @ turn.T, moment @ turn.T)
    assert before.solved.all() and after.solved.all()
    np.testing.assert_allclose(after.position, before.position @ turn.T, atol=1e-9)
    assert angle_between(after.quaternion, product(turn_about_z(0.7), before.quaternion)).max() < 1e-8


def test_flush_tips():
    """Tubes share the tip where they are flush."""
    lengths = [450.0, 300.0]
    beta, alpha = np.array([[-0.35, -0.2]]), np.array([[0.4, -1.0]])
    on_first, on_second = (
        Model(make_robot(2, sensor=sensor, length_mm=lengths)).predict(beta, alpha) for sensor in (1, 2)
    )
    np.testing.assert_allclose(on_second.position, on_first.position, atol=1e-12)
    first, second = (matrix_from_quaternion(a.quaternion[0]) for a in (on_first, on_second))
    np.testing.assert_allclose(first[:, 2], second[:, 2], atol=1e-12)
    assert np.linalg.norm(first[:, 0] - second[:, 0]) > 0.1  # but each keeps its own angle


def test_straight_inner_tube():
    """A straight inner tube goes on along the tangent."""
    shapes = dict(curvature_per_m=[0.0, 6.0])
    beta, alpha = np.array([[-0.20, -0.1]]), np.array([[0.4, -1.0]])
    inner = Model(make_robot(2, **shapes)).predict(beta, alpha)
    outer = Model(make_robot(2, sensor=2, **shapes)).predict(beta, alpha)
    beyond = (0.35 - 0.20) - (0.25 - 0.1)
    tangent = matrix_from_quaternion(outer.quaternion[0])[:, 2]
    np.testing.assert_allclose(inner.position[0], outer.position[0] + beyond * tangent, atol=1e-12)


def test_direct_stiffness():
    """Stiffness may be given directly."""
    robot = make_robot(3)
    stiffness = [tube.bending_stiffness for tube in robot.tubes]
    direct = make_robot(3, bending_stiffness_Nm2=stiffness, youngs_modulus_GPa=[None] * 3)
    joints, force = random_joints(robot, 20), random_force(20)
    expected = Model(robot).predict(*joints, force)
    np.testing.assert_allclose(Model(direct).predict(*joints, force).position, expected.position, atol=1e-12)


def test_stiffness_ratios():
    """Unloaded only ratios of stiffness matter."""
    robot, stiff = make_robot(3), make_robot(3, youngs_modulus_GPa=[580.0] * 3)
    joints = random_joints(robot, 20)
    expected = Model(robot).predict(*joints)
    np.testing.assert_allclose(Model(stiff).predict(*joints).position, expected.position, atol=1e-9)


def test_finer_steps():
    """Finer steps converge."""
    robot = make_robot(3)
    joints, force = random_joints(robot, 100), random_force(100)
    coarse, fine, finest = (Model(robot, steps=steps).predict(*joints, force).position for steps in (1, 8, 32))
    assert 0 < np.abs(fine - finest).max() < 1e-3 * np.abs(coarse - finest).max()


@pytest.mark.parametrize("derivatives", [False, True])
def test_threads(derivatives):
    """Answers do not depend on the number of threads."""
    robot = make_robot(3)
    beta, alpha = random_joints(robot, 500)
    alpha[:250] = alpha[0] + np.linspace(0, 2, 250)[:, None]  # a path, solved from row to row
    beta[:250] = beta[0]
    force = random_force(500)
    beta[[7, 300]] = 0.1
    answers = [Model(robot).predict(beta, alpha, force, derivatives=derivatives, threads=t) for t in (1, 2, 5, 0)]
    for answer in answers[1:]:
        for name, value in vars(answers[0]).items():
            np.testing.assert_array_equal(getattr(answer, name), value, err_msg=name)


def test_bad_rows():
    """Rows without a solution have a status and do not disturb the others."""
    robot = make_robot(3)
    beta, alpha = random_joints(robot, 6)
    force = np.zeros((6, 3))
    good = Model(robot).predict(beta, alpha, force, derivatives=True)
    beta[1] = beta[1, ::-1]
    beta[2, 2] = -1.0
    alpha[3, 0] = np.nan
    force[4, 1] = np.inf
    answer = Model(robot).predict(beta, alpha, force, derivatives=True)
    texts = [status_text(code) for code in answer.status]
    assert texts == ["ok", "joints out of order", "tip behind the plate", "not finite", "not finite", "ok"]
    assert answer.solved.tolist() == [True, False, False, False, False, True]
    for name in ("position", "quaternion", "stability", "jacobian", "compliance"):
        value = getattr(answer, name)
        assert np.isnan(value[1:5]).all(), name
        np.testing.assert_allclose(value[[0, 5]], getattr(good, name)[[0, 5]], atol=1e-9, err_msg=name)


def test_quaternions():
    """Quaternions are unit with w first."""
    robot = make_robot(3)
    quaternion = Model(robot).predict(*random_joints(robot, 500)).quaternion
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1, atol=1e-12)
    assert (quaternion[:, 0] >= 0).all()


def test_conversion():
    """Arrays of any kind are converted."""
    robot = make_robot(2)
    model = Model(robot)
    beta, alpha = random_joints(robot, 8)
    expected = model.predict(beta, alpha, np.zeros((8, 3)))
    wide = np.repeat(np.hstack([beta, alpha]), 2, axis=0)
    views = [
        (beta.tolist(), alpha.tolist()),
        (np.asfortranarray(beta), np.asfortranarray(alpha)),
        (wide[::2, :2], wide[::2, 2:]),
    ]
    for other_beta, other_alpha in views:
        answer = model.predict(other_beta, other_alpha, force=[0, 0, 0])
        np.testing.assert_array_equal(answer.position, expected.position)
    single = model.predict(beta.astype(np.float32), alpha.astype(np.float32))
    np.testing.assert_allclose(single.position, expected.position, atol=1e-6)


def test_one_load():
    """One load serves all rows."""
    robot = make_robot(2)
    joints = random_joints(robot, 5)
    one = Model(robot).predict(*joints, [0.01, 0.02, 0.0], [0.0, 1e-3, 0.0])
    many = Model(robot).predict(*joints, [[0.01, 0.02, 0.0]] * 5, [[0.0, 1e-3, 0.0]] * 5)
    np.testing.assert_array_equal(one.position, many.position)


def test_no_rows():
    """No rows give no rows."""
    answer = Model(make_robot(3)).predict(np.empty((0, 3)), np.empty((0, 3)), derivatives=True)
    assert answer.position.shape == (0, 3) and answer.jacobian.shape == (0, 6, 6) and len(answer.status) == 0


@pytest.mark.parametrize(
    "arguments",
    [
        dict(beta=np.zeros((4, 2))),
        dict(beta=np.zeros(3)),
        dict(alpha=np.zeros((5, 3))),
        dict(force=np.zeros((5, 3))),
        dict(force=np.zeros(2)),
        dict(moment=np.zeros((4, 4))),
        dict(beta=[["a", "b", "c"]] * 4),
    ],
)
def test_bad_shapes(arguments):
    """Shapes that do not fit are refused, with the name of the argument and its unit."""
    good = dict(beta=np.full((4, 3), -0.1), alpha=np.zeros((4, 3)))
    [name] = arguments
    unit = {"beta": "m", "alpha": "rad", "force": "N", "moment": "N m"}[name]
    with pytest.raises(ArgumentError, match=f"{name}: .*in {unit}"):
        Model(make_robot(3)).predict(**good | arguments)


def test_bad_steps():
    """Steps below one are refused."""
    robot = make_robot(1)
    with pytest.raises(ValueError, match="steps"):
        Model(robot, steps=0).predict(*random_joints(robot, 1))


def test_core_refusals():
    """The compiled model refuses arrays that do not fit together."""
    with pytest.raises(ValueError, match="of 5 tubes"):
        _core.Model(5, np.zeros(48))
    with pytest.raises(ValueError, match="do not fit"):
        _core.Model(2, np.zeros(12))
    model = Model(make_robot(2))._core
    with pytest.raises(ValueError, match="one column a tube"):
        model.predict(beta=np.zeros((1, 3)), alpha=np.zeros((1, 3)))
    with pytest.raises(ValueError, match="tubes, gravity and effects"):
        model.predict(beta=np.zeros((1, 2)), alpha=np.zeros((1, 2)), derivatives=True, by_parameters=[25])


def test_memory():
    """Memory is that of the answers."""
    robot = make_robot(3)
    beta, alpha = random_joints(robot, 2000)
    model = Model(robot)
    tracemalloc.start()
    answer = model.predict(beta, alpha, derivatives=True)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1.05 * sum(value.nbytes for value in vars(answer).values() if value is not None)


def test_parallel_threads():
    """Other threads run meanwhile."""
    robot = make_robot(3)
    joints = random_joints(robot, 20_000)
    started, done = threading.Event(), threading.Event()

    def predict():
        started.set()
        Model(robot).predict(*joints, derivatives=True, threads=1)
        done.set()

    thread = threading.Thread(target=predict)
    thread.start()
    started.wait()
    turns = 0
    while not done.is_set():
        turns += 1
    thread.join()
    assert turns > 1000  # with the GIL held this loop would stand still until the end


@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
@pytest.mark.parametrize("loaded", [False, True])
def test_shape_ends(n_tubes, loaded):
    """The shape runs from the plate to the tip."""
    robot = make_robot(n_tubes, gravity=[2.0, 0.0, -9.0] if loaded else None)
    fine = Model(robot, steps=32)
    beta, alpha = random_joints(robot, 10)
    force, moment = random_force(10) * loaded, 0.01 * random_force(10, seed=3) * loaded
    tips = fine.predict(beta, alpha, force, moment)
    for row in range(10):
        shape = fine.shape(beta[row], alpha[row], force[row], moment[row], points=300)
        assert shape.arc_length[0] == 0 and (np.diff(shape.arc_length) > 0).all()
        np.testing.assert_allclose(shape.arc_length[-1], robot.tubes[0].length + beta[row, 0], atol=1e-12)
        np.testing.assert_allclose(shape.position[0], 0, atol=1e-9)
        np.testing.assert_allclose(shape.quaternion[0], [1, 0, 0, 0], atol=1e-9)
        np.testing.assert_allclose(shape.position[-1], tips.position[row], atol=1e-8)
        assert angle_between(shape.tube_quaternion(0)[-1], tips.quaternion[row]) < 1e-6
        np.testing.assert_allclose(shape.internal_force[-1], force[row], atol=1e-9)
        np.testing.assert_allclose(shape.internal_moment[-1], moment[row], atol=1e-9)
        # Each tube is there up to its own tip and is turned at its base by its motor.
        for tube in range(n_tubes):
            end = robot.tubes[tube].length + beta[row, tube]
            there = shape.arc_length <= end + 1e-9
            assert np.array_equal(np.isfinite(shape.tube_angle[tube]), there)
            at_base = shape.tube_angle[tube, 0] + beta[row, tube] * shape.tube_curvature[tube, 0, 2]
            np.testing.assert_allclose(np.sin((at_base - alpha[row, tube]) / 2), 0, atol=1e-7)


def test_shape_statics():
    """The shape satisfies statics."""
    robot = make_robot(3)
    beta, alpha = random_joints(robot, 1)
    force, moment = np.array([0.03, -0.02, 0.01]), np.array([1e-3, 2e-3, -1e-3])
    shape = Model(robot).shape(beta[0], alpha[0], force, moment, points=1000)
    tip = shape.position[-1]
    # The moment at each place balances the tip load, and is the sum of what the tubes carry.
    np.testing.assert_allclose(shape.internal_moment, moment + np.cross(tip - shape.position, force), atol=1e-7)
    carried = sum(
        np.nan_to_num(np.einsum("kij,kj->ki", matrix_from_quaternion(shape.tube_quaternion(i)), shape.tube_moment[i]))
        for i in range(3)
    )
    np.testing.assert_allclose(carried, shape.internal_moment, atol=1e-7)
    # The frame is the derivative of the position.
    tangent = np.diff(shape.position, axis=0) / np.diff(shape.arc_length)[:, None]
    axes = matrix_from_quaternion(shape.quaternion)[:, :, 2]
    np.testing.assert_allclose(tangent, (axes[1:] + axes[:-1]) / 2, atol=1e-5)


def test_shape_unsolved():
    """The shape of a row without solution is refused."""
    model = Model(make_robot(2))
    with pytest.raises(ValueError, match="joints out of order"):
        model.shape([-0.1, -0.2], [0, 0])
    with pytest.raises(ArgumentError, match="shape"):
        model.shape([[-0.2, -0.1]], [[0, 0]])
    with pytest.raises(ValueError, match="points"):
        model.shape([-0.2, -0.1], [0, 0], points=1)
