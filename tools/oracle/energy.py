"""Discrete potential energy of concentric tubes: value, exact gradient, Hessian.

Unknowns x = (curvature of each element (ux, uy) in the Bishop frame, angle theta_i at each node of each tube):

    E(x) = sum_e h [K |u|^2 / 2 - u . sum_i a_i (cos theta_i, sin theta_i)]        bending, theta_i at mid-element
         + sum_i sum_e GJ_i (theta_i,e+1 - theta_i,e)^2 / (2 h)                    torsion in front of the plate
         + sum_i GJ_i (theta_i,0 - alpha_i)^2 / (-2 beta_i)                        torsion of the straight transmission
         - F . p_tip - sum_j m_j g . p_j                                           tip force and weight

All errors of the discretisation are even in h.
"""

from dataclasses import dataclass

import numpy as np
from backbone import (
    Backbone,
    dead_load_gradient,
    dead_load_hessian,
    dead_load_work,
    make_backbone,
    tip_moment_force,
    tip_moment_stiffness,
)
from grid import Grid
from robot import Robot

SHORTEST_TRANSMISSION = 1e-9  # [m] stands for a tube grasped in the plate itself


@dataclass(frozen=True)
class Load:
    """Tip load in the base frame: force (3,) [N] and moment (3,) [N m], the latter on tube 1."""

    force: np.ndarray
    moment: np.ndarray


