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
_RETRACTION = {2: (0.055, 0.050), 3: (0.060, 0.045, 0.045), 4: (0.060, 0.045, 0.040, 0.040)}
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


def describe(robot: str) -> dict:
    """Content of the robot.yaml of one of ROBOTS."""
    tubes, (position, rotation) = _TUBES[robot], _PLACE[robot]
    return {
        "name": robot,
        "gravity": [0.0, -9.80665, 0.0],
        "tubes": [
            {"youngs_modulus_GPa": _MODULUS[robot]} | _MATERIAL | dict(zip(_KEYS, tube[:5], strict=True))
            for tube in tubes
        ],
        "actuation": {
            "translation_mm_per_rev": 2.0,
            "rotation_rev_per_rev": -1.0,
            "home_translation_mm": [tube[5] - tube[2] for tube in tubes],
            "home_rotation_deg": [0.0 for _ in tubes],
        },
        "tracker": _TRACKER | {"position_mm": position, "rotation_vector_rad": rotation},
        "uncertainty": dict(_UNCERTAINTY),
    }


def joint_range(description: dict) -> JointRange:
    """Joint range of a described robot."""
    home = 1e-3 * np.array(description["actuation"]["home_translation_mm"])
    length = 1e-3 * np.array([tube["length_mm"] for tube in description["tubes"]])
    return JointRange(home, np.array(_RETRACTION[home.size]), length)
