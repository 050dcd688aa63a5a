"""The sets with hidden causes: causes have their size, noise its statistics, seeds decide all."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import make_suite
import numpy as np
import pytest
from benches import ROBOTS, describe, joint_range
from detectable import calibration_of, detectability
from drives import Play
from field import coil_fields, induced_fields, misread
from hidden import CAUSES, hide
from make_set import Order, measure, write_set
from mechanics import Mechanics
from numpy.testing import assert_allclose, assert_array_equal
from robot import from_description
from scipy.spatial.transform import Rotation
from session import Habit, Plan, Setup, draw_noise, draw_plan, run_session
from simulate import draw_bench

ROOT = Path(__file__).parents[3]


def plan_of(seed: int, every: int, robot: str = "table2", **kind: bool) -> Plan:
    """A plan with fewer readings on the same way."""
    plan = draw_plan(joint_range(describe(robot)), np.random.default_rng([seed, 1]), Habit(**kind))
    few = slice(None, None, every)
    return replace(plan, time=plan.time[few], run=plan.run[few], joints=plan.joints[few], mass=plan.mass[few])


@cache
def tips(effect: str | None, size: float, seed: int, every: int, robot: str, streamed: bool) -> np.ndarray:
    """Tips (R, 3) [m] without noise of a thinned session."""
    description = describe(robot)
    bench = draw_bench(description, np.random.default_rng([seed, 0]))
    plan = plan_of(seed, every, robot, stream=streamed)
    setup = Setup(bench, plan, Mechanics(from_description(bench.description)))
    if effect:
        hide(setup, effect, size, np.random.default_rng([seed, 3]))
    return np.array([position for position, _ in run_session(setup)])


@pytest.mark.parametrize("name", CAUSES)
def test_size_zero(name):
    """A cause of size zero gives exactly the poses of the plain robot."""
    streamed = CAUSES[name].streamed
    thinned = 3, 400 if streamed else 84, "two_tubes", streamed
    assert_array_equal(tips(name, 0.0, *thinned), tips(None, 0.0, *thinned))


# tip RMS [mm] of one unit of each on one tube or axis (the design's table of sizes), and how many add up here
SIZES = {
    "backlash_rotation": (0.119, 3),
    "backlash_translation": (0.032, 3),
    "frame_drift": (0.173, 3),
    "clearance": (0.69, 2),
    "anisotropy": (0.19, 3),
    "entry_clearance": (0.75, 1),
    "entry_compliance": (0.92, 1),
    "softening": (0.35, 3),
    "tip_mass": (0.43, 1),
    "tip_force": (0.35, 3),
    "straight_curvature": (0.35, 3),
    "precurvature_profile": (0.57, 3),
    "sensor_offset": (1.0, 2),
    "periodic_rotation": (0.09, 3),
    "helical_precurvature": (0.27, 3),
    "shear_stiffness": (0.06, 3),
    "drive_compliance": (0.07, 3),
    "periodic_translation": (0.014, 3),
    "delay": (0.244, 1),
    "creep": (0.3, 3),
}


@pytest.mark.parametrize("name", SIZES)
def test_size(name):
    """An effect of size one moves the tip by its plausible amount."""
    streamed = CAUSES[name].streamed
    thinned = 21, 64 if streamed else 13, "table2", streamed
    moved = tips(name, 1.0, *thinned) - tips(None, 0.0, *thinned)
    one, number = SIZES[name]
    ratio = 1e3 * np.sqrt(np.mean(np.sum(moved**2, axis=1))) / (one * np.sqrt(number))
    print(name, f"{ratio:.2f}")
    assert 0.4 < ratio < 2.5


@pytest.mark.parametrize("noise", ["jitter", "realistic"])
def test_detectability(noise):
    """Calibration absorbs errors of its own parameters and leaves the others."""
    description = describe("two_tubes")
    bench, plan = draw_bench(description, np.random.default_rng(1)), plan_of(3, 17, "two_tubes")

    def judge(moved: np.ndarray):
        turned = Rotation.from_rotvec(np.zeros_like(moved))
        return detectability(calibration_of(bench, plan), description["tracker"], noise, moved, turned)

    shift = np.tile([0.5e-3, 0, 0], (len(plan.time), 1))  # one standard deviation of the frame's uncertainty
    own = judge(shift)
    assert own.chi_square < 1.0
    assert own.after_calibration_mm < 0.01
    shaking = judge(0.1 * shift * (-1.0) ** np.arange(len(plan.time))[:, None])
    twice = judge(0.2 * shift * (-1.0) ** np.arange(len(plan.time))[:, None])
    assert shaking.chi_square > 30
    assert twice.chi_square == pytest.approx(4 * shaking.chi_square)
    assert twice.after_calibration_mm == pytest.approx(2 * shaking.after_calibration_mm)


def test_play():
    """The output follows its input late, by the gap on either side."""
    play = Play(np.array([1]), np.array([0.1]), np.array([0.3]))
    outputs = [play(np.array([5.0, q]))[1] for q in (0.0, 0.2, 1.0, 0.8, 0.5)]
    assert_allclose(outputs, [0.0, 0.0, 0.7, 0.7, 0.6])


def test_metal():
    """Beside metal, a tracker reads the pose that explains the distorted field best."""
    place, volume = np.array([0.05, -0.1, -0.08]), 1e-9
    metal = np.array([0.1, -0.15, -0.02]) + np.outer([-0.02, 0.02], [0.0, 0.6, 0.8])
    shift, turn = misread(place, metal, volume)
    seen = coil_fields(place) + induced_fields(place, metal, volume)

    def misfit(p: np.ndarray, rotation: np.ndarray) -> float:
        return float(np.linalg.norm(Rotation.from_rotvec(-rotation).as_matrix() @ coil_fields(p) - seen))

    best = misfit(place + shift, turn)
    rng = np.random.default_rng(0)
    for _ in range(20):
        nearby = rng.normal(0, 0.2, 3) * np.linalg.norm(shift), rng.normal(0, 0.2, 3) * np.linalg.norm(turn)
        assert misfit(place + shift + nearby[0], turn + nearby[1]) > best


@pytest.mark.parametrize("kind", ["jitter", "realistic"])
def test_size_of_noise(kind):
    """Jitter, smooth field error and outliers have the sizes that the description states."""
    tracker = describe("table2")["tracker"]
    rng = np.random.default_rng(8)
    places = rng.uniform(-5, 5, (8000, 3))  # far apart, so that the field is met in many places
    noise = draw_noise(tracker, places, kind, rng)
    inlier = ~noise.outlier
    assert 1e3 * noise.position[inlier].std() == pytest.approx(0.035, rel=0.02)
    assert np.rad2deg(noise.rotation.std()) == pytest.approx(0.03, rel=0.02)
    if kind == "jitter":
        assert not np.any(noise.field_position) and not np.any(noise.field_rotation) and np.all(inlier)
        return
    assert noise.outlier.mean() == pytest.approx(0.005, rel=0.35)
    sizes = np.linalg.norm(noise.position[noise.outlier], axis=1)
    assert 0.8e-3 < sizes.min() and sizes.max() < 3.2e-3
    for field, scale, promised in (
        (noise.field_position, 1e3, tracker["accuracy_95_mm"]),
        (noise.field_rotation, np.rad2deg(1), tracker["accuracy_95_deg"]),
    ):
        assert scale * np.quantile(np.linalg.norm(field, axis=1), 0.95) == pytest.approx(promised, rel=0.06)


def test_field_error_is_smooth():
    """The field error is correlated over the described length."""
    rng = np.random.default_rng(9)
    places = np.array([0.0, 0.001, 0.1, 0.3])[:, None] * np.array([1.0, 0, 0]) + np.zeros((4, 3))
    errors = np.array(
        [draw_noise(describe("B")["tracker"], places, "realistic", rng).field_position for _ in range(400)]
    )
    correlation = [np.mean(errors[:, 0] * errors[:, k]) / np.mean(errors[:, 0] ** 2) for k in range(4)]
    assert_allclose(correlation, [1.0, 1.0, np.exp(-0.5), np.exp(-4.5)], atol=0.1)


@pytest.mark.parametrize("robot", ROBOTS)
def test_plan(robot):
    """A plan visits every stop twice and keeps the order of the tubes."""
    allowed = joint_range(describe(robot))
    plan, n = draw_plan(allowed, np.random.default_rng(5), Habit()), allowed.home.size
    assert len(plan.time) == 12 * 28 and np.all(np.diff(plan.time) > 0) and np.all(np.diff(plan.knot_time) > 0)
    for run in range(12):
        joints = plan.joints[plan.run == run]
        assert_allclose(joints[:14], joints[26:12:-1], atol=1e-12)
        assert_allclose(joints[27], joints[6], atol=1e-12)
    assert np.all(np.diff(plan.joints[:, :n]) > 0) and np.all(plan.joints[:, n - 1] <= 0)
    assert np.all(np.diff(plan.joints[:, :n] + allowed.length) < 0)
    for time, joints in zip(plan.time, plan.joints, strict=True):
        assert_allclose(plan.at(time), joints, atol=1e-12)


def test_reproducible(tmp_path):
    """The same order gives the same set, another seed another one."""
    order = Order((("backlash_rotation", 1.0), ("sensor_offset", 0.5)), 4, "realistic", "two_tubes", Habit(1))
    tables = []
    for name, seed in (("a", 4), ("b", 4), ("c", 5)):
        write_set(replace(order, seed=seed), tmp_path / name, tmp_path / "truth" / f"{name}.yaml")
        tables.append((tmp_path / name / "measurements.csv").read_text(encoding="utf-8"))
    assert tables[0] == tables[1] != tables[2]
    assert (tmp_path / "a" / "robot.yaml").read_text() == (tmp_path / "c" / "robot.yaml").read_text()


def test_hiding():
    """A hidden effect changes neither the bench nor the plan."""
    plain, hidden = (measure(Order(effects, 6, habit=Habit(1))) for effects in ((), (("sensor_offset", 1.0),)))
    assert_array_equal(plain.plan.joints, hidden.plan.joints)
    assert_array_equal(plain.noise.position, hidden.noise.position)
    offset = plain.rotation.inv().apply(hidden.position - plain.position)
    assert_allclose(offset, np.tile(hidden.truths[0]["offset_m"], (len(offset), 1)), atol=1e-12)


def test_true_bench():
    """The true bench lies within the stated uncertainties; that of a wrong sheet far beyond them."""
    description = describe("table2")
    benches = [draw_bench(description, np.random.default_rng(seed)) for seed in range(300)]
    relative = [
        bench.description["tubes"][i]["youngs_modulus_GPa"] / description["tubes"][i]["youngs_modulus_GPa"] - 1
        for bench in benches
        for i in range(3)
    ]
    assert np.std(relative) == pytest.approx(0.7 * 0.15, rel=0.1)
    wrong = [draw_bench(description, np.random.default_rng(seed), wrong=True) for seed in range(20)]
    assert min(np.abs(np.degrees(bench.alpha_offset)).min() for bench in wrong) > 3 * 1.0


def test_suite():
    """Both halves of the suite hold enough sets for every question."""
    suite, every = make_suite.entries(), {*make_suite.EFFECTS, *make_suite.LATER_EFFECTS}
    other = make_suite.entries(shift=1)
    assert [e.order.seed % 2 for e in other] == [e.order.seed % 2 for e in suite]
    assert not {e.order.seed for e in other} & {e.order.seed for e in suite}
    assert len(suite) >= 150 and len({entry.name for entry in suite}) == len(suite)
    for half in (0, 1):
        own = [entry for entry in suite if entry.order.seed % 2 == half]
        singles = {entry.order.effects for entry in own if entry.group == "single" and entry.order.noise == "jitter"}
        assert singles == {((name, size),) for name in every for size in make_suite.SIZES}
        assert sum(entry.group == "strange" for entry in own) >= 8
        assert sum(entry.group == "control" for entry in own) >= 10
        assert sum(entry.order.wrong_sheet for entry in own) >= 20
    assert {i for name in every for i in CAUSES[name].ids} == every


@pytest.mark.parametrize("tubes", range(1, 5))
def test_drawn_robots(tubes):
    """A drawn robot nests, its outermost tip stays in front of the plate, and the product reads its file."""
    for seed in range(40):
        description = describe(f"drawn{tubes}", np.random.default_rng(seed))
        robot = from_description(description)
        assert len(robot.tubes) == tubes
        for inner, outer in pairwise(robot.tubes):
            assert inner.outer_diameter < outer.inner_diameter
        allowed = joint_range(description)
        assert np.all(allowed.length[-1] + allowed.home[-1] - allowed.retraction[-1] > 0.01)
        assert len(draw_plan(allowed, np.random.default_rng(seed), Habit(2, 5, scattered=True)).time) == 10


def test_scattered_plan():
    """Scattered places are visited once each, and masses change within a single run."""
    allowed = joint_range(describe("table2"))
    plan = draw_plan(allowed, np.random.default_rng(5), Habit(1, 30, scattered=True))
    assert len(np.unique(plan.joints, axis=0)) == 30 and sorted(set(plan.mass)) == [0.0, 0.01, 0.02]
    assert np.all(np.diff(plan.knot_time) > 0)
