"""The runs that best discriminate between the explanations that a diagnosis left open.

Each explanation is a fit of the robot with its effects. It predicts the readings of a run and their uncertainty. If it
is true, new readings are expected to raise its log evidence over that of another one by the Kullback-Leibler divergence
of their predictions. Runs are added one by one: the next is that with which the true explanation is expected to gain
most over its nearest rival, in the mean over all explanations by their probability. Refs: Lindley 1956, "On a measure
of the information provided by an experiment"; T-optimal designs, Atkinson and Fedorov 1975.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.explanations import Explanation
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.diagnose.round import CandidateFit, parameters_of
from ctcr.errors import InputError
from ctcr.fit import joint
from ctcr.model import user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Rival:
    """An explanation that the measurements leave open, and its fit to them."""

    explanation: Explanation
    fit: joint.Fit
    fixed: dict[str, float]  # values of parameters of effects that are not fitted

    @property
    def probability(self) -> float:
        return self.explanation.probability

    def __str__(self) -> str:
        return self.explanation.text


@dataclass(frozen=True)
class Run:
    """Stops between two configurations and back again, under one load."""

    beta: Array  # (2 stops, N) [m]
    alpha: Array  # (2 stops, N) [rad]
    mass: float  # hung at the tip [kg]


@dataclass(frozen=True)
class Proposal:
    rivals: list[Rival]  # the most probable first
    runs: list[Run]
    gain: list[float]  # of the true one over its nearest rival: expected log evidence, with each further run
    plan: Measurements | None  # the runs, without poses

    @property
    def now(self) -> float:
        """Log evidence between the two most probable rivals."""
        first, second, *_ = (rival.probability for rival in self.rivals)
        return float(np.log(first / second))

    @property
    def decides(self) -> bool:
        return bool(self.gain) and self.gain[-1] >= settings.DECISIVE


def rivals_of(diagnosis: Diagnosis) -> list[Rival]:
    """The likeliest explanations by effects of the catalogue, or by noise alone, each fitted at the noise and weights
    of the diagnosis; none where one alone is likely, or the likeliest is a cause that nothing predicts."""
    likeliest, final = diagnosis.verdict.likeliest, diagnosis.final
    if len(likeliest) < 2 or likeliest[0].outside:
        return []
    measurements = diagnosis.measurements
    engine = Engine(diagnosis.robot, measurements, final.noise, ~diagnosis.held_out, tolerance=settings.COARSE)
    rivals = []
    for explanation in likeliest:
        if explanation.outside:
            continue
        fits = _fits_of(diagnosis, explanation.effects)
        names, fixed = parameters_of(fits)
        start = fixed | {name: value for one in fits for name, value in values_of(one.fit).items()} | values_of(final)
        try:
            fit = engine.fit_like(final, names, start, fixed=fixed)
        except InputError:  # it has no solution for these readings
            continue
        rivals.append(Rival(explanation, fit, fixed))
    return rivals if len(rivals) > 1 else []


def _fits_of(diagnosis: Diagnosis, effects: Collection[str]) -> list[CandidateFit]:
    """The fit of each effect in the form that the diagnosis accepted, or that gained most in a round."""
    known = {one.id: one for round_ in diagnosis.rounds for one in reversed(round_.best) if one.fit}
    known |= {accepted.id: accepted.best for accepted in diagnosis.accepted}
    return [known[identity] for identity in sorted(effects)]


def propose(diagnosis: Diagnosis, runs: int = 4, masses: tuple[float, ...] = (0.0, 0.01, 0.02)) -> Proposal:
    """The next `runs` runs; `masses` [kg] can be hung at the tip. Raises InputError where the model has no solution."""
    rivals = rivals_of(diagnosis)
    if not rivals:
        return Proposal([], [], [], None)
    robot, measurements = diagnosis.robot, diagnosis.measurements
    offered = np.array(masses if robot.gravity is not None else (0.0,))
    pool = random_runs(robot, measurements, settings.PLAN_POOL, offered, np.random.default_rng(1))
    if not pool:
        return Proposal(rivals, [], [], None)
    contests = _contests(diagnosis, rivals, table(robot, pool))
    usable = np.flatnonzero(np.all([contest.solved for of in contests for contest in of], axis=0)).tolist()
    chosen: list[int] = []
    gain: list[float] = []

    def expected(runs: list[int]) -> float:
        shares = np.array([rival.probability for rival in rivals])
        return float(shares @ [min(one.evidence(runs) for one in of) for of in contests] / shares.sum())

    while usable and len(chosen) < runs:
        value = {k: expected([*chosen, k]) for k in usable}
        best = max(value, key=lambda k: value[k])
        chosen.append(best)
        usable.remove(best)
        gain.append(value[best])
    picked = [pool[k] for k in chosen]
    first = int(measurements.run.max()) + 1
    return Proposal(rivals, picked, gain, table(robot, picked, first) if picked else None)


class Contest:
    """The evidence of readings that follow one explanation against another one, by run, in normal equations.

    residual (rows,) between the two predictions; own (rows, n) and other (rows, m): derivatives of the predictions by
    parameters that are independent and of unit variance before these runs; all in units of the noise.
    run (rows,), counted from 0.
    """

    def __init__(self, residual: Array, own: Array, other: Array, run: Integers) -> None:
        parts = [run == k for k in range(int(run.max()) + 1)]

        def by_run(a: Array, b: Array) -> Array:
            return np.array([a[part].T @ b[part] for part in parts])

        self.square, self.cross = by_run(residual, residual), by_run(other, residual)
        self.own, self.other, self.mixed = by_run(own, own), by_run(other, other), by_run(other, own)

    @property
    def solved(self) -> Mask:
        """Runs (count,) that both explanations predict."""
        return np.isfinite(self.square)

    def evidence(self, runs: list[int]) -> float:
        """Expected log evidence for the first explanation after these runs: the divergence of normal distributions with
        the covariances 1 + own own^T and 1 + other other^T."""
        square, cross, own, other, mixed = (
            part[runs].sum(axis=0) for part in (self.square, self.cross, self.own, self.other, self.mixed)
        )
        known, of_own = np.eye(len(other)) + other, np.eye(len(own)) + own
        explained = np.linalg.solve(known, np.column_stack([cross, other, mixed]))
        by_cross, by_other, by_mixed = explained[:, 0], explained[:, 1 : 1 + len(other)], explained[:, 1 + len(other) :]
        spread = np.trace(own) - np.trace(by_other) - np.sum(mixed * by_mixed)
        volume = np.linalg.slogdet(known)[1] - np.linalg.slogdet(of_own)[1]
        return 0.5 * float(square - cross @ by_cross + spread + volume)


def _contests(diagnosis: Diagnosis, rivals: list[Rival], plan: Measurements) -> list[list[Contest]]:
    """Of each rival against each of the others."""
    # The field error is the same for all: jitter remains, inflated as in the fit.
    noise, inflation = diagnosis.final.noise, diagnosis.final.inflation
    sd = np.repeat([noise.position_jitter, noise.rotation_jitter], 3) * np.repeat(inflation, 3)
    if diagnosis.measurements.quaternion is None:
        sd[3:] = np.inf
    weight = np.tile(1 / sd, len(plan))
    run = np.repeat(plan.run - plan.run[0], 6)

    def recorded(rival: Rival, seen: Measurements) -> Any:
        return user_recording.recording_of(diagnosis.robot, seen, rival.fit.names, fixed=rival.fixed)

    seen, derivatives = {}, {}
    for k, rival in enumerate(rivals):
        of_plan = recorded(rival, plan)
        of_plan.residual(rival.fit.values)
        position, quaternion = of_plan.predicted()
        seen[k] = replace(plan, position=position, quaternion=quaternion)
        jacobian = recorded(rival, seen[k]).residual(rival.fit.values, True)[1]
        derivatives[k] = weight[:, None] * jacobian @ _root(rival.fit.covariance)

    def contest(own: int, other: int) -> Contest:
        residual = recorded(rivals[other], seen[own]).residual(rivals[other].fit.values)[0]
        return Contest(weight * residual, derivatives[own], derivatives[other], run)

    every = range(len(rivals))
    return [[contest(own, other) for other in every if other != own] for own in every]


def _root(covariance: Array) -> Array:
    """R (n, n) with R R^T the covariance, which may be singular where parameters are known exactly."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


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
