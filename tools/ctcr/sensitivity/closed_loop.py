"""Tracking errors of a controller with wrong parameters on the nominal robot (paper, Section V.A, Fig. 4)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ctcr import _core
from ctcr.arrays import Array
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.sensitivity.ranges import Varied
from ctcr.sensitivity.work import ProgressFile, workers
from ctcr.track.result import errors_mm
from ctcr.track.runs import check, run_once
from ctcr.track.scenario import Scenario


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


def _worst(increase: Array) -> float:
    return max(float(np.max(increase)), 0.0) if np.isfinite(increase).all() else np.inf


@dataclass(frozen=True)
class ClosedLoop:
    """The study; errors [mm]. `cumulated_*` is the worst case: every parameter adds its largest increase."""

    nominal_mean: float
    nominal_maximum: float
    curves: list[Curve]

    @property
    def cumulated_mean(self) -> float:
        return sum(curve.worst_mean for curve in self.curves)

    @property
    def cumulated_maximum(self) -> float:
        return sum(curve.worst_maximum for curve in self.curves)


def work(text: str, nominal: Array, effects: Array, wrong: Array) -> tuple[float, float]:
    """Mean and largest error [mm] of a controller with the parameters `wrong`; NaN where a run failed.

    `text` is the scenario as JSON, since workers need plain data. One run for each weight, all with the same noise.
    """
    scenario = Scenario.model_validate_json(text)
    controller, plant = (_core.SystemValues(parameters=values, effects=effects) for values in (wrong, nominal))
    runs = [run_once(scenario, controller, plant, mass) for mass in scenario.load.mass_g]
    if any(not run.started or run.status != "ok" for run in runs):
        return np.nan, np.nan
    error = errors_mm(runs)
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
    """The study at `points` values over each range.

    `keep` and `dask` as in the open loop; `advance` is called with the number of controllers done.
    """
    check(scenario, robot, robot)
    fractions, nominal = np.linspace(-1, 1, points), parameters.values(robot)
    cases = [nominal] + [one.at(fraction) for one in varied for fraction in fractions]
    text = scenario.model_dump_json()
    errors_of = partial(work, text, nominal, catalogue.values(robot))
    settings = {"study": "closed loop", "scenario": text, "cases": [case.tolist() for case in cases]}
    kept = ProgressFile(keep, settings)
    found = kept.load() or []
    advance(len(found))
    with workers(dask) as in_order:
        for outcome in in_order(errors_of, cases[len(found) :]):
            found.append(outcome)
            if len(found) % points == 1:
                kept.save(found)
            advance(1)
    kept.save(found)
    if not np.isfinite(found[0]).all():
        raise InputError(Problem("even the controller that knows the robot fails in this scenario: see `ctcr track`"))
    increase = (np.array(found[1:]) - found[0]).reshape(len(varied), points, 2)
    curves = [Curve(one, fractions, *errors.T) for one, errors in zip(varied, increase, strict=True)]
    return ClosedLoop(*found[0], curves)
