"""What no accepted effect explains: whether it has structure, and what it depends on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import identify
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.race import is_rejected
from ctcr.measurements import Measurements
from ctcr.robot import Robot

Array = NDArray[np.float64]
SHARE = 0.05  # of the leftover that a dependence must predict on runs that it was not learned from


@dataclass(frozen=True)
class Leftover:
    structured: bool
    depends_on: list[str]
    shares: dict[str, float]  # by covariate: what it predicts of the leftover on other runs
    shares_before: dict[str, float]  # and of the error before effects were added


def leftover_of(engine: Engine, before: identify.Fit, fit: identify.Fit) -> Leftover:
    shares_before = _shares(engine.robot, engine.measurements, before)
    shares = shares_before if fit is before else _shares(engine.robot, engine.measurements, fit)
    structured = is_rejected(engine, fit)
    found = sorted((name for name, share in shares.items() if share > SHARE), key=lambda name: -shares[name])
    return Leftover(structured, found[:3] if structured else [], shares, shares_before)


def _shares(robot: Robot, measurements: Measurements, fit: identify.Fit) -> dict[str, float]:
    """Cross-validated share of the position residual, field error taken off, that each covariate predicts."""
    left = (fit.residual - fit.field)[:, :3]
    rows = np.isfinite(left).all(axis=1) & (fit.weights[:, 0] > 0.3)
    if rows.sum() < 40:
        return {}
    tracker = robot.tracker
    vectors = left[rows] @ tracker.rotation
    runs = measurements.run[rows]
    labels = runs if len(np.unique(runs)) >= 5 else np.arange(rows.sum()) * 10 // rows.sum()
    return {
        name: _predicted(basis[rows], vectors, labels)
        for name, basis in covariates(robot, measurements).items()
        if np.ptp(basis[rows], axis=0).max() > 1e-9
    }


def covariates(robot: Robot, m: Measurements) -> dict[str, Array]:
    """Columns (M, k) by name: smooth functions of one thing each."""
    n = robot.n_tubes
    found = {}
    for i in range(n):
        found[f"alpha{i + 1}"] = _circle(m.alpha[:, i])
        found[f"beta{i + 1}"] = _powers(m.beta[:, i])
        for j in range(i + 1, n):
            found[f"alpha{i + 1} - alpha{j + 1}"] = _circle(m.alpha[:, i] - m.alpha[:, j])
    step = np.vstack([np.zeros(2 * n), np.diff(np.hstack([m.beta, m.alpha]), axis=0)])
    found["direction of motion"] = np.sign(np.where(np.abs(step) > 1e-6, step, 0.0))
    if np.isfinite(m.t).all():
        found["time"] = _powers(m.t)
        dt = np.maximum(np.gradient(m.t), 1e-6)[:, None]
        found["speed"] = step / np.maximum(dt, 1e-3)
    found["load"] = m.force
    if m.position is not None:
        p = np.where(np.isfinite(m.position), m.position, 0.0)
        found["place"] = np.hstack([_powers(p[:, k]) for k in range(3)])
    return found


def _circle(angle: Array) -> Array:
    return np.column_stack([f(k * angle) for k in (1, 2) for f in (np.cos, np.sin)])


def _powers(x: Array) -> Array:
    scaled = (x - x.mean()) / max(float(np.std(x)), 1e-12)
    return np.column_stack([scaled, scaled**2, scaled**3])


def _predicted(basis: Array, vectors: Array, labels: NDArray) -> float:
    """Share of the vectors' square that a ridge regression predicts on groups left out."""
    X = np.column_stack([np.ones(len(basis)), basis / np.maximum(np.std(basis, axis=0), 1e-12)])
    predicted = np.zeros_like(vectors)
    for label in np.unique(labels):
        out = labels == label
        A = X[~out].T @ X[~out] + 1e-3 * len(X) * np.diag([0.0] + [1.0] * basis.shape[1])
        predicted[out] = X[out] @ np.linalg.solve(A, X[~out].T @ vectors[~out])
    total = np.sum((vectors - vectors.mean(axis=0)) ** 2)
    return float(1 - np.sum((vectors - predicted) ** 2) / max(total, 1e-300))
