"""The plan of a recording: its rows, each with its approach, checked against the limits."""

from dataclasses import dataclass

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.errors import InputError, Problem
from ctcr.table.csv_table import SHOWN
from ctcr.table.measurements import Measurements

DIRECTIONS = {"planned": 0.0, "forward": -1.0, "backward": 1.0}  # sign of the way point minus the target


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

    def problem(self, limits: JointLimits) -> str | None:
        """Which limit it violates; None where it is allowed."""
        if text := limits.problem(self.joints):
            return text
        text = None if self.way_point is None else limits.problem(self.way_point)
        return text and f"on its approach {text}"


def steps_of(plan: Measurements, approach: Approach, limits: JointLimits, file: str) -> list[Step]:
    """Raises InputError with every row that the limits forbid."""
    n = plan.beta.shape[1]
    shift = DIRECTIONS[approach.direction] * np.repeat([approach.translation, approach.rotation], n)
    steps = []
    for row, run, *parts, force in zip(plan.row, plan.run, plan.beta, plan.alpha, plan.force, strict=True):
        joints = np.concatenate(parts)
        steps.append(Step(int(row), int(run), joints, joints + shift if approach.has_way_point else None, force))
    texts = [(step.row, text) for step in steps if (text := step.problem(limits))]
    if texts:
        problems = [Problem(text, file, row, line_name="row") for row, text in texts[:SHOWN]]
        raise InputError(problems, omitted=len(texts) - len(problems))
    return steps
