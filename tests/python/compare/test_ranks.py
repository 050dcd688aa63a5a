"""Rank tests agree with those of scipy.stats."""

import numpy as np
import pytest
from ctcr import ranks
from scipy.stats import mannwhitneyu, wilcoxon


@pytest.mark.parametrize("digits", [1, 9])
def test_agree(digits):
    """Few and many values, with ties and without, of larger and of smaller ones."""
    random = np.random.default_rng(digits)
    for _ in range(60):
        n, m = random.integers(1, random.choice([9, 60]), 2)
        first, second = (np.round(random.normal(random.normal(), 1, k), digits) for k in (n, m))
        agreed = mannwhitneyu(first, second, alternative="greater").pvalue
        assert ranks.greater(first, second) == pytest.approx(agreed, rel=1e-9, abs=1e-300)
        if digits > 1:  # with few ties scipy tries all permutations
            agreed = wilcoxon(first, alternative="greater").pvalue
            assert ranks.positive(first) == pytest.approx(agreed, rel=1e-9, abs=1e-300)


def test_ties():
    """Many signed values with ties, and with zeros, which say nothing."""
    random = np.random.default_rng(0)
    for mean in (-0.1, 0.0, 0.2):
        values = np.round(random.normal(mean, 1, 80), 1)
        assert (values == 0).any()
        assert ranks.positive(values) == pytest.approx(wilcoxon(values, alternative="greater").pvalue, rel=1e-9)
    assert np.isnan(ranks.positive(np.zeros(3)))
