"""Revisits: joints that were passed more than once, from which direction, and how far apart the errors are there.

Works for stops repeated exactly and for streams, where a pass never hits the same joints.

A reading is matched with the nearest point of an earlier pass over the (piecewise straight) joint path, and the
earlier error is interpolated along that path. Comparing errors instead of tip positions removes, to first order
in the model, the motion of the tip by the small joint difference itself.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask, evenly, scattered
from ctcr.compare.sample import Sample

SAME, OPPOSITE, MIXED = 1, -1, 0


@dataclass(frozen=True)
class Stops:
    """S visits: rows at rest are averaged into one visit, a moving row is a visit of its own."""

    first: Integers  # (S,) index of the first row
    size: Integers  # (S,) rows averaged
    run: Integers  # (S,)
    scaled: Array  # (S, 2N) [m]
    direction: NDArray[np.int8]  # (S, 2N)
    error: Array  # (S, 3) tracker frame [m]
    dwell_variance: Array  # (S,) variance per axis inside the visit [m^2], NaN below 3 rows


@dataclass(frozen=True)
class Revisits:
    """P pairs of a later visit with an earlier pass through the same joints."""

    later: Integers  # (P,) visit index
    earlier: Integers  # (P,) visit index at the start of the earlier step
    weight: Array  # (P,) position on the earlier step, 0 at its start, 1 at its end
    kind: NDArray[np.int8]  # (P,) SAME, OPPOSITE or MIXED directions of the joints
    between_runs: Mask  # (P,)
    difference: Array  # (P, 3) later error minus earlier error, tracker frame [m]
    miss: Array  # (P,) scaled joint distance between the two [m]
    noise_factor: Array  # (P,) variance of the difference in units of one reading's variance

    @property
    def square(self) -> Array:
        """Squared length of the differences (P,) [m^2]."""
        return np.sum(self.difference**2, axis=1)

    @property
    def end(self) -> Integers:
        """Visit index (P,) at the end of the earlier step; the start where the visit itself was hit."""
        return self.earlier + (self.weight > 0)

    def select(self, mask: Mask | Integers) -> "Revisits":
        """Some of the pairs."""
        return Revisits(*(getattr(self, field.name)[mask] for field in fields(self)))

    def inside(self, kind: int) -> "Revisits":
        """The pairs of one kind inside a run."""
        return self.select((self.kind == kind) & ~self.between_runs)

    def __len__(self) -> int:
        return len(self.later)


def find_stops(sample: Sample) -> Stops:
    """Join the rows of one run that stay within REST of the first of them."""
    scaled, run, error = sample.motion.scaled, sample.run, sample.error
    step, last = np.diff(scaled, axis=0), -1
    linked = np.append(False, run[1:] == run[:-1])
    rests = linked & np.append(False, np.linalg.norm(step, axis=1) <= settings.STILL)
    near = np.append(False, np.abs(step).max(axis=1, initial=0.0) <= settings.REST)
    first: list[int] = []
    for i in np.flatnonzero(~rests).tolist():
        alike = near[i] if last == i - 1 else np.abs(scaled[i] - scaled[last]).max() <= settings.REST
        if not (linked[i] and alike):
            first.append(i)
            last = i
    start = np.array(first, dtype=np.int64)
    size = np.diff(np.append(start, len(run)))

    def mean(values: Array) -> Array:
        return np.add.reduceat(values, start, axis=0) / size[:, None] if len(start) else values[:0]

    with np.errstate(divide="ignore", invalid="ignore"):
        variance = (mean(error**2) - mean(error) ** 2).mean(axis=1) * size / (size - 1)
    variance[size < 3] = np.nan
    direction = sample.motion.direction[start + size - 1]
    return Stops(start, size, run[start], mean(scaled), direction, mean(error), variance)


def find_revisits(stops: Stops, lever: float) -> Revisits:
    """All pairs of visits to the same joints, each later visit with each earlier pass once.

    lever [m]: the length that one radian of base rotation counts for in the scaled joints.
    """
    linked = np.append(stops.run[1:] == stops.run[:-1], False)
    link = np.where(linked[:, None], np.roll(stops.scaled, -1, axis=0) - stops.scaled, 0.0)
    length = np.linalg.norm(link, axis=1)
    usual = float(np.median(length[linked])) if linked.any() else 0.0
    tolerance = float(np.clip(settings.PASS_APART * usual, *settings.PASS_APART_BOUNDS))
    usable = linked & (length <= min(settings.LONGEST_LINK * usual, settings.LONGEST_LINK_TURN * lever))
    reach = float(np.hypot(tolerance, 0.5 * length[usable].max(initial=0.0)))

    later, vertex = _neighbours(stops.scaled, reach)
    order = np.lexsort((vertex, later))
    later, vertex = later[order], vertex[order]
    opens = (np.diff(later) != 0) | (np.diff(vertex) > 1) | (np.diff(stops.run[vertex]) != 0)
    which_pass = np.append(0, np.cumsum(opens))
    own = np.zeros(which_pass[-1] + 1, bool)  # passes that hold the later visit itself
    own[which_pass[vertex == later]] = True
    use = ~own[which_pass] & (vertex < later)
    later, vertex, which_pass = later[use], vertex[use], which_pass[use]

    miss, start, weight = _nearest_point(stops.scaled, link, length, usable, later, vertex)
    best = np.lexsort((miss, which_pass))
    best = best[np.unique(which_pass[best], return_index=True)[1]]
    best = best[miss[best] <= tolerance]
    later, start, weight, miss = later[best], start[best], weight[best], miss[best]
    order = np.argsort(later, kind="stable")
    return _pairs(stops, later[order], start[order], weight[order], miss[order])


def _neighbours(scaled: Array, reach: float) -> tuple[Integers, Integers]:
    """Index pairs (visit, neighbour) within reach, the visit itself included; thinned when there are too many."""
    tree = cKDTree(scaled)
    probe = evenly(len(scaled), settings.PROBES)
    typical = np.mean(tree.query_ball_point(scaled[probe], reach, return_length=True))
    queries = scattered(len(scaled), int(settings.MOST_NEIGHBOURS / typical))
    found = tree.query_ball_point(scaled[queries], reach)
    sizes = np.fromiter(map(len, found), np.int64, len(found))
    flat = np.concatenate([np.asarray(item, np.int64) for item in found])
    return np.repeat(queries, sizes), flat


def _nearest_point(scaled: Array, link: Array, length: Array, usable: Mask, later: Integers, vertex: Integers):
    """Nearest point to each later visit on the steps that meet in the neighbouring vertex: miss, start, weight."""
    best_miss = np.linalg.norm(scaled[later] - scaled[vertex], axis=1)
    best_start, best_weight = vertex.copy(), np.zeros(len(vertex))
    for start in (vertex, vertex - 1):
        start = np.maximum(start, 0)
        offset = scaled[later] - scaled[start]
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = np.clip(np.sum(offset * link[start], axis=1) / length[start] ** 2, 0.0, 1.0)
        miss = np.linalg.norm(offset - weight[:, None] * link[start], axis=1)
        better = usable[start] & (length[start] > 0) & (miss < best_miss - 1e-12)
        best_miss = np.where(better, miss, best_miss)
        best_start = np.where(better, start, best_start)
        best_weight = np.where(better, weight, best_weight)
    return best_miss, best_start, best_weight


def _pairs(stops: Stops, later, start, weight, miss) -> Revisits:
    end = np.minimum(start + (weight > 0), len(stops.run) - 1)
    agree = stops.direction[later].astype(int) * stops.direction[end]
    some = (agree != 0).any(axis=1)
    kind = np.full(len(later), MIXED, np.int8)
    kind[some & (agree >= 0).all(axis=1)] = SAME
    kind[some & (agree <= 0).all(axis=1)] = OPPOSITE
    w = weight[:, None]
    difference = stops.error[later] - (1 - w) * stops.error[start] - w * stops.error[end]
    factor = 1 / stops.size[later] + (1 - weight) ** 2 / stops.size[start] + weight**2 / stops.size[end]
    return Revisits(later, start, weight, kind, stops.run[later] != stops.run[start], difference, miss, factor)
