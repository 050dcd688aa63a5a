"""Laws of the statistics: held-out sums, chance, blocks, frames."""

import numpy as np
import pytest
from compare_bench import bench, stop_and_go, stream
from ctcr import settings
from ctcr.arrays import robust_rms
from ctcr.compare import crossvalidation as cv
from ctcr.compare.dependence import local_frames
from ctcr.compare.sample import take_sample
from ctcr.frames import matrix_from_rotation_vector, rigid_motion


def plain_held_out(design, target, label, ridge):
    """Leave each block out, fit the others, sum the squared residuals: written directly."""
    total = 0.0
    scale = np.diag(design.T @ design)
    for block in np.unique(label):
        out = label == block
        x, y = design[~out], target[~out]
        coefficients = np.linalg.solve(x.T @ x + np.diag(ridge * scale), x.T @ y)
        total += np.sum((target[out] - design[out] @ coefficients) ** 2)
    return total


@pytest.mark.parametrize("seed", range(4))
def test_held_out_sums(seed):
    """The sums from normal equations equal refits without each block, for every sign pattern."""
    random = np.random.default_rng(seed)
    label = np.sort(random.integers(0, 6, 90))
    design, target = random.normal(size=(90, 3)), random.normal(size=(90, 2))
    folds = cv.make_folds(np.unique(label, return_inverse=True)[1], trials=12, seed=seed)
    regression = cv.Regression(design, folds)
    sums = regression.unexplained(target)
    assert len(sums) == 13
    for signs, value in zip(folds.signs, sums, strict=True):
        flipped = target * signs[folds.label][:, None]
        expected = min(plain_held_out(design, flipped, label, ridge) for ridge in settings.RIDGES)
        assert value == pytest.approx(expected, rel=1e-9)
    left = target - regression.predicted(target)
    assert np.sum(left**2) == pytest.approx(sums[0], rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_group_quantiles(seed):
    """Quantiles of groups, of one value too, are those of each group alone."""
    random = np.random.default_rng(seed)
    label = np.concatenate([np.arange(7), random.integers(0, 6, 90)])
    values = random.normal(size=97).round(1)
    for part in (0.0, 0.3, 0.95, 1.0):
        alone = [np.quantile(values[label == group], part) for group in range(7)]
        np.testing.assert_allclose(cv.group_quantiles(values, label, part), alone, rtol=1e-12)


def test_chance():
    """The observed result counts as one of the trials."""
    assert cv.chance(5.0, np.array([1.0, 5.0, 9.0])) == 0.75
    assert cv.chance(10.0, np.zeros(99)) == 0.01


def test_p_values():
    """Under noise a p-value is below x at most a share x of the time (here x = 0.2, 200 tries, 4 sigma)."""
    below = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        label = np.repeat(np.arange(10), 8)
        folds = cv.make_folds(label, trials=99, seed=seed)
        target = random.normal(size=(80, 3))
        gain = np.sum(target**2) - cv.Regression(random.normal(size=(80, 2)), folds).unexplained(target)
        below += cv.chance(gain[0], gain[1:]) <= 0.2
    assert below <= 200 * 0.2 + 4 * np.sqrt(200 * 0.2 * 0.8)


def test_runs_are_blocks():
    """With enough runs the blocks are the runs."""
    random = np.random.default_rng(1)
    sample = take_sample(*bench(random, stop_and_go(random, runs=9)))
    rows, label, kind = cv.split(sample.run, sample.motion.scaled)
    assert kind == "runs"
    np.testing.assert_array_equal(sample.run[rows], label)


def test_regions_are_blocks():
    """One run is split into regions of joint space; a region holds both passes, so that nothing leaks between them."""
    random = np.random.default_rng(2)
    sample = take_sample(*bench(random, stream(random)))
    rows, label, kind = cv.split(sample.run, sample.motion.scaled)
    assert kind == "places"
    assert np.bincount(label).min() > 0.8 * len(rows) / settings.REGIONS
    region = np.empty(len(rows), int)
    region[rows] = label
    half = len(rows) // 2  # the second half of the path is the first one backwards, between its readings
    mirrored = region[half + np.arange(1, half - 1)] == region[half - np.arange(1, half - 1)]
    assert mirrored.mean() > 0.95


def test_local_frames():
    """The axes of every frame are a rotation where it is defined."""
    random = np.random.default_rng(3)
    sample = take_sample(*bench(random, stop_and_go(random)))
    rows = np.arange(len(sample.row))
    for name, axes in local_frames(sample, rows).items():
        known = np.linalg.norm(axes, axis=(1, 2)) > 0
        assert known.mean() > 0.9, name
        products = np.einsum("kji,kjl->kil", axes[known], axes[known])
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-9, err_msg=name)
        np.testing.assert_allclose(np.linalg.det(axes[known]), 1, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("seed", range(5))
def test_rigid_motion(seed):
    """A rotation and shift are recovered exactly."""
    random = np.random.default_rng(seed)
    source = random.normal(size=(30, 3))
    turn, shift = matrix_from_rotation_vector(random.normal(size=3)), random.normal(size=3)
    found_turn, found_shift = rigid_motion(source, source @ turn.T + shift)
    np.testing.assert_allclose(found_turn, turn, atol=1e-12)
    np.testing.assert_allclose(found_shift, shift, atol=1e-12)


@pytest.mark.parametrize("axes", [1, 3])
def test_robust_rms(axes):
    """The RMS length of normal vectors, which a hundredth of gross outliers changes by 2 % at most."""
    lengths = np.linalg.norm(np.random.default_rng(axes).normal(0, 0.3, (200_000, axes)), axis=1)
    assert robust_rms(lengths, axes) == pytest.approx(0.3 * axes**0.5, rel=5e-3)
    lengths[::100] = 1e3
    assert robust_rms(lengths, axes) == pytest.approx(0.3 * axes**0.5, rel=2e-2)
