"""The least distance from the path that any posture within the limits reaches: no controller can do better."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, minimize

from ctcr.arrays import Array
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.track.scenario import Limits, Scenario

REACHED = 1e-6  # [m]


def least_distance(robot: Robot, scenario: Scenario, mass_g: float, starts: int = 20) -> float:
    """The largest distance [m] of a corner of the path from the nearest tip that any posture within the limits has.

    `starts` random postures are moved towards each corner by sequential quadratic programming with the Jacobian,
    under the weight; a corner that one of them reaches counts 0.
    """
    model, force = Model(robot), scenario.force(mass_g)[None]
    room = Room.of(robot, scenario.limits)
    corners = np.unique(scenario.trajectory.points, axis=0)
    return max(_nearest(model, force, room, corner, starts, np.random.default_rng(1)) for corner in corners)


@dataclass(frozen=True)
class Room:
    """The joints (beta, alpha) (2N,) [m], [rad] that limits allow, as scipy takes them."""

    gaps: LinearConstraint  # of beta_i - beta_i+1; of the last tube: beta
    travel: Bounds

    @classmethod
    def of(cls, robot: Robot, limits: Limits) -> "Room":
        n, free = robot.n_tubes, np.full(robot.n_tubes, np.inf)
        low = -free if limits.beta_low_mm is None else 1e-3 * np.array(limits.beta_low_mm)
        high = free if limits.beta_high_mm is None else 1e-3 * np.array(limits.beta_high_mm)
        gaps = np.hstack([np.eye(n) - np.eye(n, k=1), np.zeros((n, n))])
        tips = 1e-3 * limits.tip_gap_mm + np.diff(robot.lengths, append=0)
        bases = np.full(n, -1e-3 * limits.base_gap_mm)
        return cls(LinearConstraint(gaps, tips, bases), Bounds(np.append(low, -free), np.append(high, free)))

    def drawn(self, random: np.random.Generator) -> Array:
        """Random positions within it (N,); drawn from the outermost tube inwards."""
        beta, after = np.empty(len(self.gaps.lb)), 0.0
        for i in reversed(range(len(beta))):
            low = max(self.gaps.lb[i] + after, self.travel.lb[i])
            high = min(self.gaps.ub[i] + after, self.travel.ub[i])
            beta[i] = after = random.uniform(low, max(low, high))
        return beta

    def holds(self, x: Array) -> bool:
        """Whether (beta, alpha) lies within it, up to rounding."""
        return all((left > -1e-6).all() for limit in (self.gaps, self.travel) for left in limit.residual(x))


def _nearest(model: Model, force: Array, room: Room, target: Array, starts: int, random: np.random.Generator) -> float:
    """The least distance [m] of the tip from the target (3,), of searches from `starts` random postures."""
    n, best = len(room.gaps.lb), np.inf

    def squared_mm(x: Array) -> tuple[float, Array]:
        tips = model.predict(x[None, :n], x[None, n:], force, derivatives=True)
        if not tips.solved[0]:
            return 1e6, np.zeros(2 * n)
        away = 1e3 * (tips.position[0] - target)
        return float(away @ away), 2e3 * tips.jacobian[0, :3].T @ away

    search = {"method": "SLSQP", "jac": True, "options": {"maxiter": 200, "ftol": 1e-9}}
    for _ in range(starts):
        start = np.append(room.drawn(random), random.uniform(-np.pi, np.pi, n))
        found = minimize(squared_mm, start, bounds=room.travel, constraints=room.gaps, **search)
        if room.holds(found.x):
            best = min(best, 1e-3 * np.sqrt(found.fun))
        if best < REACHED:
            return 0.0
    return best
