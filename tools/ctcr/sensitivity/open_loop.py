"""Tip errors of wrong parameters over random configurations: sums, not samples, so memory does not grow with them."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ctcr import _core
from ctcr.arrays import Array
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.sensitivity.ranges import Varied, together
from ctcr.sensitivity.work import ProgressFile, workers

BLOCK = 1024  # configurations that share a seed
CHUNK = 16  # blocks a job
EDGES_MM = 1e3 * np.geomspace(1e-7, 1.0, 241)  # of the histogram's bins


@dataclass
class Totals:
    """Sums over the configurations so far: a column for each end of each parameter, the last for all together."""

    count: Array
    unsolved: Array
    sum: Array
    sum_of_squares: Array
    maximum: Array
    histogram: Array
    evaluations: float = 0.0
    seconds: float = 0.0  # of processors
    jobs: int = 0

    @classmethod
    def empty(cls, columns: int) -> "Totals":
        return cls(*(np.zeros(columns) for _ in range(5)), np.zeros((columns, len(EDGES_MM) - 1)))

    def add(self, part: dict[str, Any]) -> None:
        """Adds the result of the next job, in their order: the sums then do not depend on the worker."""
        for name in ("count", "unsolved", "sum", "sum_of_squares"):
            for row in part[name]:
                setattr(self, name, getattr(self, name) + row)
        self.maximum = np.maximum(self.maximum, np.max(part["maximum"], axis=0))
        self.histogram = self.histogram + part["histogram"]
        self.evaluations += part["evaluations"]
        self.seconds += part["seconds"]
        self.jobs += 1

    def as_state(self) -> dict[str, Any]:
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(self).items()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Totals":
        return cls(**{name: np.array(v) if isinstance(v, list) else v for name, v in state.items()})


@dataclass(frozen=True)
class Influence:
    """Tip errors that one parameter causes at the ends of its range [mm]."""

    name: str
    mean: float
    p95: float
    maximum: float
    unsolved: int


@dataclass(frozen=True)
class OpenLoop:
    """The study. `together` is that of all parameters drawn at random within their ranges."""

    configurations: int
    influences: list[Influence]
    together: Influence
    solved: float  # predictions of a tip
    evaluations: float  # of the model, several a prediction
    seconds: float = field(compare=False)  # of processors


def work(job: dict[str, Any]) -> dict[str, Any]:
    """Runs one job, plain data that a worker needs: the arguments of `_core.sensitivity`."""
    clock = time.thread_time if job["threads"] == 1 else time.process_time
    start, nominal = clock(), _core.SystemValues(parameters=job["nominal"], effects=np.empty(0))
    result = _core.sensitivity(**job | {"nominal": nominal})
    names = ("count", "unsolved", "sum", "sum_of_squares", "maximum", "histogram", "evaluations")
    return {name: getattr(result, name) for name in names} | {"seconds": clock() - start}


def study(
    robot: Robot,
    varied: list[Varied],
    configurations: int,
    *,
    most_force: float = 0.3,
    seed: int = 1,
    dask: str | None = None,
    keep: str | None = None,
    advance: Callable[[float], None] = lambda amount: None,
) -> OpenLoop:
    """The study over random configurations with tip forces up to `most_force` [N].

    `keep` names a file of progress: an interrupted study with the same options resumes from there. `dask` is the
    address of a scheduler. The result depends neither on `dask` nor on the number of cores.
    """
    ends, nominal = np.array([one.at(end) for one in varied for end in (-1.0, 1.0)]), parameters.values(robot)
    low, high = together(robot, varied)
    options = {"most_force": most_force, "seed": seed}
    shared = options | {"nominal": nominal, "varied": ends, "low": low, "high": high, "threads": 1}
    jobs = [{"tubes": robot.n_tubes, **shared, **piece} for piece in _pieces(configurations)]
    settings = {"nominal": nominal.tolist(), "ends": ends.tolist(), "configurations": configurations, **options}
    kept = ProgressFile(keep, {"study": "open loop", **settings})
    state = kept.load()
    totals = Totals.from_state(state) if state else Totals.empty(len(ends) + 1)
    done = totals.jobs
    advance(sum(job["blocks"] * job["configurations"] for job in jobs[:done]))
    with workers(dask) as in_order:
        for job, part in zip(jobs[done:], in_order(work, jobs[done:]), strict=True):
            totals.add(part)
            kept.save(totals.as_state())
            advance(job["blocks"] * job["configurations"])
    return _summary(varied, configurations, totals)


def _pieces(configurations: int) -> Iterator[dict[str, int]]:
    """The blocks of each job and the configurations of a block; the last block may be smaller."""
    whole, rest = divmod(configurations, BLOCK)
    for first in range(0, whole, CHUNK):
        yield {"first_block": first, "blocks": min(CHUNK, whole - first), "configurations": BLOCK}
    if rest:
        yield {"first_block": whole, "blocks": 1, "configurations": rest}


def _summary(varied: list[Varied], configurations: int, t: Totals) -> OpenLoop:
    def influence(name: str, columns: slice) -> Influence:
        count, unsolved = t.count[columns].sum(), int(t.unsolved[columns].sum())
        if not count:
            return Influence(name, np.nan, np.nan, np.nan, unsolved)
        mean, largest = 1e3 * t.sum[columns].sum() / count, 1e3 * t.maximum[columns].max()
        upper_bin = int(np.searchsorted(np.cumsum(t.histogram[columns].sum(axis=0)), 0.95 * count))
        return Influence(name, mean, min(EDGES_MM[upper_bin + 1], largest), largest, unsolved)

    each = [influence(one.name, slice(2 * k, 2 * k + 2)) for k, one in enumerate(varied)]
    all_at_once = influence("all together", slice(2 * len(varied), None))
    return OpenLoop(configurations, each, all_at_once, float(t.count.sum()), t.evaluations, t.seconds)
