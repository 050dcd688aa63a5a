"""The backbone as a product of exponentials of constant-curvature elements, and the work of dead loads on it.

Element e carries the curvature u_e = (ux, uy, 0) in the torsion-free (Bishop) frame:
R_{e+1} = R_e exp(h u_e^), p_{e+1} = p_e + R_e h V(h u_e) e3.
"""

from dataclasses import dataclass
from math import factorial

import numpy as np

_TERMS = range(11)  # exact to rounding for element rotations up to 1 rad
_A = [(-1) ** k / factorial(2 * k + 1) for k in _TERMS]  # sin t / t in powers of t^2
_B = [(-1) ** k / factorial(2 * k + 2) for k in _TERMS]  # (1 - cos t) / t^2
_C = [(-1) ** k / factorial(2 * k + 3) for k in _TERMS]  # (t - sin t) / t^3


def _series(coefficients: list[float], t2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value f(t^2) and 2 f'(t^2), so that df/dw = (2 f') w for the rotation vector w."""
    ascending = np.array(coefficients)
    derivative = 2 * ascending[1:] * np.arange(1, ascending.size)
    return np.polyval(ascending[::-1], t2), np.polyval(derivative[::-1], t2)


def skew(v: np.ndarray) -> np.ndarray:
    """(..., 3) -> (..., 3, 3) with skew(v) w = v x w."""
    matrix = np.zeros((*v.shape, 3), dtype=v.dtype)
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return matrix - np.swapaxes(matrix, -1, -2)


@dataclass(frozen=True)
class Backbone:
    """Frames at the M+1 nodes in the base frame, and how each element moves what lies behind it."""

    rotation: np.ndarray  # (M+1, 3, 3) Bishop frame
    position: np.ndarray  # (M+1, 3) [m]
    turn: np.ndarray  # (M, 3, 2) A_e: rotation of all nodes beyond e per unit (ux, uy)
    shift: np.ndarray  # (M, 3, 2) B_e: translation of node e+1 per unit (ux, uy)


def make_backbone(u: np.ndarray, h: np.ndarray) -> Backbone:
    """Backbone for the curvatures u (M, 2) [1/m] of elements of length h (M,) [m]."""
    w = np.zeros((h.size, 3), dtype=u.dtype)
    w[:, :2] = h[:, None] * u
    t2 = np.sum(w * w, axis=1)
    (a, da), (b, db), (c, _) = (_series(coefficients, t2) for coefficients in (_A, _B, _C))
    cross, eye = skew(w), np.eye(3)
    cross2 = cross @ cross
    step_rotation = eye + a[:, None, None] * cross + b[:, None, None] * cross2
    left_jacobian = eye + b[:, None, None] * cross + c[:, None, None] * cross2
    step = h[:, None] * np.stack([b * w[:, 1], -b * w[:, 0], a], axis=1)
    d_step = np.zeros((h.size, 3, 2), dtype=u.dtype)  # derivative of `step` / h with respect to w
    d_step[:, 0] = (db * w[:, 1])[:, None] * w[:, :2]
    d_step[:, 1] = -(db * w[:, 0])[:, None] * w[:, :2]
    d_step[:, 2] = da[:, None] * w[:, :2]
    d_step[:, 0, 1] += b
    d_step[:, 1, 0] -= b

    rotation = np.empty((h.size + 1, 3, 3), dtype=u.dtype)
    rotation[0] = eye
    for e in range(h.size):
        rotation[e + 1] = rotation[e] @ step_rotation[e]
    start = rotation[:-1]
    position = np.zeros((h.size + 1, 3), dtype=u.dtype)
    np.cumsum((start @ step[:, :, None])[:, :, 0], axis=0, out=position[1:])
    return Backbone(
        rotation,
        position,
        turn=h[:, None, None] * (start @ left_jacobian[:, :, :2]),
        shift=(h**2)[:, None, None] * (start @ d_step),
    )


def _beyond(values: np.ndarray) -> np.ndarray:
    """Node values (M+1, ...) -> for each element the sum over all nodes beyond it (M, ...)."""
    return np.cumsum(values[::-1], axis=0)[::-1][1:]


def dead_load_work(backbone: Backbone, force: np.ndarray) -> float:
    """Work sum_j W_j . p_j of the node forces W (M+1, 3) [N]."""
    return np.sum(force * backbone.position)


def dead_load_gradient(backbone: Backbone, force: np.ndarray) -> np.ndarray:
    """Gradient (M, 2) of the work: B_e^T F_e + A_e^T M_e with the force and moment carried by element e."""
    carried, moment = _carried(backbone, force)
    return np.einsum("eij,ei->ej", backbone.shift, carried) + np.einsum("eij,ei->ej", backbone.turn, moment)


def _carried(backbone: Backbone, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position = backbone.position
    carried = _beyond(force)
    return carried, _beyond(np.cross(position, force)) - np.cross(position[1:], carried)


def dead_load_hessian(backbone: Backbone, force: np.ndarray) -> np.ndarray:
    """Hessian (2M, 2M) of the work.

    For e before f, d^2 p_j = A_e x (B_f + A_f x (p_j - p_{f+1})): element f is carried along rigidly. The block
    e = f is the mean of both orders, which leaves out terms of relative size (h u)^2 only; the gradient is exact,
    so Newton's method still ends at the exact equilibrium.
    """
    position, turn = backbone.position, backbone.turn
    carried = _beyond(force)
    outer = _beyond(position[:, :, None] * force[:, None, :]) - position[1:, :, None] * carried[:, None, :]
    trace = np.trace(outer, axis1=1, axis2=2)[:, None, None]
    lever = -skew(carried) @ backbone.shift + outer @ turn - trace * turn
    return _upstream_product(turn, lever)


def _upstream_product(upstream: np.ndarray, downstream: np.ndarray) -> np.ndarray:
    """(2M, 2M) with block (e, f) = upstream_e^T downstream_f for e < f, mirrored below, symmetric for e = f."""
    full = _columns(upstream).T @ _columns(downstream)
    block = np.arange(full.shape[0]) // 2
    upper = np.where(block[:, None] < block[None, :], full, 0.0)
    diagonal = np.where(block[:, None] == block[None, :], 0.5 * (full + full.T), 0.0)
    return upper + upper.T + diagonal


def _columns(blocks: np.ndarray) -> np.ndarray:
    """(M, 3, 2) -> (3, 2M)."""
    return np.swapaxes(blocks, 0, 1).reshape(3, -1)


def tip_moment_force(backbone: Backbone, moment: np.ndarray) -> tuple[np.ndarray, float]:
    """Generalised force of a constant tip moment (3,) [N m] on the curvatures (M, 2) and the tip angle of tube 1."""
    return np.einsum("eij,i->ej", backbone.turn, moment), backbone.rotation[-1, :, 2] @ moment


def tip_moment_stiffness(backbone: Backbone, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of `tip_moment_force` with respect to the curvatures: (2M, 2M), row = force, and (2M,).

    Not symmetric: a moment that keeps its direction in space has no potential. Elements turn only what lies beyond.
    """
    columns = _columns(backbone.turn)
    full = columns.T @ (skew(moment) @ columns)  # entry (e, f) = A_e . (l x A_f) = l . (A_f x A_e)
    block = np.arange(full.shape[0]) // 2
    stiffness = full * np.where(block[:, None] > block[None, :], 1.0, 0.5 * (block[:, None] == block[None, :]))
    return stiffness, columns.T @ np.cross(backbone.rotation[-1, :, 2], moment)
