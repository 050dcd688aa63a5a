"""The simulated robot itself: goes from joint position to joint position and remembers what its history left.

Friction between the tubes and yielding of their material follow from incremental minimisation of stored plus dissipated
energy: after every small move each elastic-plastic joint's anchor has followed its slip.
"""

from itertools import product

import numpy as np
from bore import loose_pose
from equilibrium import Pose, extrapolated, turned
from grid import COINCIDENT
from kernel import Problem
from mechanics import Configuration, Mechanics, configure

LARGEST_ROTATION, LARGEST_TRANSLATION = np.deg2rad(1.0), 0.2e-3  # [rad], [m] of one small move
FIBRE = 1e-3  # [m] between the places along a tube where its material's state is kept
PULL_ITERATIONS, PULL_CONVERGED = 30, 1e-12  # of the direction of a cable's pull

Place = tuple[int, str, int]  # inner tube of the pair; "plate", "start" or "tip"; tube the place belongs to


class Specimen:
    """Starts at rest, without friction torque and with virgin material, at the first joint position it is given.

    Without history the poses are extrapolated over the refinements of the element length [m].
    """

    def __init__(
        self, mechanics: Mechanics, element_length: float, sensor_tube: int = 0, refinements: tuple[int, ...] = (1, 2)
    ) -> None:
        self.mechanics, self._element_length, self._sensor = mechanics, element_length, sensor_tube
        self._refinements = (1,) if mechanics.has_history else refinements  # a history belongs to one grid
        self._anchor: dict[Place, np.ndarray] = {}
        self._jump: dict[Place, float] = {}
        self._fibres = [np.zeros((round(tube.length / FIBRE) + 1, 2)) for tube in mechanics.robot.tubes]
        self._last: tuple[Configuration, Problem, np.ndarray] | None = None
        self._loose: dict[bytes, Pose] = {}  # of tubes with centre lines of their own: slow, and stops are revisited

    def settle(self, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray, time: float = 0.0) -> Pose:
        """Pose in the base frame after one small move to the joints beta (N,) [m], alpha (N,) [rad], with the known
        tip force (3,) [N]. Without history the way there does not matter."""
        mechanics = self.mechanics
        force = force + mechanics.tip_force
        if mechanics.bore_gap is not None:
            key = np.concatenate([beta, alpha, force]).tobytes()
            if key not in self._loose:
                self._loose[key] = loose_pose(mechanics.robot, beta, alpha, force, mechanics.bore_gap, self._sensor)
            return self._loose[key]
        poses = [self._equilibrium(beta, alpha, force, time, refinement) for refinement in self._refinements]
        return extrapolated(poses, self._refinements)

    def _equilibrium(
        self, beta: np.ndarray, alpha: np.ndarray, force: np.ndarray, time: float, refinement: int
    ) -> Pose:
        mechanics = self.mechanics
        here = configure(mechanics, beta, alpha, self._element_length, time, refinement)
        history = self._history(here, beta) if mechanics.has_history else {}
        problem = here.problem(force, **history)
        x = problem.minimise(self._guess(here, problem, alpha))
        if mechanics.cable_pull:
            problem, x = self._pulled(here, problem, x, force, history)
        if mechanics.has_history:
            self._remember(here, problem, x, beta, history)
        return _pose(here, problem, x, self._sensor)

    def _guess(self, here: Configuration, problem: Problem, alpha: np.ndarray) -> np.ndarray:
        x = np.zeros(problem.size)
        turn = problem.rotation_vectors(x)
        if self._last is None or not self.mechanics.has_history:
            stiffness = here.fields["stiffness"][:, 0]
            bent, carried = np.zeros((here.h.size, 2)), np.zeros(here.h.size)
            for i, angle in enumerate(alpha):
                problem.theta(x, i)[:] = angle
                deployed = np.arange(here.h.size) < here.tip_node[i]
                own = here.fields["precurvature"][i, :, :2] * deployed[:, None]
                c, s = np.cos(angle), np.sin(angle)
                bent += stiffness[i] * own @ np.array([[c, s], [-s, c]])
                carried += stiffness[i] * deployed
            turn[:] = here.h[:, None] * bent / np.maximum(carried, stiffness.min())[:, None]
            return x
        last, old, x_old = self._last
        bending, joint = last.h > 0, here.h == 0
        curvature = old.rotation_vectors(x_old)[bending] / last.h[bending, None]
        for axis in range(2):
            turn[:, axis] = here.h * np.interp(here.middle, last.middle[bending], curvature[:, axis])
        if joint.sum() == (~bending).sum():
            turn[joint] = old.rotation_vectors(x_old)[~bending]
        for i in range(alpha.size):
            n = here.tip_node[i] + 1
            old_theta = old.theta(x_old, i)
            problem.theta(x, i)[:] = np.interp(here.s[:n], last.s[: old_theta.size], old_theta)
        return x

    def _pulled(
        self, here: Configuration, problem: Problem, x: np.ndarray, force: np.ndarray, history: dict
    ) -> tuple[Problem, np.ndarray]:
        """The equilibrium in which the cable pulls backwards along the tip's own tangent."""
        pull = np.zeros(3)
        for _ in range(PULL_ITERATIONS):
            tangent = problem.frames(x)[1][here.tip_node[0], :, 2]
            change = -self.mechanics.cable_pull * tangent - pull
            pull = pull + change
            problem = here.problem(force + pull, **history)
            x = problem.minimise(x)
            if np.linalg.norm(change) < PULL_CONVERGED:
                break
        return problem, x

    def _history(self, here: Configuration, beta: np.ndarray) -> dict[str, np.ndarray]:
        history: dict[str, np.ndarray] = {}
        if self.mechanics.friction:
            law, offset = self.mechanics.friction, 2 * here.h.size + np.cumsum([0, *(here.tip_node + 1)])
            places = _places(here)
            inner = np.array([place[0] for place in places], dtype=int)
            node = np.array(list(places.values()), dtype=int)
            slid = np.array([self._slid(place, beta) for place in places])
            unknowns = np.stack([offset[inner] + node, offset[inner + 1] + node], axis=1)
            anchors = [self._anchor.get(place, np.full(2, np.nan)) for place in places]
            limit = [law.coefficient * self._jump.get(place, 0.0) for place in places]
            contact = np.column_stack(
                [limit, np.full(len(places), law.contact_stiffness), np.reshape(anchors, (-1, 2)), slid]
            )
            new = np.isnan(contact[:, 2])  # a contact that was not there starts with no limit, so no torque
            contact[new, 2:4] = 0.0
            contact[new, 0] = 0.0
            history |= {"contact_node": unknowns, "contact": contact}
        if self.mechanics.yielding:
            distance = here.middle[None, :] - beta[:, None]
            history["plastic_anchor"] = np.stack(
                [
                    np.stack([np.interp(d, FIBRE * np.arange(len(f)), f[:, axis]) for axis in range(2)], axis=1)
                    for d, f in zip(distance, self._fibres, strict=True)
                ]
            )
        return history

    def _remember(self, here: Configuration, problem: Problem, x: np.ndarray, beta: np.ndarray, history: dict) -> None:
        self._last = here, problem, x
        moment, deviation = problem.sections(x)
        if self.mechanics.friction:
            places, contact, unknowns = _places(here), history["contact"], history["contact_node"]
            now = np.stack([x[unknowns[:, 0]] - x[unknowns[:, 1]], contact[:, 4]], axis=1)
            stretch = now - contact[:, 2:4]
            norm = np.linalg.norm(stretch, axis=1)
            held = np.minimum(1.0, contact[:, 0] / np.maximum(contact[:, 1] * norm, 1e-300))
            anchor = now - held[:, None] * stretch
            self._anchor = dict(zip(places, anchor, strict=True))
            self._jump = self._moment_jumps(here, moment, problem, x, beta)
        if self.mechanics.yielding:
            self._follow_fibres(here, deviation, beta, history["plastic_anchor"])

    def _follow_fibres(self, here: Configuration, deviation: np.ndarray, beta: np.ndarray, anchor: np.ndarray) -> None:
        stretch = deviation - anchor
        norm = np.linalg.norm(stretch, axis=2, keepdims=True)
        moved = stretch * (1 - np.minimum(1.0, self.mechanics.yielding.curvature / np.maximum(norm, 1e-300)))
        for i, fibre in enumerate(self._fibres):
            inside = (np.arange(here.h.size) < here.tip_node[i]) & (here.h > 0)
            if not np.any(inside):
                continue
            distance = FIBRE * np.arange(len(fibre))
            middle = here.middle[inside] - beta[i]
            deployed = distance >= -beta[i]
            for axis in range(2):
                fibre[deployed, axis] += np.interp(distance[deployed], middle, moved[i, inside, axis])

    def _slid(self, place: Place, beta: np.ndarray) -> float:
        """Axial displacement of the inner tube in the outer one, as an angle at their interface."""
        inner = place[0]
        return float(beta[inner] - beta[inner + 1]) / (0.5 * self.mechanics.robot.tubes[inner].outer_diameter)

    def _moment_jumps(
        self, here: Configuration, moment: np.ndarray, problem: Problem, x: np.ndarray, beta: np.ndarray
    ) -> dict[Place, float]:
        """|Jump| of the bending moment carried by all tubes inside the contact [N m]."""
        n_tubes = len(self.mechanics.robot.tubes)
        padded = np.zeros((n_tubes, here.h.size + 2, 2))  # guide, elements, beyond the tip
        padded[:, 1:-1] = moment
        for e in np.flatnonzero(here.h == 0):  # a joint carries what comes out of it
            padded[:, e + 1] = moment[:, e + 1] if e + 1 < here.h.size else 0.0
        for i, tube in enumerate(self.mechanics.robot.tubes):
            if tube.length + beta[i] - tube.curved_length < -COINCIDENT:  # precurved part held straight in the guide
                angle, held = problem.theta(x, i)[0], tube.bending_stiffness * tube.curvature
                padded[i, 0] = -held * np.array([np.cos(angle), np.sin(angle)])
        jumps = np.linalg.norm(np.diff(np.cumsum(padded, axis=0), axis=1), axis=2)
        return {place: float(jumps[place[0], node]) for place, node in _places(here).items()}


