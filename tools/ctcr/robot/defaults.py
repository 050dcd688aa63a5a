"""Values that hold where a robot file states none; `ctcr init` writes the same numbers into a new file."""

from typing import Any

TRACKER = {
    "sensor_on_tube": 1,
    "rate_Hz": None,
    "jitter_mm": 0.1,
    "jitter_deg": 0.1,
    "accuracy_95_mm": None,
    "accuracy_95_deg": None,
    "position_mm": [0.0, 0.0, 0.0],
    "rotation_vector_rad": [0.0, 0.0, 0.0],
    "sensor_position_mm": [0.0, 0.0, 0.0],
    "sensor_rotation_vector_rad": None,
}
UNCERTAINTY = {
    "tracker_frame_mm": 5.0,
    "tracker_frame_deg": 3.0,
    "rotation_offset_deg": 5.0,
    "translation_offset_mm": 1.0,
    "length_mm": 1.0,
    "curved_length_mm": 2.5,
    "curvature_percent": 10.0,
    "youngs_modulus_percent": 20.0,
}
SAID = {
    "actuation": "not given: the ratios of the motors are not known, at home all tips are flush with the front plate",
    "tracker": "not given: the sensor is at the tip of tube 1, turned anyhow, tracker and base frame agree, and the "
    f"jitter is {TRACKER['jitter_mm']:g} mm and {TRACKER['jitter_deg']:g} deg",
    "uncertainty": f"not given: {UNCERTAINTY['tracker_frame_mm']:g} mm of the tracker frame, "
    f"{UNCERTAINTY['rotation_offset_deg']:g} deg of the homes, {UNCERTAINTY['curvature_percent']:g} % of curvatures "
    "and so on, as `ctcr init` writes",
}


def absent(data: dict[str, Any]) -> list[str]:
    """The sections that a parsed file leaves out, or leaves at null."""
    return [section for section in SAID if data.get(section) is None]


def section(name: str, lengths_mm: list[float]) -> dict[str, Any]:
    """A section of a robot with tubes of these lengths."""
    if name == "actuation":
        return {
            "translation_mm_per_rev": None,
            "rotation_rev_per_rev": None,
            "home_translation_mm": [-length for length in lengths_mm],
            "home_rotation_deg": [0.0 for _ in lengths_mm],
        }
    return dict(TRACKER if name == "tracker" else UNCERTAINTY)
