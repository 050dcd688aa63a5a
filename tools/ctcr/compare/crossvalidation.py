"""Blocks of a table that may be treated as independent: how much of the error a linear form predicts on held-out ones,
and how much chance would give; standard errors by blocks.

Everything is computed from the normal equations of the blocks, so the cost does not grow with the number of trials.
A trial of chance flips the signs of whole blocks (runs or regions of joint space). That keeps all structure inside a
block and destroys only the structure that repeats from block to block, which the prediction of a new block needs.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers, evenly


@dataclass(frozen=True)
class Folds:
    """Assignment of rows to G blocks, held out in turn, and T random sign patterns for them."""

    label: Integers  # (K,) 0..G-1, ascending: a block is a slice of the rows
    signs: Array  # (1 + T, G), first row all ones: the data as they are

    @property
    def count(self) -> int:
        """Number of blocks G."""
        return self.signs.shape[1]

    def of(self, target: Array) -> "Folds":
        """The same folds for a target with several rows a reading, which stand together."""
        return Folds(np.repeat(self.label, len(target) // len(self.label)), self.signs)


def make_folds(label: Integers, trials: int, seed: int = 0) -> Folds:
    """Folds for ascending labels 0..G-1 with a fixed seed, so that a report can be repeated."""
    count = int(label.max()) + 1
    flips = np.random.default_rng(seed).choice([-1.0, 1.0], size=(trials, count))
    return Folds(label, np.vstack([np.ones((1, count)), flips]))


@dataclass(frozen=True)
class Regression:
    """Prediction of held-out blocks by a linear form: all that does not depend on the target is computed once."""

    design: Array  # (K, P)
    folds: Folds

    @cached_property
    def gram(self) -> Array:
        """Normal matrix X'X of every block (G, P, P)."""
        return self._products(self.design)

    @cached_property
    def inverses(self) -> list[Array]:
        """Of each ridge, inverse normal matrices (G, P, P) without each block in turn."""
        total = self.gram.sum(axis=0)
        square = np.diagonal(total)
        least = 1e-12 * max(square.max(), 1e-300)
        return [np.linalg.inv(total - self.gram + np.diag(ridge * square + least)) for ridge in settings.RIDGES]

    def unexplained(self, target: Array) -> Array:
        """Held-out sum of squares (1 + T,) of a target (K, C).

        The first value belongs to the data, the others to the sign patterns of chance.
        """
        cross, signs = self._products(target), self.folds.signs
        forms = [self._quadratic_form(inverse, cross) for inverse in self.inverses]
        return float(np.sum(target**2)) + np.min([np.sum((signs @ form) * signs, axis=1) for form in forms], axis=0)

    def predicted(self, target: Array) -> Array:
        """Prediction (K, C) of every row of a target from the blocks it does not belong to."""
        cross = self._products(target)
        inverse = min(self.inverses, key=lambda inverse: self._quadratic_form(inverse, cross).sum())
        coefficients = inverse @ (cross.sum(axis=0) - cross)
        return np.einsum("kp,kpc->kc", self.design, coefficients[self.folds.label])

    def _products(self, target: Array) -> Array:
        """X'y of every block (G, P, C)."""
        ends = np.searchsorted(self.folds.label, np.arange(self.folds.count + 1))
        parts = [slice(a, b) for a, b in pairwise(ends)]
        return np.stack([self.design[part].T @ target[part] for part in parts])

    def _quadratic_form(self, inverse: Array, cross: Array) -> Array:
        """Matrix Q (G, G) so that signs s of the blocks change the held-out sum of squares by s' Q s.

        The coefficients without block g are linear in the signs of the others, c_g = H_g sum_h s_h X_h'y_h, so the
        residual that they leave in block g, c_g' X_g'X_g c_g - 2 s_g c_g' X_g'y_g, is quadratic in the signs.
        """
        groups, width, axes = cross.shape
        parts = (inverse @ cross.transpose(1, 0, 2).reshape(width, -1)).reshape(groups, width, groups, axes)
        own = np.arange(groups)
        parts[own, :, own] = 0.0
        fitted = (self.gram @ parts.reshape(groups, width, -1)).reshape(parts.shape)
        by_source = parts.transpose(2, 0, 1, 3).reshape(groups, -1)
        square = by_source @ fitted.transpose(2, 0, 1, 3).reshape(groups, -1).T
        return square - 2 * np.sum(parts * cross[:, :, None, :], axis=(1, 3)).T


def chance(observed: float, trials: Array) -> float:
    """p-value: fraction of results at least as large as the observed one, which itself counts as one of them."""
    return float((1 + np.sum(trials >= observed)) / (1 + len(trials)))


def split(run: Integers, scaled: Array) -> tuple[Integers, Integers, str]:
    """Rows used, their blocks in ascending order, and the kind of the blocks: "runs", or "places" in joint space.

    run (K,); scaled (K, 2N) joints as lengths [m].
    A place is a region of joint space. It holds every pass through it, in both directions, so that nothing leaks from
    a pass to its return.
    """
    rows = evenly(len(run), settings.DEPENDENCE_ROWS)
    runs, label = np.unique(run[rows], return_inverse=True)
    kind = "runs" if len(runs) >= settings.FEWEST_BLOCKS else "places"
    if kind == "runs":
        label = (label * min(len(runs), settings.DEPENDENCE_BLOCKS)) // len(runs)
    else:
        label = _regions(scaled[rows])
    order = np.argsort(label, kind="stable")
    return rows[order], label[order], kind


def _regions(scaled: Array) -> Integers:
    """Region (K,) of each reading: halves along the widest joint, until there are REGIONS regions of equal size."""
    label = np.zeros(len(scaled), np.int64)
    for _ in range(int(np.log2(settings.REGIONS))):
        label *= 2
        for cell in np.unique(label):
            members = np.flatnonzero(label == cell)
            axis = np.argmax(np.ptp(scaled[members], axis=0))
            order = np.argsort(scaled[members, axis], kind="stable")
            label[members[order[len(order) // 2 :]]] += 1
    return np.unique(label, return_inverse=True)[1]


def segments(run: Integers) -> Integers:
    """Blocks (P,) of pairs of visits in measured order: runs if there are enough, else time segments of the path."""
    names, label = np.unique(run, return_inverse=True)
    in_time = np.arange(len(run)) * settings.PATH_SEGMENTS // max(len(run), 1)
    return label if len(names) >= settings.FEWEST_BLOCKS else in_time


def group_quantiles(values: Array, label: Integers, part: float) -> Array:
    """Quantile (G,) of each group of the values (K,), linear between two; label (K,) 0..G-1, each of which is there."""
    count = np.bincount(label)
    ordered, first = values[np.lexsort((values, label))], np.cumsum(count) - count
    place = part * (count - 1)
    below = np.floor(place).astype(np.int64)
    low, high = ordered[first + below], ordered[first + np.minimum(below + 1, count - 1)]
    return low + (place - below) * (high - low)


def block_error(values: Array, blocks: Integers) -> float:
    """Standard error of the mean of (P,) values whose blocks are independent of one another; NaN with one block."""
    count = np.bincount(blocks)
    total = np.bincount(blocks, values)[count > 0]
    count = count[count > 0]
    if len(count) < 2:
        return float("nan")
    deviation = total - values.mean() * count
    return float(np.sqrt(len(count) / (len(count) - 1) * np.sum(deviation**2)) / len(values))


def group_means(values: Array, label: Integers) -> Array:
    """Mean vector (G, C) of each group of the rows (K, C); label (K,) 0..G-1."""
    return np.stack([np.bincount(label, column) / np.bincount(label) for column in values.T], axis=1)