def small_moves(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(K, 2N) joints (beta, alpha) on the straight line from start (excluded) to end, as close as history needs."""
    half = start.size // 2
    step = np.abs(end - start)
    rotation, translation = np.max(step[half:]), np.max(step[:half])
    count = max(1, int(np.ceil(max(rotation / LARGEST_ROTATION, translation / LARGEST_TRANSLATION))))
    return start + (np.arange(1, count + 1) / count)[:, None] * (end - start)


def _places(here: Configuration) -> dict[Place, int]:
    """Contacts between neighbouring tubes in front of the plate, and their nodes."""
    places: dict[Place, int] = {}
    tubes = range(here.tip_node.size)
    for inner in tubes[:-1]:
        end = int(here.tip_node[inner + 1])
        if end == 0:
            continue
        places[(inner, "plate", 0)] = 0
        for (kind, nodes), tube in product((("start", here.curved_node), ("tip", here.tip_node)), tubes):
            if 0 < nodes[tube] <= end:
                places[(inner, kind, tube)] = int(nodes[tube])
    return places


def _pose(here: Configuration, problem: Problem, x: np.ndarray, tube: int) -> Pose:
    position, rotation = problem.frames(x)
    node = here.tip_node[tube]
    return Pose(position[node], turned(rotation[node], problem.theta(x, tube)[-1]))
