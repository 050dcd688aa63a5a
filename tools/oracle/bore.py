"""Tubes with centre lines of their own, each inside the bore of the next: what looseness does, without a law for it.

Every tube bends by itself; what joins them is that a tube may lie anywhere in the bore that holds it and no farther.
The lean where an outer tube ends, the couple that is handed over there and the shares of the load all follow. Unknowns
are the curvature (ux, uy) of each element of each tube, in the torsion-free frame of its own centre line, and the angle
of each tube at each node in front of the plate:

    E = sum_i sum_e h [k_i |u_i|^2 / 2 - a_i u_i . (cos theta_i, sin theta_i)]     bending, each tube by itself
        + torsion in front of the plate and behind it, work of the loads on tube 1  as in energy.py
        + sum_i sum_j w_j K (|d_i| - g_i)_+^2 / 2                                   contact of tube i in tube i + 1

d_i(s) is the distance of the two centre lines, the double integral of the difference of their curvatures: exact up to
the gap times the curvature. g_i = (bore of tube i + 1 - outer diameter of tube i) / 2. Behind the plate the outermost
tube is held straight; the others lean in their bores there too, as far back as GUIDE, where they are centred.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from backbone import Backbone, dead_load_gradient, dead_load_hessian, dead_load_work, make_backbone
from energy import SHORTEST_TRANSMISSION, add_springs
from equilibrium import Pose, minimise, turned
from grid import make_grid
from robot import Robot

ELEMENT_LENGTH = 3e-3  # [m]
GUIDE = 40e-3  # [m] behind the plate: a lean dies out within some ten millimetres
# [N/m per metre]: tubes that press with 10 N on a millimetre yield to the last one by a micrometre; the rest lead to it
CONTACT_STIFFNESS = (1e5, 1e7, 1e9, 1e10)


def radial_gaps(robot: Robot) -> np.ndarray:
    """(N-1,) [m] by which tube i may leave the middle of tube i + 1."""
    return np.array([0.5 * (o.inner_diameter - i.outer_diameter) for i, o in pairwise(robot.tubes)])


@dataclass(frozen=True)
class Loose:
    """One robot at one joint position: elements from GUIDE behind the plate to the tip, and each tube along them."""

    h: np.ndarray  # (M,) [m]
    s: np.ndarray  # (M+1,) [m], 0 at the plate
    plate: int  # node
    first: np.ndarray  # (N,) element from which a tube bends
    tip: np.ndarray  # (N,) node
    stiffness: np.ndarray  # (N,) [N m^2]
    precurvature_moment: np.ndarray  # (N, M) [N m]
    twist_stiffness: np.ndarray  # (N,) [N m^2]
    base_stiffness: np.ndarray  # (N,) [N m/rad]
    alpha: np.ndarray  # (N,) [rad]
    node_force: np.ndarray  # (M+1, 3) [N]
    gap: np.ndarray  # (N-1,) [m]
    offset: np.ndarray  # (2N+1,) of the parts of the unknowns: curvatures of each tube, then angles of each tube

    @property
    def n(self) -> int:
        return self.tip.size

    def curvature(self, x: np.ndarray, tube: int) -> np.ndarray:
        """(elements of the tube, 2) view [1/m]."""
        return x[self.offset[tube] : self.offset[tube + 1]].reshape(-1, 2)

    def theta(self, x: np.ndarray, tube: int) -> np.ndarray:
        """(nodes from the plate to the tip,) view [rad]."""
        return x[self.offset[self.n + tube] : self.offset[self.n + tube + 1]]

    def along(self, x: np.ndarray, tube: int) -> np.ndarray:
        """(M, 2) curvature on all elements, zero where the tube is held."""
        whole = np.zeros((self.h.size, 2))
        whole[self.first[tube] : self.tip[tube]] = self.curvature(x, tube)
        return whole

    def backbone(self, x: np.ndarray) -> Backbone:
        """Of tube 1."""
        return make_backbone(self.along(x, 0), self.h)


def loose(robot: Robot, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray, gap: np.ndarray) -> Loose:
    """The robot with the tip force (3,) [N] and radial gaps (N-1,) [m]."""
    grid = make_grid(robot, beta, ELEMENT_LENGTH)
    start = np.maximum(beta, -GUIDE)
    behind = np.unique(np.concatenate([np.linspace(-GUIDE, 0.0, round(GUIDE / ELEMENT_LENGTH)), start[start < 0]]))
    behind = behind[behind >= start[0]]
    s, plate = np.concatenate([behind, np.cumsum(grid.h)]), behind.size - 1
    h = np.diff(s)
    first = np.array([int(np.argmin(np.abs(s - b))) for b in start])
    first[-1] = plate
    tip = plate + grid.tip_node
    torsion = np.array([tube.torsional_stiffness for tube in robot.tubes])
    node_force = np.zeros((s.size, 3))
    node_force[plate:] = grid.node_mass[:, None] * robot.gravity
    node_force[-1] += force
    sizes = [*(2 * (tip - first)), *(grid.tip_node + 1)]
    return Loose(
        h=h,
        s=s,
        plate=plate,
        first=first,
        tip=tip,
        stiffness=np.array([tube.bending_stiffness for tube in robot.tubes]),
        precurvature_moment=np.pad(grid.precurvature_moment, ((0, 0), (plate, 0))),
        twist_stiffness=torsion,
        base_stiffness=torsion / np.maximum(-beta, SHORTEST_TRANSMISSION),
        alpha=alpha,
        node_force=node_force,
        gap=gap,
        offset=np.concatenate([[0], np.cumsum(sizes)]),
    )


class LooseEnergy:
    """Energy of a configuration with a contact of some stiffness [N/m per metre]."""

    def __init__(self, robot: Loose, contact_stiffness: float) -> None:
        self.robot, self.bends = robot, int(robot.offset[robot.n])
        self._last: tuple[np.ndarray, tuple[float, np.ndarray, np.ndarray]] | None = None
        middle = 0.5 * (robot.s[1:] + robot.s[:-1])
        lever = robot.s[:, None] - middle
        # (M+1, M): displacement of a node per curvature of an element before it
        self._reach = robot.h * lever * (lever > 0)
        width = np.zeros(robot.s.size)
        width[1:] += 0.5 * robot.h
        width[:-1] += 0.5 * robot.h
        self._weight = contact_stiffness * width
        begins = np.append(robot.first[1:-1], robot.first[-2:-1])  # the outermost tube holds behind the plate, too
        self._held = [np.arange(max(a, 1), b + 1) for a, b in zip(begins, robot.tip[1:], strict=True)]

    def value(self, x: np.ndarray) -> float:
        """[J] up to a constant."""
        return self._at(x)[0]

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """(size,)."""
        return self._at(x)[1]

    def hessian(self, x: np.ndarray) -> np.ndarray:
        """(size, size), as exact as `dead_load_hessian`."""
        return self._at(x)[2]

    def _at(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """All three: the last ones are asked for again."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self._evaluated(x)
        return self._last[1]

    def _evaluated(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        robot, energy = self.robot, 0.0
        gradient, hessian = np.zeros_like(x), np.zeros((x.size, x.size))
        for tube in range(robot.n):
            energy += self._tube(x, tube, gradient, hessian)
        for pair in range(robot.n - 1):
            energy += self._contact(x, pair, gradient, hessian)
        backbone, own = robot.backbone(x), slice(0, robot.offset[1])
        energy -= dead_load_work(backbone, robot.node_force)
        gradient[own] -= dead_load_gradient(backbone, robot.node_force)[robot.first[0] :].ravel()
        skipped = 2 * robot.first[0]
        hessian[own, own] -= dead_load_hessian(backbone, robot.node_force)[skipped:, skipped:]
        return float(energy), gradient, hessian

    def _tube(self, x: np.ndarray, tube: int, gradient: np.ndarray, hessian: np.ndarray) -> float:
        robot = self.robot
        elements = slice(robot.first[tube], robot.tip[tube])
        h, u = robot.h[elements], robot.curvature(x, tube)
        k, at = robot.stiffness[tube], np.arange(robot.offset[tube], robot.offset[tube + 1])
        energy = 0.5 * k * np.sum(h[:, None] * u**2)
        gradient[at] += k * (h[:, None] * u).ravel()
        hessian[at, at] += k * np.repeat(h, 2)

        theta, node = robot.theta(x, tube), robot.offset[robot.n + tube]
        front = slice(robot.plate, robot.tip[tube])
        stiffness, stretch = robot.twist_stiffness[tube] / robot.h[front], np.diff(theta)
        turn = np.arange(node, node + stretch.size)
        energy += 0.5 * np.sum(stiffness * stretch**2)
        np.add.at(gradient, turn + 1, stiffness * stretch)
        np.add.at(gradient, turn, -stiffness * stretch)
        add_springs(hessian, turn, turn + 1, stiffness)
        base = robot.base_stiffness[tube]
        energy += 0.5 * base * (theta[0] - robot.alpha[tube]) ** 2
        gradient[node] += base * (theta[0] - robot.alpha[tube])
        hessian[node, node] += base

        moment = robot.h[front] * robot.precurvature_moment[tube, front]
        bent = u[robot.plate - robot.first[tube] :]
        middle = 0.5 * (theta[1:] + theta[:-1])
        c, s = np.cos(middle), np.sin(middle)
        energy -= np.sum(moment * (bent[:, 0] * c + bent[:, 1] * s))
        first = robot.offset[tube] + 2 * (robot.plate - robot.first[tube]) + 2 * np.arange(middle.size)
        gradient[first] -= moment * c
        gradient[first + 1] -= moment * s
        slope = 0.5 * moment * (bent[:, 0] * s - bent[:, 1] * c)
        curve = 0.25 * moment * (bent[:, 0] * c + bent[:, 1] * s)
        for a in (turn, turn + 1):
            np.add.at(gradient, a, slope)
            for b in (turn, turn + 1):
                np.add.at(hessian, (a, b), curve)
            for row, value in ((first, 0.5 * moment * s), (first + 1, -0.5 * moment * c)):
                hessian[row, a] += value
                hessian[a, row] += value
        return float(energy)

    def distance(self, x: np.ndarray, pair: int) -> np.ndarray:
        """(held nodes,) [m] between the centre lines of tube `pair` and the next one."""
        return np.linalg.norm(self._apart(x, pair), axis=1)

    def contact_force(self, x: np.ndarray, pair: int) -> np.ndarray:
        """(held nodes,) [N] with which tube `pair` presses on the next one."""
        return self._weight[self._held[pair]] * np.maximum(self.distance(x, pair) - self.robot.gap[pair], 0.0)

    def _apart(self, x: np.ndarray, pair: int) -> np.ndarray:
        return self._reach[self._held[pair]] @ (self.robot.along(x, pair) - self.robot.along(x, pair + 1))

    def _contact(self, x: np.ndarray, pair: int, gradient: np.ndarray, hessian: np.ndarray) -> float:
        robot, held, gap = self.robot, self._held[pair], self.robot.gap[pair]
        apart = self._apart(x, pair)
        distance = np.linalg.norm(apart, axis=1)
        touching = distance > gap
        if not np.any(touching):
            return 0.0
        reach, distance, weight = self._reach[held][touching], distance[touching], self._weight[held][touching]
        normal = apart[touching] / distance[:, None]
        depth = distance - gap
        push = (weight * depth)[:, None] * normal
        across = weight * depth / distance
        block = across[:, None, None] * np.eye(2) + (weight - across)[:, None, None] * (
            normal[:, :, None] * normal[:, None, :]
        )
        parts = [(pair, 1.0), (pair + 1, -1.0)]
        columns = {i: reach[:, robot.first[i] : robot.tip[i]] for i, _ in parts}
        for i, sign in parts:
            own = slice(robot.offset[i], robot.offset[i + 1])
            gradient[own] += sign * (columns[i].T @ push).ravel()
            for j, other in parts:
                at = slice(robot.offset[j], robot.offset[j + 1])
                for a in range(2):
                    for b in range(2):
                        hessian[own, at][a::2, b::2] += (
                            sign * other * (columns[i].T @ (block[:, a, b, None] * columns[j]))
                        )
        return 0.5 * float(np.sum(weight * depth**2))


def settle(robot: Loose) -> np.ndarray:
    """The unknowns of a stable equilibrium: from concentric tubes, while the contact grows stiff."""
    x = _concentric(robot)
    for stiffness in CONTACT_STIFFNESS:
        x = minimise(LooseEnergy(robot, stiffness), x)
    return x


def _concentric(robot: Loose) -> np.ndarray:
    """Tubes without torsion, all with the curvature of the unloaded bundle."""
    x, moment, stiffness = np.zeros(robot.offset[-1]), np.zeros((robot.h.size, 2)), np.zeros(robot.h.size)
    for tube, alpha in enumerate(robot.alpha):
        robot.theta(x, tube)[:] = alpha
        moment += robot.precurvature_moment[tube][:, None] * np.array([np.cos(alpha), np.sin(alpha)])
        stiffness[: robot.tip[tube]] += robot.stiffness[tube]
    for tube in range(robot.n):
        robot.curvature(x, tube)[:] = (moment / stiffness[:, None])[robot.first[tube] : robot.tip[tube]]
    return x


def loose_pose(
    robot: Robot, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray, gap: np.ndarray, sensor_tube: int = 0
) -> Pose:
    """Tip of a tube in the base frame, under a tip force (3,) [N], with radial gaps (N-1,) [m]."""
    here = loose(robot, beta, alpha, force, gap)
    return tip_of(here, settle(here), sensor_tube)


def tip_of(here: Loose, x: np.ndarray, tube: int = 0) -> Pose:
    """Pose of the tip of a tube in the base frame."""
    backbone, node = make_backbone(here.along(x, tube), here.h), here.tip[tube]
    turn = turned(backbone.rotation[node], here.theta(x, tube)[-1])
    return Pose(backbone.position[node] + np.array([0.0, 0.0, here.s[0]]), turn)
