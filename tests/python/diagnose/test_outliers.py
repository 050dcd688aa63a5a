"""Outliers of a tracker strike readings at random: clusters of them at the same joints have another cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose.outliers import are_many, clustered, isolated, outliers
from ctcr.table.measurements import Measurements

JITTER = 3e-5  # [m] per axis
VISITS = np.repeat(np.arange(120), 2)  # joints of each reading: all of them twice


@pytest.fixture(scope="module")
def table():
    random = np.random.default_rng(5)
    beta, alpha = random.uniform(-0.2, -0.1, (120, 3))[VISITS], random.uniform(-3, 3, (120, 3))[VISITS]
    count, nothing = len(VISITS), np.full((len(VISITS), 4), np.nan)
    poses = {"position": nothing[:, :3], "quaternion": nothing}
    return Measurements.of_joints(beta, alpha, t=2.0 * np.arange(count), run=np.arange(count) // 24, **poses)


def fit(random, errors):
    """Residuals of noise with `errors` {row: (3,) [m]} added, which the fit takes for outliers."""
    residual = np.hstack([JITTER * random.standard_normal((len(VISITS), 3)), np.zeros((len(VISITS), 3))])
    weights = np.ones((len(VISITS), 2))
    for row, error in errors.items():
        residual[row, :3] += error
        weights[row, 0] = 1e-4
    square = np.full((len(VISITS), 2), 3 * JITTER**2)
    return SimpleNamespace(residual=residual, weights=weights, expected_square=square, inflation=np.ones(2))


def directions(random, count, size):
    v = random.standard_normal((count, 3))
    return size * v / np.linalg.norm(v, axis=1, keepdims=True)


def test_pair_with_one_error(table):
    """Two visits of the same joints with the same large error are a cluster."""
    for seed in range(50):
        random = np.random.default_rng(seed)
        (error,) = directions(random, 1, 2e-3)
        assert 2 < settings.CLUSTER_ROWS
        assert np.flatnonzero(clustered(table, fit(random, {10: error, 11: error}))).tolist() == [10, 11]


def test_pair_with_two_errors(table):
    """Two visits with different large errors are not, but for 0.3 % that agree by chance."""
    found = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        there, back = directions(random, 2, 2e-3)
        found += clustered(table, fit(random, {10: there, 11: back})).any()
    assert found <= 3


@pytest.mark.parametrize("share", [0.01, 0.04])
def test_random_outliers(table, share):
    """Outliers at random are no cluster, whatever their fraction."""
    found = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        rows = np.flatnonzero(random.random(len(VISITS)) < share)
        errors = directions(random, len(rows), 1.0) * random.uniform(5e-4, 3e-3, (len(rows), 1))
        found += clustered(table, fit(random, dict(zip(rows, errors, strict=True)))).any()
    assert found <= 2


def test_isolated(table):
    """One outlier in a held-out run is isolated; two that follow each other are not."""
    held_out = np.arange(len(VISITS)) // 24 % 4 == 2
    for seed in range(50):
        random = np.random.default_rng(seed)
        glitch, (error,) = random.choice(np.flatnonzero(held_out)), directions(random, 1, 2e-3)
        off = fit(random, {glitch: error})
        assert np.flatnonzero(isolated(table, off, held_out)).tolist() == [glitch]
        assert not isolated(table, off, ~held_out).any()
        beside = glitch + 1 if held_out[glitch + 1] else glitch - 1  # the next in time
        assert not isolated(table, fit(random, {glitch: error, beside: error}), held_out).any()


def test_not_isolated(table):
    """An outlier with another one at the same joints is not isolated, and none is where there are many."""
    everywhere = np.ones(len(VISITS), bool)
    random = np.random.default_rng(1)
    error = np.full(3, 1e-3)
    again = np.arange(len(VISITS)) % 120  # the same joints long after one another
    apart = replace(table, beta=table.beta[2 * again], alpha=table.alpha[2 * again])
    assert isolated(apart, fit(random, {30: error}), everywhere).sum() == 1
    assert not isolated(apart, fit(random, {30: error, 150: error}), everywhere).any()
    few, many = np.arange(5, len(VISITS), 40), np.arange(5, len(VISITS), 10)
    assert isolated(table, fit(random, dict.fromkeys(few, error)), everywhere).sum() == len(few)
    assert not isolated(table, fit(random, dict.fromkeys(many, error)), everywhere).any()


@pytest.mark.parametrize("rows", [20, 240, 5000])
def test_more_than_a_tracker_makes(rows):
    """At the highest rate of a tracker, outliers are hardly ever called too many. Five times as many always are in a
    long table, and sometimes in a short one."""
    random = np.random.default_rng(rows)

    def called(rate):
        drawn = random.random((2000, rows, 1)) < rate
        return np.mean([are_many(SimpleNamespace(weights=np.where(one, 1e-4, 1.0))) for one in drawn])

    assert called(settings.TRACKER_OUTLIERS) < 5 * settings.OUTLIER_SIGNIFICANCE
    assert called(5 * settings.TRACKER_OUTLIERS) > (0.1 if rows < 100 else 0.99)


def test_wrong_model(table):
    """Readings of a model that is wrong everywhere are no cluster, nor are those that the fit does not down-weight."""
    random = np.random.default_rng(3)
    pairs = dict.fromkeys([*range(0, 8), *range(100, 104)], np.array([5e-4, 0, 0]))
    off = fit(random, pairs)
    assert outliers(off).sum() == clustered(table, off).sum() == len(pairs)
    off.inflation[:] = 20.0
    assert not clustered(table, off).any()
    off.inflation[:], off.weights[:] = 1.0, 1.0
    assert not clustered(table, off).any()
