"""What is to be measured: the rows of a plan, each with the way it is approached."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.errors import InputError, Problem
from ctcr.table.csv_table import SHOWN
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]

DIRECTIONS = {"planned": 0.0, "forward": -1.0, "backward": 1.0}  # where the way point lies from the target


@dataclass(frozen=True)
class Approach:
    """How the joints come to a row: as planned, or always from below (forward) or above (backward)."""

    direction: str = "planned"
    translation: float = 2e-3  # [m] between way point and target
    rotation: float = np.deg2rad(5.0)  # [rad]

    @property
    def has_way_point(self) -> bool:
        return self.direction != "planned"


@dataclass(frozen=True)
class Step:
    """One row of the plan."""

    row: int  # of the plan's file
    run: int
    joints: Array  # (2N,) [m], [rad]
    way_point: Array | None  # (2N,)
    force: Array  # (3,) [N]


def steps_of(plan: Measurements, approach: Approach, limits: JointLimits, file: str) -> list[Step]:
    """Raises InputError with every row that the limits forbid."""
    steps, problems = [], []
    for i in range(len(plan)):
        joints = np.concatenate([plan.beta[i], plan.alpha[i]])
        n = plan.beta.shape[1]
        shift = DIRECTIONS[approach.direction] * np.repeat([approach.translation, approach.rotation], n)
        way_point = joints + shift if approach.has_way_point else None
        step = Step(int(plan.row[i]), int(plan.run[i]), joints, way_point, plan.force[i])
        problems += [Problem(text, file, step.row, line_name="row") for text in _faults(step, limits)]
        steps.append(step)
    if problems:
        raise InputError(problems[:SHOWN], omitted=max(0, len(problems) - SHOWN))
    return steps


def _faults(step: Step, limits: JointLimits) -> Iterator[str]:
    if text := limits.problem(step.joints):
        yield text
    elif step.way_point is not None and (text := limits.problem(step.way_point)):
        yield f"on its approach {text}"
