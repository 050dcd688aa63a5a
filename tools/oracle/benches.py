"""The benches on which sets are measured: described robots with their tracker and what calibration may move."""

from dataclasses import dataclass

import numpy as np

# inner diameter, outer diameter, length, curved length [mm], curvature [1/m]; tip in front of the plate at home [mm]
_TUBES = {
    "table2": [
        (1.30, 1.52, 463.0, 50.0, 10.0, 165.0),
        (1.62, 1.80, 330.5, 50.0, 5.0, 110.0),
        (2.03, 2.35, 199.0, 50.0, 7.0, 54.0),
    ],
    "B": [
        (0.90, 1.20, 445.0, 55.0, 8.5, 158.0),
        (1.30, 1.62, 315.0, 55.0, 4.0, 104.0),
        (1.75, 2.15, 195.0, 45.0, 4.5, 52.0),
    ],
    "two_tubes": [(0.80, 1.10, 360.0, 60.0, 9.0, 140.0), (1.25, 1.60, 220.0, 60.0, 5.0, 75.0)],
    "four_tubes": [
        (0.60, 0.85, 470.0, 45.0, 9.0, 178.0),
        (0.95, 1.25, 360.0, 45.0, 5.0, 134.0),
        (1.35, 1.70, 262.0, 45.0, 4.0, 92.0),
        (1.80, 2.20, 170.0, 45.0, 3.0, 52.0),
    ],
}
_MODULUS = {"table2": 58.0, "B": 62.0, "two_tubes": 60.0, "four_tubes": 55.0}  # [GPa]
ROBOTS = tuple(_TUBES)
# [m] from the home position; the outermost tip stays in front of the plate
_RETRACTION = {1: (0.045,), 2: (0.055, 0.050), 3: (0.060, 0.045, 0.045), 4: (0.060, 0.045, 0.040, 0.040)}
DRAWN = {f"drawn{n}": n for n in _RETRACTION}  # random robots, with their numbers of tubes
_KEYS = ("inner_diameter_mm", "outer_diameter_mm", "length_mm", "curved_length_mm", "curvature_per_m")
_MATERIAL = {"poisson_ratio": 0.3, "density_kg_m3": 6450.0}
_TRACKER = {
    "sensor_on_tube": 1,
    "rate_Hz": 40.0,
    "jitter_mm": 0.035,
    "jitter_deg": 0.03,
    "accuracy_95_mm": 0.88,
    "accuracy_95_deg": 0.48,
}
_PLACE = {
    "table2": ([-60.0, 20.0, -180.0], [0.0, 1.2, 0.3]),
    "B": ([-35.0, 12.0, -120.0], [1.9, 0.25, -0.1]),
    "two_tubes": ([20.0, -30.0, -115.0], [2.2, -0.2, 0.3]),
    "four_tubes": ([-60.0, 5.0, -90.0], [2.0, 0.1, 0.2]),
}
_UNCERTAINTY = {
    "tracker_frame_mm": 0.5,
    "tracker_frame_deg": 0.3,
    "rotation_offset_deg": 1.0,
    "translation_offset_mm": 1.0,
    "length_mm": 1.0,
    "curved_length_mm": 2.5,
    "curvature_percent": 5.0,
    "youngs_modulus_percent": 15.0,
}


@dataclass(frozen=True)
class JointRange:
    """Where the joints may go: beta between home and home - retraction, bases and tips a margin apart."""

    home: np.ndarray  # (N,) [m]
    retraction: np.ndarray  # (N,) [m]
    length: np.ndarray  # (N,) [m]
    margin: float = 5e-3  # [m]; more than the true lengths and offsets can be off

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """Joints (2N,) drawn uniformly: beta [m], alpha [rad] within half a turn."""
        while True:
            beta = self.home - rng.uniform(size=self.home.size) * self.retraction
            if np.all(np.diff(beta) > self.margin) and np.all(np.diff(self.length + beta) < -self.margin):
                return np.concatenate([beta, rng.uniform(-np.pi, np.pi, beta.size)])


def describe(robot: str, rng: np.random.Generator | None = None) -> dict:
    """Content of the robot.yaml of one of ROBOTS, or of one of DRAWN by random numbers."""
    if robot in DRAWN:
        tubes, modulus = _draw_tubes(DRAWN[robot], rng), float(rng.integers(50, 71))
        position, rotation = rng.uniform([-60, -60, -180], [60, 60, -90]).round().tolist(), rng.uniform(-1.2, 1.2, 3)
    else:
        tubes, modulus, (position, rotation) = _TUBES[robot], _MODULUS[robot], _PLACE[robot]
    return {
        "name": robot,
        "gravity": [0.0, -9.80665, 0.0],
        "tubes": [
            {"youngs_modulus_GPa": modulus} | _MATERIAL | dict(zip(_KEYS, tube[:5], strict=True)) for tube in tubes
        ],
        "actuation": {
            "translation_mm_per_rev": 2.0,
            "rotation_rev_per_rev": -1.0,
            "home_translation_mm": [tube[5] - tube[2] for tube in tubes],
            "home_rotation_deg": [0.0 for _ in tubes],
        },
        "tracker": _TRACKER | {"position_mm": position, "rotation_vector_rad": np.round(rotation, 2).tolist()},
        "uncertainty": dict(_UNCERTAINTY),
    }


def _draw_tubes(n_tubes: int, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """Tubes as in _TUBES, rounded as a data sheet has them."""
    bore, diameters = rng.uniform(0.5, 1.0), []
    for _ in range(n_tubes):
        outer = bore + 2 * rng.uniform(0.09, 0.18)
        diameters.append((bore, outer))
        bore = outer + rng.uniform(0.06, 0.2)
    outermost = 1e3 * _RETRACTION[n_tubes][-1] + rng.uniform(12.0, 22.0)  # what stays in front of the plate
    steps = np.append(rng.uniform(40.0, 55.0, n_tubes - 1), outermost)
    tips = np.cumsum(steps[::-1])[::-1].round()
    bases = -np.cumsum(np.append(rng.uniform(110.0, 150.0), rng.uniform(60.0, 90.0, n_tubes - 1)))[::-1].round()
    curved = rng.uniform(38.0, 62.0, n_tubes).round()
    curvatures = np.append(rng.uniform(7.0, 11.0), rng.uniform(3.0, 6.0, n_tubes - 1)).round(1)
    return np.column_stack([np.round(diameters, 2), tips - bases, curved, curvatures, tips]).tolist()


def joint_range(description: dict) -> JointRange:
    """Joint range of a described robot."""
    home = 1e-3 * np.array(description["actuation"]["home_translation_mm"])
    length = 1e-3 * np.array([tube["length_mm"] for tube in description["tubes"]])
    return JointRange(home, np.array(_RETRACTION[home.size]), length)
