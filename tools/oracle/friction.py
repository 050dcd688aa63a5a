"""Dry friction between the tubes as a history process: incremental minimisation of stored and dissipated energy.

The tubes press on each other where the bending moment of the inner ones jumps (Lock and Dupont 2011: concentrated
moments at the plate, at curvature discontinuities and at tube ends). Each such contact is an elastic-plastic joint that
resists relative motion (rotation, axial slip / radius) with a torque of at most friction x moment jump. Over one small
move the dissipation x |slip| is minimised out in closed form, which leaves a Huber function of the motion since the
joint's anchor; the anchor then follows the slip. Axial slip turns the friction away from the torsion, as sliding does.
"""

from dataclasses import dataclass

import numpy as np
from energy import Energy
from equilibrium import Pose, carry_over, minimise, tip_pose
from grid import COINCIDENT, make_grid
from robot import Robot

LARGEST_ROTATION = np.deg2rad(1.0)  # of one small move
LARGEST_TRANSLATION = 0.2e-3  # [m]


@dataclass(frozen=True)
class FrictionLaw:
    """Torque limit = coefficient x |moment jump|; below it the contact yields like a spring."""

    coefficient: float  # [1]
    contact_stiffness: float  # [N m / rad]


class Contacts:
    """Joints between unknowns theta_a and theta_b of x; arrays have one entry per joint."""

    def __init__(
        self, a: np.ndarray, b: np.ndarray, limit: np.ndarray, anchor: np.ndarray, slid: np.ndarray, stiffness: float
    ) -> None:
        """Indices a, b (n,) into x; torque limit (n,) [N m]; anchor (n, 2) and slid (n,) [rad]; stiffness [N m/rad]."""
        self._a, self._b, self._limit, self._anchor, self._slid, self._k = (a, b, limit, anchor, slid, stiffness)

    def _stretch(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n, 2) motion since the anchor, its norm, and the secant stiffness min(k, limit / norm)."""
        stretch = np.stack([x[self._a] - x[self._b], self._slid], axis=1) - self._anchor
        norm = np.linalg.norm(stretch, axis=1)
        return stretch, norm, np.minimum(self._k, self._limit / np.maximum(norm, 1e-12))

    def value(self, x: np.ndarray) -> float:
        _, norm, secant = self._stretch(x)
        sticking = secant >= self._k
        slipping_value = self._limit * norm - 0.5 * self._limit**2 / self._k
        return float(np.sum(np.where(sticking, 0.5 * self._k * norm**2, slipping_value)))

    def add_gradient(self, x: np.ndarray, gradient: np.ndarray) -> None:
        stretch, _, secant = self._stretch(x)
        np.add.at(gradient, self._a, secant * stretch[:, 0])
        np.add.at(gradient, self._b, -secant * stretch[:, 0])

    def add_hessian(self, x: np.ndarray, hessian: np.ndarray) -> None:
        stretch, norm, secant = self._stretch(x)
        tangent = secant * np.where(secant < self._k, 1 - (stretch[:, 0] / np.maximum(norm, 1e-12)) ** 2, 1.0)
        for row, column, sign in ((self._a, self._a, 1), (self._b, self._b, 1), (self._a, self._b, -1)):
            np.add.at(hessian, (row, column), sign * tangent)
        np.add.at(hessian, (self._b, self._a), -tangent)

    def moved_anchor(self, x: np.ndarray) -> np.ndarray:
        """Anchors (n, 2) after the slip: each stretch is back on the limit."""
        stretch, _, secant = self._stretch(x)
        return self._anchor + stretch * (1 - secant / self._k)[:, None]


class FrictionEnergy(Energy):
    """Elastic energy plus the incremental energy of the contacts."""

    contacts: Contacts

    def value(self, x: np.ndarray) -> float:
        return super().value(x) + self.contacts.value(x)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        gradient = super().gradient(x)
        self.contacts.add_gradient(x, gradient)
        return gradient

    def hessian(self, x: np.ndarray) -> np.ndarray:
        hessian = super().hessian(x)
        self.contacts.add_hessian(x, hessian)
        return hessian


Place = tuple[int, str, int]  # inner tube of the pair; "plate", "start" or "tip"; tube the place belongs to


class FrictionalRobot:
    """A robot that remembers: `move_to` follows the straight line in joint space in small moves."""

    def __init__(self, robot: Robot, law: FrictionLaw, beta: np.ndarray, alpha: np.ndarray, element_length: float):
        """Starts at rest without friction torque at (beta, alpha)."""
        self._robot, self._law, self._element_length = robot, law, element_length
        self._beta, self._alpha = beta, alpha
        self._anchor: dict[Place, np.ndarray] = {}
        self._jump: dict[Place, float] = {}
        self._settle(beta, alpha, np.zeros(3), None)

    def move_to(self, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray) -> Pose:
        """Tip pose of tube 1 after the move, with the tip force (3,) [N] acting from its start."""
        from_beta, from_alpha = self._beta, self._alpha
        rotation, translation = np.max(np.abs(alpha - from_alpha)), np.max(np.abs(beta - from_beta))
        count = max(1, int(np.ceil(max(rotation / LARGEST_ROTATION, translation / LARGEST_TRANSLATION))))
        for part in np.arange(1, count + 1) / count:
            middle = from_beta + part * (beta - from_beta), from_alpha + part * (alpha - from_alpha)
            self._settle(*middle, force, (self._energy, self._x))
        self._beta, self._alpha = beta, alpha
        return tip_pose(self._energy, self._x, 0)

    def _settle(
        self, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray, last: tuple[Energy, np.ndarray] | None
    ) -> None:
        grid = make_grid(self._robot, beta, self._element_length)
        energy = FrictionEnergy(self._robot, grid, beta, alpha, force)
        x = energy.initial_guess() if last is None else carry_over(*last, energy)
        places = self._places(energy, beta)
        slid = np.array([self._slid(place, beta) for place in places])
        inner = np.array([place[0] for place in places], dtype=int)
        a, b = (energy.offset[tube] + np.array(list(places.values()), dtype=int) for tube in (inner, inner + 1))
        now = np.stack([x[a] - x[b], slid], axis=1)
        anchor = np.array([self._anchor.get(place, now[k]) for k, place in enumerate(places)]).reshape(-1, 2)
        limit = np.array([self._law.coefficient * self._jump.get(place, 0.0) for place in places])
        energy.contacts = Contacts(a, b, limit, anchor, slid, self._law.contact_stiffness)
        x = minimise(energy, x)
        self._energy, self._x = energy, x
        self._anchor = dict(zip(places, energy.contacts.moved_anchor(x), strict=True))
        self._jump = self._moment_jumps(places, beta)

    def _places(self, energy: Energy, beta: np.ndarray) -> dict[Place, int]:
        """Contacts in front of the plate and their grid nodes."""
        grid, places = energy.grid, {}
        for inner in range(len(self._robot.tubes) - 1):
            end = grid.tip_node[inner + 1]
            candidates = {("plate", 0): 0}
            candidates |= {("start", i): int(node) for i, node in enumerate(grid.curved_node)}
            candidates |= {("tip", i): int(node) for i, node in enumerate(grid.tip_node)}
            for (kind, tube), node in candidates.items():
                if node <= end and (node > 0 or kind == "plate") and end > 0:
                    places[(inner, kind, tube)] = node
        return places

    def _slid(self, place: Place, beta: np.ndarray) -> float:
        """Axial displacement of the inner tube in the outer one, as an angle at their interface."""
        inner = place[0]
        return float(beta[inner] - beta[inner + 1]) / (0.5 * self._robot.tubes[inner].outer_diameter)

    def _moment_jumps(self, places: dict[Place, int], beta: np.ndarray) -> dict[Place, float]:
        """|Jump| of the bending moment carried by all tubes inside the contact [N m]."""
        energy, grid = self._energy, self._energy.grid
        moments = np.zeros((len(self._robot.tubes), grid.n_elements + 2, 2))  # guide, elements, beyond the tip
        for i, tube in enumerate(self._robot.tubes):
            moments[i, 1 : grid.tip_node[i] + 1] = energy.bending_moment(self._x, i, tube.bending_stiffness)
            if tube.length + beta[i] - tube.curved_length < -COINCIDENT:  # precurved part held straight in the guide
                angle = energy.theta(self._x, i)[0]
                precurvature_moment = tube.bending_stiffness * tube.curvature
                moments[i, 0] = -precurvature_moment * np.array([np.cos(angle), np.sin(angle)])
        jumps = np.linalg.norm(np.diff(np.cumsum(moments, axis=0), axis=1), axis=2)
        return {place: float(jumps[place[0], node]) for place, node in places.items()}
