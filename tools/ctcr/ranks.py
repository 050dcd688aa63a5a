"""One-sided rank tests, as of scipy.stats, whose import takes a second: p-values exact for few values without ties, by
the normal distribution with a correction for ties otherwise."""

import numpy as np
from scipy.special import ndtr

from ctcr.arrays import Array

FEW, FEW_SIGNED, MOST = 8, 50, 500  # of the smaller sample, of signed values, and of both samples together


def greater(first: Array, second: Array) -> float:
    """p-value of Mann's and Whitney's test: that values (N,) are no larger than others (M,) and come out so large."""
    n, m = len(first), len(second)
    rank, ties = _ranks(np.concatenate([first, second]))
    won, pairs = rank[:n].sum() - n * (n + 1) / 2, n * m
    if not ties and min(n, m) <= FEW and n + m <= MOST:
        few = min(n, m)
        ways = _ways(n + m, few)[few, few * (few + 1) // 2 :]  # by pairs won
        return float(ways[int(won) :].sum() / ways.sum())
    total = n + m
    return _tail(won - pairs / 2 - 0.5, pairs / 12 * (total + 1 - ties / (total * (total - 1))))


def positive(values: Array) -> float:
    """p-value of Wilcoxon's signed-rank test: that values (N,) lie about 0 and come out so large; NaN: all are 0."""
    some = values[values != 0]
    n = len(some)
    if not n:
        return np.nan
    rank, ties = _ranks(np.abs(some))
    won = rank[some > 0].sum()
    if not ties and n == len(values) <= FEW_SIGNED:
        ways = _ways(n, n).sum(axis=0)
        return float(ways[int(won) :].sum() / ways.sum())
    return _tail(won - n * (n + 1) / 4, (n * (n + 1) * (2 * n + 1) - ties / 2) / 24)


def _ranks(values: Array) -> tuple[Array, float]:
    """Ranks (K,) from 1, equal values share theirs, and the sum of t^3 - t over groups of t equal values."""
    _, where, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[where], float(np.sum(count**3 - count))


def _ways(total: int, most: int) -> Array:
    """In how many ways (most + 1, S) so many of the ranks 1..total have a sum from 0."""
    ways = np.zeros((most + 1, most * (2 * total - most + 1) // 2 + 1))
    ways[0, 0] = 1
    for rank in range(1, total + 1):
        ways[1:, rank:] += ways[:-1, : ways.shape[1] - rank].copy()
    return ways


def _tail(excess: float, variance: float) -> float:
    with np.errstate(divide="ignore"):
        return float(ndtr(-np.float64(excess) / np.sqrt(variance)))
