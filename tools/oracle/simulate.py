"""A measurement session on a simulated bench: the true robot behind the described one, the tracker, the paths."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from equilibrium import Pose
from scipy.spatial.transform import Rotation

SHARE_OF_UNCERTAINTY = 0.7  # how far the true bench lies from its description
WRONG_SHEET = {  # the same of a data sheet that is wrong: half to all of so many stated uncertainties, either sign
    "tracker_frame_mm": 16.0,
    "tracker_frame_deg": 15.0,
    "rotation_offset_deg": 8.0,
    "translation_offset_mm": 1.0,
    "length_mm": 4.0,
    "curved_length_mm": 1.0,
    "curvature_percent": 3.6,
    "youngs_modulus_percent": 2.2,
}
FIELD_LENGTH = 0.1  # [m] over which the tracker's field error changes
QUANTILE_95 = 2.795  # 95 % of the norms of a 3-D normal vector with unit standard deviation lie below
SPEED_ROTATION, SPEED_TRANSLATION = np.deg2rad(10.0), 5e-3  # [rad/s, m/s] of approach moves
DWELL = 2.0  # [s] from stop to stop, and of rest before the first stop of a run


@dataclass(frozen=True)
class Bench:
    """What is really there: robot, joint offsets, and T_ref (base frame in the tracker frame)."""

    description: dict  # of the true robot, in the form of robot.yaml
    beta_offset: np.ndarray  # (N,) [m]
    alpha_offset: np.ndarray  # (N,) [rad]
    tracker_position: np.ndarray  # (3,) [m]
    tracker_rotation: Rotation


def draw_bench(description: dict, rng: np.random.Generator, *, wrong: bool = False) -> Bench:
    """A bench that differs from its description by normal draws of 0.7 of the stated uncertainties, or far more."""
    sigma = description["uncertainty"]

    def draw(name: str, size: int = 1) -> np.ndarray:
        if wrong:
            return WRONG_SHEET[name] * sigma[name] * rng.uniform(0.5, 1.0, size) * rng.choice([-1.0, 1.0], size)
        return SHARE_OF_UNCERTAINTY * sigma[name] * rng.normal(size=size)

    true = deepcopy(description)
    for tube in true["tubes"]:
        tube["length_mm"] += float(draw("length_mm")[0])
        tube["curved_length_mm"] += float(draw("curved_length_mm")[0])
        tube["curvature_per_m"] *= 1 + float(draw("curvature_percent")[0]) / 100
        tube["youngs_modulus_GPa"] *= 1 + float(draw("youngs_modulus_percent")[0]) / 100
    n, tracker = len(true["tubes"]), description["tracker"]
    tilt = Rotation.from_rotvec(np.deg2rad(draw("tracker_frame_deg", 3)))
    return Bench(
        description=true,
        beta_offset=1e-3 * draw("translation_offset_mm", n),
        alpha_offset=np.deg2rad(draw("rotation_offset_deg", n)),
        tracker_position=1e-3 * (np.array(tracker["position_mm"]) + draw("tracker_frame_mm", 3)),
        tracker_rotation=Rotation.from_rotvec(tracker["rotation_vector_rad"]) * tilt,
    )


class Tracker:
    """Single readings with jitter, on top of a smooth field error that depends on the place alone."""

    def __init__(self, description: dict, bench: Bench, rng: np.random.Generator) -> None:
        tracker = description["tracker"]
        self._bench, self._rng = bench, rng
        self._jitter = 1e-3 * tracker["jitter_mm"], np.deg2rad(tracker["jitter_deg"])
        position_error = _field(1e-3 * tracker["accuracy_95_mm"] / QUANTILE_95, rng)
        rotation_error = _field(np.deg2rad(tracker["accuracy_95_deg"]) / QUANTILE_95, rng)
        self._field = position_error, rotation_error

    def read(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) [m] and rotation (3, 3) in the tracker frame of a pose in the base frame."""
        position = self._bench.tracker_rotation.apply(pose.position) + self._bench.tracker_position
        rotation = self._bench.tracker_rotation * Rotation.from_matrix(pose.rotation)
        jitter = [sigma * self._rng.normal(size=3) for sigma in self._jitter]
        error = Rotation.from_rotvec(self._field[1](position) + jitter[1])
        return position + self._field[0](position) + jitter[0], (error * rotation).as_matrix()


def _field(sigma: float, rng: np.random.Generator, waves: int = 200) -> Callable[[np.ndarray], np.ndarray]:
    """Three smooth random functions of position: normal, squared-exponential correlation over FIELD_LENGTH."""
    wave_vector = rng.normal(size=(3, waves, 3)) / FIELD_LENGTH
    phase = rng.uniform(0, 2 * np.pi, (3, waves))
    return lambda position: sigma * np.sqrt(2 / waves) * np.sum(np.cos(wave_vector @ position + phase), axis=1)


@dataclass(frozen=True)
class Run:
    """Stops on a straight line in joint space: out from the first to the last, back, and the middle once more."""

    stops: np.ndarray  # (S, 2N) joints (beta, alpha)
    mass: float  # [kg] hung from the tip

    def visits(self) -> np.ndarray:
        """(2S, 2N) joints in the order of measurement. The last visit comes from the same side as the outward one."""
        return np.concatenate([self.stops, self.stops[-2::-1], [self.stops[len(self.stops) // 2]]])


def approach_time(start: np.ndarray, end: np.ndarray) -> float:
    """[s], whole, for a straight joint-space move including the rest at its end."""
    n = start.size // 2
    speed = np.concatenate([np.full(n, SPEED_TRANSLATION), np.full(n, SPEED_ROTATION)])
    return float(np.ceil(np.max(np.abs(end - start) / speed)) + DWELL)