class Energy:
    """Energy of one robot at one joint position (beta, alpha) on one grid."""

    def __init__(self, robot: Robot, grid: Grid, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray) -> None:
        self.grid, self.alpha = grid, alpha
        torsion = np.array([tube.torsional_stiffness for tube in robot.tubes])
        self._base_stiffness = torsion / np.maximum(-beta, SHORTEST_TRANSMISSION)
        self._node_force = grid.node_mass[:, None] * robot.gravity
        self._node_force[-1] += force
        self._loaded = bool(np.any(self._node_force))
        self.offset = 2 * grid.n_elements + np.concatenate([[0], np.cumsum(grid.tip_node + 1)])
        self.size, self.bends = int(self.offset[-1]), 2 * grid.n_elements  # the unknowns, those that are curvatures
        self._twist_stiffness = [gj / grid.h[:n] for gj, n in zip(torsion, grid.tip_node, strict=True)]

    def theta(self, x: np.ndarray, tube: int) -> np.ndarray:
        """Angles of one tube at its nodes (a view into x)."""
        return x[self.offset[tube] : self.offset[tube + 1]]

    def curvature(self, x: np.ndarray) -> np.ndarray:
        """(M, 2) view into x."""
        return x[: 2 * self.grid.n_elements].reshape(-1, 2)

    def backbone(self, x: np.ndarray) -> Backbone:
        return make_backbone(self.curvature(x), self.grid.h)

    def initial_guess(self) -> np.ndarray:
        """Tubes without torsion, backbone in the equilibrium of the unloaded bending moments."""
        x = np.empty(self.size)
        for i, alpha in enumerate(self.alpha):
            self.theta(x, i)[:] = alpha
        self.curvature(x)[:] = self._precurvature(x)[0] / self.grid.stiffness[:, None]
        return x

    def _precurvature(self, x: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Sum of the tubes' precurvature moments (M, 2), and each tube's own over its curved elements."""
        total, own = np.zeros((self.grid.n_elements, 2), dtype=x.dtype), []
        for i, (start, tip) in enumerate(zip(self.grid.curved_node, self.grid.tip_node, strict=True)):
            theta = self.theta(x, i)
            middle = 0.5 * (theta[start:-1] + theta[start + 1 :])
            moment = self.grid.precurvature_moment[i, start:tip, None]
            own.append(moment * np.stack([np.cos(middle), np.sin(middle)], axis=1))
            total[start:tip] += own[-1]
        return total, own

    def bending_moment(self, x: np.ndarray, tube: int, stiffness: float) -> np.ndarray:
        """(tip_node, 2) moment k_i u - a_i (cos, sin) carried by one tube in the Bishop frame [N m]."""
        moment = stiffness * self.curvature(x)[: self.grid.tip_node[tube]]
        moment[self.grid.curved_node[tube] :] -= self._precurvature(x)[1][tube]
        return moment

    def value(self, x: np.ndarray) -> float:
        """Energy [J] up to a constant."""
        u = self.curvature(x)
        energy = np.sum(self.grid.h[:, None] * u * (0.5 * self.grid.stiffness[:, None] * u - self._precurvature(x)[0]))
        for i, alpha in enumerate(self.alpha):
            theta = self.theta(x, i)
            energy += 0.5 * np.sum(self._twist_stiffness[i] * np.diff(theta) ** 2)
            energy += 0.5 * self._base_stiffness[i] * (theta[0] - alpha) ** 2
        return energy - dead_load_work(self.backbone(x), self._node_force) if self._loaded else energy

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """(size,) exact gradient of `value`."""
        u, h = self.curvature(x), self.grid.h[:, None]
        total, own = self._precurvature(x)
        gradient = np.empty_like(x)
        of_u = self.curvature(gradient)
        of_u[:] = h * (self.grid.stiffness[:, None] * u - total)
        for i, (start, tip) in enumerate(zip(self.grid.curved_node, self.grid.tip_node, strict=True)):
            theta, of_theta = self.theta(x, i), self.theta(gradient, i)
            twist = self._twist_stiffness[i] * np.diff(theta)
            of_theta[:] = np.concatenate([[0.0], twist]) - np.concatenate([twist, [0.0]])
            of_theta[0] += self._base_stiffness[i] * (theta[0] - self.alpha[i])
            half = 0.5 * h[start:tip, 0] * (u[start:tip, 0] * own[i][:, 1] - u[start:tip, 1] * own[i][:, 0])
            of_theta[start:-1] += half
            of_theta[start + 1 :] += half
        if self._loaded:
            of_u -= dead_load_gradient(self.backbone(x), self._node_force)
        return gradient

    def hessian(self, x: np.ndarray) -> np.ndarray:
        """(size, size) Hessian, exact but for the relative (h u)^2 of `dead_load_hessian`."""
        u, h = self.curvature(x), self.grid.h
        _, own = self._precurvature(x)
        hessian = np.zeros((self.size, self.size))
        n = 2 * self.grid.n_elements
        if self._loaded:
            hessian[:n, :n] = -dead_load_hessian(self.backbone(x), self._node_force)
        diagonal = np.arange(n)
        hessian[diagonal, diagonal] += np.repeat(h * self.grid.stiffness, 2)
        for i, (start, tip) in enumerate(zip(self.grid.curved_node, self.grid.tip_node, strict=True)):
            node = self.offset[i] + np.arange(tip)
            add_springs(hessian, node, node + 1, self._twist_stiffness[i])
            hessian[self.offset[i], self.offset[i]] += self._base_stiffness[i]
            element, node = np.arange(start, tip), node[start:]
            quarter = 0.25 * h[start:tip] * np.sum(u[start:tip] * own[i], axis=1)
            for a in (node, node + 1):
                for b in (node, node + 1):
                    hessian[a, b] += quarter
                for axis, slope in ((0, own[i][:, 1]), (1, -own[i][:, 0])):
                    hessian[2 * element + axis, a] += 0.5 * h[start:tip] * slope
                    hessian[a, 2 * element + axis] += 0.5 * h[start:tip] * slope
        return hessian

    def moment_residual(self, x: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Generalised force (size,) of a tip moment and its derivative (size, size), not symmetric."""
        backbone, n = self.backbone(x), 2 * self.grid.n_elements
        force, stiffness = np.zeros(self.size), np.zeros((self.size, self.size))
        of_u, force[self.offset[1] - 1] = tip_moment_force(backbone, moment)
        force[:n] = of_u.ravel()
        stiffness[:n, :n], stiffness[self.offset[1] - 1, :n] = tip_moment_stiffness(backbone, moment)
        return force, stiffness


def add_springs(hessian: np.ndarray, a: np.ndarray, b: np.ndarray, stiffness: np.ndarray) -> None:
    """Springs (n,) between the unknowns a and b (n,), no unknown twice in either."""
    hessian[a, a] += stiffness
    hessian[b, b] += stiffness
    hessian[a, b] -= stiffness
    hessian[b, a] -= stiffness
