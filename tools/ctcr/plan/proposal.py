"""The runs that best discriminate between rival explanations of the measurements.

Each rival is a fit: a robot with an effect. A run discriminates where two rivals predict different readings that no
calibration within its priors can make alike. Runs are added one by one, each the one that raises the smallest expected
log evidence between any two rivals most (T-optimal design: Atkinson and Fedorov 1975).
"""

from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.fit import joint
from ctcr.model import user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Rival:
    """An explanation that the measurements leave open."""

    id: str
    fit: joint.Fit
    fixed: dict[str, float]  # values of parameters of effects that are not fitted


@dataclass(frozen=True)
class Run:
    """Stops between two configurations and back again, under one load."""

    beta: Array  # (2 stops, N) [m]
    alpha: Array  # (2 stops, N) [rad]
    mass: float  # hung at the tip [kg]


@dataclass(frozen=True)
class Proposal:
    rivals: list[Rival]
    now: float  # log evidence between the two nearest rivals
    runs: list[Run]
    gain: list[float]  # expected log evidence between those two after each further run
    plan: Measurements | None  # the runs, without poses

    @property
    def decides(self) -> bool:
        return bool(self.gain) and self.gain[-1] >= settings.DECISIVE


def rivals_of(diagnosis: Diagnosis) -> list[Rival]:
    """Fits of the first accepted effect that the measurements left undecided, and of its rivals."""
    shapes = [accepted.best.candidate.shape for accepted in diagnosis.accepted]
    for k, accepted in enumerate(diagnosis.accepted):
        round_, held = accepted.round, dict(pair for shape in shapes[:k] + shapes[k + 1 :] for pair in shape)
        rivals: dict[str, Rival] = {}
        for one in round_.tried:
            near = round_.accepted.score - one.score < settings.DECISIVE
            if one.fit is not None and (one.id in round_.ids or near):
                rivals.setdefault(one.id, Rival(one.id, one.fit, held | dict(one.candidate.shape)))
        if len(rivals) > 1:
            return [*rivals.values()]
    return []


def propose(diagnosis: Diagnosis, runs: int = 4, masses: tuple[float, ...] = (0.0, 0.01, 0.02)) -> Proposal:
    """The next `runs` runs; `masses` [kg] can be hung at the tip. Raises InputError where the model has no solution."""
    rivals = rivals_of(diagnosis)
    if len(rivals) < 2:
        return Proposal(rivals, np.inf, [], [], None)
    robot, measurements = diagnosis.robot, diagnosis.measurements
    offered = np.array(masses if robot.gravity is not None else (0.0,))
    pool = random_runs(robot, measurements, settings.PLAN_POOL, offered, np.random.default_rng(1))
    if not pool:
        return Proposal(rivals, _margin(rivals), [], [], None)
    plan = table(robot, pool)
    contests = [_contest(diagnosis, a, b, plan) for a, b in permutations(rivals, 2)]
    usable = np.flatnonzero(np.all([contest.solved for contest in contests], axis=0)).tolist()
    chosen: list[int] = []
    gain: list[float] = []
    while usable and len(chosen) < runs:
        value = {k: min(contest.evidence([*chosen, k]) for contest in contests) for k in usable}
        best = max(value, key=lambda k: value[k])
        chosen.append(best)
        usable.remove(best)
        gain.append(float(value[best]))
    picked = [pool[k] for k in chosen]
    first = int(measurements.run.max()) + 1
    return Proposal(rivals, _margin(rivals), picked, gain, table(robot, picked, first) if picked else None)


def _margin(rivals: list[Rival]) -> float:
    best, second = sorted((rival.fit.log_evidence for rival in rivals), reverse=True)[:2]
    return float(best - second)


