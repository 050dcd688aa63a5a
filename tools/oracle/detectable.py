"""How much of a hidden cause is left when calibration has swallowed what it can, and whether noise hides the rest.

Linear in the 6 + 6 N calibration parameters, each held by its stated uncertainty, at every ninth reading.
"""

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
from mechanics import Mechanics
from robot import from_description
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial.transform import Rotation
from session import ELEMENT_LENGTH, Plan
from simulate import FIELD_LENGTH, QUANTILE_95, Bench
from specimen import Specimen

THINNED = 9
STEP = 0.1  # of a standard deviation
_TUBE_KEYS = {
    "length_mm": "length_mm",
    "curved_length_mm": "curved_length_mm",
    "curvature_percent": "curvature_per_m",
    "youngs_modulus_percent": "youngs_modulus_GPa",
}

Calibration = tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]  # as calibration_of


@dataclass(frozen=True)
class Detectability:
    """What no calibration explains. Above about 30 a fit of a few parameters is sure to see it."""

    chi_square: float
    after_calibration_mm: float  # RMS of the tip position left


def thinned(plan: Plan) -> Plan:
    """The plan with the readings that are looked at."""
    few = slice(None, None, THINNED)
    return replace(plan, time=plan.time[few], run=plan.run[few], joints=plan.joints[few], mass=plan.mass[few])


def detectability(
    calibration: Calibration, tracker: dict, noise: str, moved: np.ndarray, turned: Rotation
) -> Detectability:
    """Of displacements (R, 3) [m] and rotations (R) of the readings of a thinned plan, in the tracker frame."""
    place, columns = calibration
    cause = moved, turned.as_rotvec()
    left, _ = _left(_noise_factors(tracker, "jitter", place), cause, columns)
    _, chi_square = _left(_noise_factors(tracker, noise, place), cause, columns)
    return Detectability(chi_square, float(1e3 * np.sqrt(np.mean(np.sum(left**2, axis=1)))))


def _left(
    factors: tuple[np.ndarray, ...], cause: tuple[np.ndarray, ...], columns: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, float]:
    """Displacement (R, 3) [m] left after the best calibration for this noise, and chi square of all readings."""

    def whitened(parts: tuple[np.ndarray, ...]) -> np.ndarray:
        """(6 R, ...) position and rotation in units of their noise, as if no reading had been left out."""
        flat = [
            solve_triangular(factor, part.reshape(len(factor), -1), lower=True)
            for factor, part in zip(factors, parts, strict=True)
        ]
        return np.sqrt(THINNED) * np.concatenate([part.reshape(3 * len(factors[0]), -1) for part in flat])

    seen, jacobian = whitened(cause)[:, 0], whitened(columns)
    swallowed = np.linalg.solve(jacobian.T @ jacobian + np.eye(jacobian.shape[1]), jacobian.T @ seen)
    chi_square = np.sum((seen - jacobian @ swallowed) ** 2) + np.sum(swallowed**2)
    return cause[0] - columns[0] @ swallowed, float(chi_square)


def _noise_factors(tracker: dict, noise: str, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower Cholesky factors (R, R) of one axis' covariance of position [m^2] and of rotation [rad^2]."""
    distance = np.linalg.norm(place[:, None] - place, axis=2)
    smooth = np.exp(-0.5 * (distance / FIELD_LENGTH) ** 2) * (noise == "realistic") / QUANTILE_95**2
    factors = []
    for scale, unit in ((1e-3, "mm"), (np.deg2rad(1.0), "deg")):
        jitter, accuracy = scale * tracker[f"jitter_{unit}"], scale * tracker[f"accuracy_95_{unit}"]
        # all that thinning leaves out sees the same field: only jitter averages out
        factors.append(cholesky(jitter**2 * np.eye(len(place)) + THINNED * accuracy**2 * smooth, lower=True))
    return factors[0], factors[1]


def calibration_of(bench: Bench, plan: Plan) -> Calibration:
    """Tips (R, 3) [m], and how one standard deviation of each parameter moves (R, 3, P) [m] and turns them [rad]."""
    sigma, n = bench.description["uncertainty"], plan.joints.shape[1] // 2
    offset = np.concatenate([bench.beta_offset, bench.alpha_offset])
    place, turn = _poses(bench, bench.description, plan, offset)
    moves, turns = [], []
    for axis in np.eye(3):
        moves += [1e-3 * sigma["tracker_frame_mm"] * np.tile(axis, (len(place), 1))]
        turns += [np.zeros_like(place)]
        small = np.deg2rad(sigma["tracker_frame_deg"]) * bench.tracker_rotation.apply(axis)
        moves += [np.cross(small, place - bench.tracker_position)]
        turns += [np.tile(small, (len(place), 1))]

    def add(description: dict, joints: np.ndarray) -> None:
        there, turned = _poses(bench, description, plan, joints)
        moves.append((there - place) / STEP)
        turns.append((turned * turn.inv()).as_rotvec() / STEP)

    for i in range(n):
        step = STEP * np.eye(2 * n)
        add(bench.description, offset + 1e-3 * sigma["translation_offset_mm"] * step[i])
        add(bench.description, offset + np.deg2rad(sigma["rotation_offset_deg"]) * step[n + i])
        for promised, key in _TUBE_KEYS.items():
            other = deepcopy(bench.description)
            tube = other["tubes"][i]
            tube[key] += STEP * sigma[promised] * (tube[key] / 100 if promised.endswith("percent") else 1.0)
            add(other, offset)
    return place, (np.stack(moves, axis=-1), np.stack(turns, axis=-1))


def _poses(bench: Bench, description: dict, plan: Plan, offset: np.ndarray) -> tuple[np.ndarray, Rotation]:
    specimen = Specimen(Mechanics(from_description(description)), 2 * ELEMENT_LENGTH)
    gravity = np.array(description["gravity"])
    poses = [
        specimen.settle(*np.split(joints + offset, 2), mass * gravity)
        for joints, mass in zip(plan.joints, plan.mass, strict=True)
    ]
    place = bench.tracker_rotation.apply([pose.position for pose in poses]) + bench.tracker_position
    return place, bench.tracker_rotation * Rotation.from_matrix([pose.rotation for pose in poses])
