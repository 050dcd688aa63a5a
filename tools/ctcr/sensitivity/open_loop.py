"""Tip errors of wrong parameters over random configurations: sums, not samples, so memory does not grow with them."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ctcr import _core
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.sensitivity.ranges import Varied, together
from ctcr.sensitivity.work import ProgressFile, workers

BLOCK = 1024  # configurations that share a seed
CHUNK = 16  # blocks a job
EDGES_MM = 1e3 * np.geomspace(1e-7, 1.0, 241)  # of the histogram's bins
BY_BLOCK = ("count", "unsolved", "sum", "sum_of_squares")  # results of a job that hold a row a block
Totals = dict[str, Any]  # sums over configurations: a column for each end of each parameter, the last for all together


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
    names = (*BY_BLOCK, "maximum", "histogram", "evaluations")
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
    totals = {name: np.array(value) for name, value in state.items()} if state else no_totals(len(ends) + 1)
    done = int(totals["jobs"])
    advance(sum(job["blocks"] * job["configurations"] for job in jobs[:done]))
    with workers(dask) as in_order:
        for job, part in zip(jobs[done:], in_order(work, jobs[done:]), strict=True):
            _add(totals, part)
            kept.save({name: value.tolist() for name, value in totals.items()})
            advance(job["blocks"] * job["configurations"])
    return _summary(varied, configurations, totals)


def no_totals(columns: int) -> Totals:
    """The totals before the first job."""
    totals = {name: np.zeros(columns) for name in (*BY_BLOCK, "maximum")}
    totals |= {"histogram": np.zeros((columns, len(EDGES_MM) - 1))}
    return totals | {"evaluations": np.array(0.0), "seconds": np.array(0.0), "jobs": np.array(0)}


def _add(totals: Totals, part: dict[str, Any]) -> None:
    """Adds the result of the next job, in their order: the sums then do not depend on the worker."""
    for name in BY_BLOCK:
        for row in part[name]:
            totals[name] = totals[name] + row
    for name in ("histogram", "evaluations", "seconds"):
        totals[name] = totals[name] + part[name]
    totals["maximum"] = np.maximum(totals["maximum"], np.max(part["maximum"], axis=0))
    totals["jobs"] = totals["jobs"] + 1


def _pieces(configurations: int) -> Iterator[dict[str, int]]:
    """The blocks of each job and the configurations of a block; the last block may be smaller."""
    whole, rest = divmod(configurations, BLOCK)
    for first in range(0, whole, CHUNK):
        yield {"first_block": first, "blocks": min(CHUNK, whole - first), "configurations": BLOCK}
    if rest:
        yield {"first_block": whole, "blocks": 1, "configurations": rest}


def _summary(varied: list[Varied], configurations: int, t: Totals) -> OpenLoop:
    def influence(name: str, columns: slice) -> Influence:
        count, unsolved = t["count"][columns].sum(), int(t["unsolved"][columns].sum())
        if not count:
            return Influence(name, np.nan, np.nan, np.nan, unsolved)
        mean, largest = 1e3 * t["sum"][columns].sum() / count, 1e3 * t["maximum"][columns].max()
        upper_bin = int(np.searchsorted(np.cumsum(t["histogram"][columns].sum(axis=0)), 0.95 * count))
        return Influence(name, mean, min(EDGES_MM[upper_bin + 1], largest), largest, unsolved)

    each = [influence(one.name, slice(2 * k, 2 * k + 2)) for k, one in enumerate(varied)]
    all_at_once = influence("all together", slice(2 * len(varied), None))
    solved, evaluations, seconds = (float(t[name].sum()) for name in ("count", "evaluations", "seconds"))
    return OpenLoop(configurations, each, all_at_once, solved, evaluations, seconds)
