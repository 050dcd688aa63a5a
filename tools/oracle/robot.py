"""Robot description read for the oracle: no code shared with the library, so that a fault there cannot hide here."""

from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML


@dataclass(frozen=True)
class Tube:
    """One tube, SI units. Stiffnesses from the diameters: k = E pi (do^4 - di^4) / 64, kz = k / (1 + nu)."""

    youngs_modulus: float
    poisson_ratio: float
    density: float
    inner_diameter: float
    outer_diameter: float
    length: float
    curved_length: float
    curvature: float

    @property
    def bending_stiffness(self) -> float:
        """E I [N m^2]."""
        return self.youngs_modulus * pi * (self.outer_diameter**4 - self.inner_diameter**4) / 64

    @property
    def torsional_stiffness(self) -> float:
        """G J [N m^2]."""
        return self.bending_stiffness / (1 + self.poisson_ratio)

    @property
    def mass_per_length(self) -> float:
        """[kg/m]."""
        return self.density * pi * (self.outer_diameter**2 - self.inner_diameter**2) / 4


@dataclass(frozen=True)
class Robot:
    """Tubes from the innermost outwards; gravity [m/s^2] in the base frame."""

    tubes: tuple[Tube, ...]
    gravity: np.ndarray


_SCALE = {
    "youngs_modulus_GPa": 1e9,
    "inner_diameter_mm": 1e-3,
    "outer_diameter_mm": 1e-3,
    "length_mm": 1e-3,
    "curved_length_mm": 1e-3,
}
_FILE_KEYS = (
    "youngs_modulus_GPa",
    "poisson_ratio",
    "density_kg_m3",
    "inner_diameter_mm",
    "outer_diameter_mm",
    "length_mm",
    "curved_length_mm",
    "curvature_per_m",
)


def from_description(description: dict) -> Robot:
    """Robot from the content of a robot.yaml."""
    tubes = tuple(Tube(*(_SCALE.get(key, 1.0) * tube[key] for key in _FILE_KEYS)) for tube in description["tubes"])
    return Robot(tubes, np.array(description.get("gravity") or (0.0, 0.0, 0.0), dtype=float))


def read_description(path: Path) -> dict:
    """Content of a robot.yaml as plain dictionaries and lists."""
    return YAML(typ="safe").load(Path(path))


def load(path: Path) -> Robot:
    """Robot from a robot.yaml."""
    return from_description(read_description(path))
