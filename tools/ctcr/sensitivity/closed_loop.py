"""Tracking errors of a controller with wrong parameters on the nominal robot (paper, Section V.A, Fig. 4)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import _core
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.model import parameters as free_parameters
from ctcr.robot.description import Robot
from ctcr.sensitivity.progress_file import ProgressFile
from ctcr.sensitivity.ranges import Varied
from ctcr.sensitivity.work import workers
from ctcr.track.runs import check, run_once
from ctcr.track.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Errors of the controller along one parameter's range: their increase over the nominal one [mm]."""

    varied: Varied
    fraction: Array  # (P,) of the range, -1 to 1
    mean: Array  # (P,) mean error less the nominal one; NaN: the run failed
    maximum: Array  # (P,)

    @property
    def worst_maximum(self) -> float:
        """Largest increase of the largest error [mm], at least 0; infinite where a run failed."""
        return _worst(self.maximum)

    @property
    def worst_mean(self) -> float:
        return _worst(self.mean)


@dataclass(frozen=True)
class ClosedLoop:
    """The study. `cumulated_*` is the worst case: every parameter adds its largest increase."""

    nominal_mean: float
    nominal_maximum: float
    curves: list[Curve]

    @property
    def cumulated_mean(self) -> float:
        return sum(curve.worst_mean for curve in self.curves)

    @property
    def cumulated_maximum(self) -> float:
        return sum(curve.worst_maximum for curve in self.curves)


@dataclass(frozen=True)
class Job:
    """One controller in all weights of the scenario, once each with the same noise."""

    scenario: str  # as JSON
    controller: Array
    plant: Array
    effects: Array


def work(job: Job) -> tuple[float, float]:
    """Mean and largest error [mm]; NaN where a run failed."""
    scenario = Scenario.model_validate_json(job.scenario)

    def values(parameters: Array) -> _core.SystemValues:
        return _core.SystemValues(parameters=parameters, effects=job.effects)

    runs = [run_once(scenario, values(job.controller), values(job.plant), mass) for mass in scenario.load.mass_g]
    if any(not run.started or run.status != "ok" for run in runs):
        return np.nan, np.nan
    error = 1e3 * np.concatenate([run.counted for run in runs])
    return float(error.mean()), float(error.max())


def study(
    robot: Robot,
    varied: list[Varied],
    scenario: Scenario,
    *,
    points: int = 5,
    dask: str | None = None,
    keep: str | None = None,
    advance: Callable[[float], None] = lambda amount: None,
) -> ClosedLoop:
    """The study at `points` places over each range, uneven so that the nominal robot is among them."""
    check(scenario, robot, robot)
    fractions = np.linspace(-1, 1, points)
    nominal = free_parameters.values(robot)
    cases = [nominal] + [one.at(fraction) for one in varied for fraction in fractions]
    text, own = scenario.model_dump_json(), catalogue.values(robot)
    jobs = [Job(text, case, nominal, own) for case in cases]
    settings = {"study": "closed loop", "scenario": text, "cases": [case.tolist() for case in cases]}
    kept = ProgressFile(keep, settings)
    found = kept.load() or []
    advance(len(found))
    with workers(dask) as in_order:
        for outcome in in_order(work, jobs[len(found) :]):
            found.append(outcome)
            if len(found) % points == 1:
                kept.save(found)
            advance(1)
    kept.save(found)
    if not np.isfinite(found[0]).all():
        raise InputError(Problem("even the controller that knows the robot fails in this scenario: `ctcr track` tells"))
    mean, maximum = (np.array([one[k] for one in found[1:]]).reshape(len(varied), points) for k in (0, 1))
    curves = [Curve(one, fractions, mean[k] - found[0][0], maximum[k] - found[0][1]) for k, one in enumerate(varied)]
    return ClosedLoop(found[0][0], found[0][1], curves)


def _worst(increase: Array) -> float:
    return max(float(np.max(increase)), 0.0) if np.isfinite(increase).all() else np.inf
