"""Outliers strike a reading and not a place: what is off at a place is told from them, and they from it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.diagnose.far_off import FEWEST, alone, come_together, in_words
from ctcr.table.measurements import Measurements

JITTER = 3e-5  # [m] per axis
VISITS = np.repeat(np.arange(120), 2)  # every place twice


@pytest.fixture(scope="module")
def table():
    random = np.random.default_rng(5)
    beta, alpha = random.uniform(-0.2, -0.1, (120, 3))[VISITS], random.uniform(-3, 3, (120, 3))[VISITS]
    count, nothing = len(VISITS), np.full((len(VISITS), 4), np.nan)
    return Measurements(
        2.0 * np.arange(count),
        np.arange(count) // 24,
        beta,
        alpha,
        np.zeros((count, 3)),
        nothing[:, :3],
        nothing,
        np.arange(count) + 2,
    )


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


def test_two_visits_of_a_place_with_one_error_are_enough(table):
    for seed in range(50):
        random = np.random.default_rng(seed)
        (error,) = directions(random, 1, 2e-3)
        assert 2 < FEWEST
        assert np.flatnonzero(come_together(table, fit(random, {10: error, 11: error}))).tolist() == [10, 11]


def test_two_visits_with_different_errors_are_not(table):
    found = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        there, back = directions(random, 2, 2e-3)
        found += come_together(table, fit(random, {10: there, 11: back})).any()
    assert found <= 3  # 0.3 % of them agree by chance


@pytest.mark.parametrize("share", [0.01, 0.04])
def test_outliers_anywhere_are_no_place(table, share):
    found = 0
    for seed in range(300):
        random = np.random.default_rng(seed)
        rows = np.flatnonzero(random.random(len(VISITS)) < share)
        errors = directions(random, len(rows), 1.0) * random.uniform(5e-4, 3e-3, (len(rows), 1))
        found += come_together(table, fit(random, dict(zip(rows, errors, strict=True)))).any()
    assert found <= 2


def test_a_reading_of_a_run_that_no_fit_saw_may_be_off_alone(table):
    locked = np.arange(len(VISITS)) // 24 % 4 == 2
    for seed in range(50):
        random = np.random.default_rng(seed)
        glitch, (error,) = random.choice(np.flatnonzero(locked)), directions(random, 1, 2e-3)
        off = fit(random, {glitch: error})
        assert np.flatnonzero(alone(table, off, locked)).tolist() == [glitch]
        assert not alone(table, off, ~locked).any()
        (told,) = in_words(table, off, alone(table, off, locked))
        size = 1e3 * np.linalg.norm(off.residual[glitch, :3])
        assert told.startswith(f"Reading {glitch + 2} is {size:.2g} mm off")
        beside = glitch + 1 if locked[glitch + 1] else glitch - 1  # the next in time
        assert not alone(table, fit(random, {glitch: error, beside: error}), locked).any()


def test_what_is_off_at_a_place_or_often_is_not_alone(table):
    everywhere = np.ones(len(VISITS), bool)
    random = np.random.default_rng(1)
    error = np.full(3, 1e-3)
    again = np.arange(len(VISITS)) % 120  # every place twice, long after one another
    apart = replace(table, beta=table.beta[2 * again], alpha=table.alpha[2 * again])
    assert alone(apart, fit(random, {30: error}), everywhere).sum() == 1
    assert not alone(apart, fit(random, {30: error, 150: error}), everywhere).any()
    few, many = np.arange(5, len(VISITS), 40), np.arange(5, len(VISITS), 20)
    assert alone(table, fit(random, dict.fromkeys(few, error)), everywhere).sum() == len(few)
    assert not alone(table, fit(random, dict.fromkeys(many, error)), everywhere).any()
