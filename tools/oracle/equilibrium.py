"""Stable equilibria: Newton on the discrete energy, then Richardson extrapolation over refined grids."""

from dataclasses import dataclass

import numpy as np
from energy import Energy, Load
from grid import make_grid
from robot import Robot
from scipy.linalg import LinAlgError, cho_factor, cho_solve

ELEMENT_LENGTH = 4e-3  # [m] of the coarsest grid
REFINEMENTS = (1, 2, 4)  # grids whose errors in h^2 and h^4 are extrapolated away
MAX_ITERATIONS = 200
CONVERGED = 1e-8  # Newton step (see `_size`) after which quadratic convergence has left rounding errors only
LARGEST_STEP = 1.0  # the same measure: one step never goes farther


class NoEquilibriumError(RuntimeError):
    """The iteration did not reach a stable equilibrium."""


@dataclass(frozen=True)
class Pose:
    """Tip of a tube in the base frame: position (3,) [m], rotation (3, 3) of the tube's material frame."""

    position: np.ndarray
    rotation: np.ndarray


def solve_pose(
    robot: Robot,
    beta: np.ndarray,
    alpha: np.ndarray,
    load: Load | None = None,
    *,
    tube: int = 0,
    refinements: tuple[int, ...] = REFINEMENTS,
    element_length: float = ELEMENT_LENGTH,
) -> Pose:
    """Pose of the tip of `tube` (0 = innermost), extrapolated over the refinements of the element length [m]."""
    load = load or Load(np.zeros(3), np.zeros(3))
    twists, coarser = [], None
    for refinement in refinements:
        grid = make_grid(robot, beta, element_length, refinement)
        energy = Energy(robot, grid, beta, alpha, load.force)
        guess = energy.initial_guess() if coarser is None else carry_over(*coarser, energy)
        x = solve(energy, guess, load.moment)
        coarser = energy, x
        twists.append(tip_pose(energy, x, tube))
    return extrapolated(twists, refinements)


def solve(energy: Energy, guess: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Equilibrium near the guess: minimum of the energy, then followed while the tip moment (3,) [N m] grows."""
    x = minimise(energy, guess)
    if not np.any(moment):
        return x
    steps = max(1, int(np.ceil(np.linalg.norm(moment) / 5e-3)))
    for step in range(1, steps + 1):
        x = _balance(energy, x, moment * step / steps)
    return x


def minimise(energy: Energy, x: np.ndarray) -> np.ndarray:
    """Local minimum of the energy near x: Newton, Hessian shifted until positive definite, Armijo backtracking."""
    value = energy.value(x)
    for _ in range(MAX_ITERATIONS):
        gradient = energy.gradient(x)
        step, shifted = _descent_step(energy.hessian(x), gradient)
        size = _size(energy, step)
        if size < CONVERGED and not shifted:
            return x + step
        scale, slope = min(1.0, LARGEST_STEP / size), gradient @ step
        trial = energy.value(x + scale * step)
        while trial > value + 1e-4 * scale * slope and scale * size > CONVERGED:
            scale *= 0.5
            trial = energy.value(x + scale * step)
        x, value = x + scale * step, trial
    raise NoEquilibriumError("the energy minimisation did not converge")


def _balance(energy: Energy, x: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Root of gradient = generalised force of the tip moment, by Newton from a nearby equilibrium."""
    for _ in range(MAX_ITERATIONS):
        force, stiffness = energy.moment_residual(x, moment)
        step = np.linalg.solve(energy.hessian(x) - stiffness, force - energy.gradient(x))
        size = _size(energy, step)
        x = x + min(1.0, LARGEST_STEP / size) * step
        if size < CONVERGED:
            return x
    raise NoEquilibriumError("the balance with the tip moment did not converge")


def _descent_step(hessian: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, bool]:
    shift, diagonal = 0.0, np.diag(np.abs(np.diagonal(hessian)))
    while True:
        try:
            return -cho_solve(cho_factor(hessian + shift * diagonal), gradient), shift > 0
        except LinAlgError:
            shift = max(4 * shift, 1e-3)


def _size(energy: Energy, step: np.ndarray) -> float:
    """Largest change: angle in rad, or turn of the backbone over 0.1 m."""
    bends, angles = np.abs(step[: energy.bends]), np.abs(step[energy.bends :])
    return max(0.1 * np.max(bends, initial=0.0), np.max(angles), np.finfo(float).tiny)


def carry_over(last: Energy, x: np.ndarray, energy: Energy) -> np.ndarray:
    """A solution x on another grid, interpolated along the arc, as a guess for `energy`."""
    guess = energy.initial_guess()
    if last.grid.n_elements == 0:
        return guess
    old, new = (np.concatenate([[0.0], np.cumsum(e.grid.h)]) for e in (last, energy))
    old_centre, new_centre = 0.5 * (old[:-1] + old[1:]), 0.5 * (new[:-1] + new[1:])
    for axis in range(2):
        energy.curvature(guess)[:, axis] = np.interp(new_centre, old_centre, last.curvature(x)[:, axis])
    for i, (old_tip, new_tip) in enumerate(zip(last.grid.tip_node, energy.grid.tip_node, strict=True)):
        energy.theta(guess, i)[:] = np.interp(new[: new_tip + 1], old[: old_tip + 1], last.theta(x, i))
    return guess


def tip_pose(energy: Energy, x: np.ndarray, tube: int) -> Pose:
    """Pose of the tip of one tube; its material frame is the Bishop frame turned by the tube's angle."""
    backbone, node = energy.backbone(x), energy.grid.tip_node[tube]
    return Pose(backbone.position[node], turned(backbone.rotation[node], energy.theta(x, tube)[-1]))


def turned(frame: np.ndarray, angle: float) -> np.ndarray:
    """A torsion-free frame (3, 3) turned by a tube's angle: its material frame."""
    c, s = np.cos(angle), np.sin(angle)
    return frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def extrapolated(poses: list[Pose], refinements: tuple[int, ...]) -> Pose:
    """Polynomial in h^2 through the poses, at h = 0; the rotation is projected back onto SO(3)."""
    h2 = 1.0 / np.square(np.array(refinements, dtype=float))
    weights = [np.prod([other / (other - own) for other in h2 if other != own]) for own in h2]
    position = sum(w * pose.position for w, pose in zip(weights, poses, strict=True))
    left, _, right = np.linalg.svd(sum(w * pose.rotation for w, pose in zip(weights, poses, strict=True)))
    return Pose(position, left @ right)