class Contest:
    """The evidence of readings that follow one explanation against another one, by run, in normal equations.

    residual (rows,) and jacobian (rows, n) by the other's parameters, in units of the noise; run (rows,) from 0;
    covariance (n, n) of the other's parameters before these runs.
    """

    def __init__(self, residual: Array, jacobian: Array, run: Integers, covariance: Array) -> None:
        parts = [run == k for k in range(int(run.max()) + 1)]
        self.square = np.array([residual[part] @ residual[part] for part in parts])
        self.cross = np.array([jacobian[part].T @ residual[part] for part in parts])
        self.information = np.array([jacobian[part].T @ jacobian[part] for part in parts])
        self.known = np.linalg.inv(covariance)

    @property
    def solved(self) -> Mask:
        """Runs (count,) that both explanations predict."""
        return np.isfinite(self.square)

    def evidence(self, runs: list[int]) -> float:
        """Expected log evidence for the first explanation after these runs."""
        cross, information = self.cross[runs].sum(axis=0), self.information[runs].sum(axis=0)
        explained = cross @ np.linalg.solve(self.known + information, cross)
        return 0.5 * float(self.square[runs].sum() - explained)


def _contest(diagnosis: Diagnosis, truth: Rival, other: Rival, plan: Measurements) -> Contest:
    position, quaternion = _readings(diagnosis, truth, plan)
    seen = replace(plan, position=position, quaternion=quaternion)
    recorded = user_recording.recording_of(diagnosis.robot, seen, other.fit.names, fixed=other.fixed)
    residual, jacobian, _ = recorded.residual(other.fit.values, True)
    # The field error is the same for both: jitter remains, inflated as in the fit.
    noise = other.fit.noise
    sd = np.repeat([noise.position_jitter, noise.rotation_jitter], 3) * np.repeat(other.fit.inflation, 3)
    if diagnosis.measurements.quaternion is None:
        sd[3:] = np.inf
    weight = np.tile(1 / sd, len(plan))
    run = np.repeat(plan.run - plan.run[0], 6)
    return Contest(residual * weight, jacobian * weight[:, None], run, other.fit.covariance)


def _readings(diagnosis: Diagnosis, rival: Rival, plan: Measurements) -> tuple[Array, Array]:
    """What the tracker would read, (rows, 3) [m] and (rows, 4), NaN where the model has no solution."""
    recorded: Any = user_recording.recording_of(diagnosis.robot, plan, rival.fit.names, fixed=rival.fixed)
    recorded.residual(rival.fit.values)
    return recorded.predicted()


# ---- random runs


def random_runs(
    robot: Robot, measurements: Measurements, count: int, masses: Array, random: np.random.Generator
) -> list[Run]:
    """`count` runs that the robot can do; `masses` [kg] are those that can be hung at the tip.

    Joints stay within the measured range, tube tips in their measured order.
    """
    joints = np.hstack([measurements.beta, measurements.alpha])
    low, high = joints.min(axis=0), joints.max(axis=0)
    slack = _orders(measurements.beta, robot).min(axis=0)
    runs = []
    for _ in range(settings.PLAN_TRIES * count):
        ends = random.uniform(low, high, size=(2, len(low)))
        way = np.linspace(ends[0], ends[1], settings.PLAN_STOPS)
        beta, alpha = np.hsplit(np.vstack([way, way[::-1]]), 2)
        if (_orders(beta, robot) >= slack).all():
            runs.append(Run(beta, alpha, float(random.choice(masses))))
        if len(runs) == count:
            break
    return runs


def _orders(beta: Array, robot: Robot) -> Array:
    """How far each grasped point is behind the next tube's, and each tip beyond it (rows, 2 N - 2) [m]."""
    return np.hstack([np.diff(beta, axis=1), -np.diff(beta + robot.lengths, axis=1)])


def table(robot: Robot, runs: list[Run], first_run: int = 0) -> Measurements:
    """The runs one after the other as a table without poses."""
    stops = [len(run.beta) for run in runs]
    return Measurements.of_joints(
        beta=np.vstack([run.beta for run in runs]),
        alpha=np.vstack([run.alpha for run in runs]),
        t=settings.PLAN_STOP_S * np.arange(sum(stops)),
        run=np.repeat(first_run + np.arange(len(runs)), stops),
        force=np.repeat([run.mass for run in runs], stops)[:, None] * robot.gravity_vector,
    )
