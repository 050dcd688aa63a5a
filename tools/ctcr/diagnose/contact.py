"""Where a plane may stand that the tip touches: tried as a force along its normal, as far as the tip is inside."""

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose.candidates import Candidate
from ctcr.effects import catalogue

FORCE = ["effects.tip_load.force_x", "effects.tip_load.force_y", "effects.tip_load.force_z"]
STEM = "effects.contact."
DEPTHS = (0.6, 0.75, 0.9, 0.97)  # parts of the tips that are outside
FEWEST = 5  # tips inside


def planes(engine, candidate: Candidate, by_force: NDArray, part: float) -> list[tuple[Candidate, NDArray]]:
    """The candidate with each plane in front of which this part of the tips stays, with its slope; `by_force` (M, 6, 3)
    are those of a force at the tip [1/N]."""
    tracker = engine.robot.tracker
    tips = (engine.positions - tracker.position) @ tracker.rotation
    sigma = catalogue.parameter_of(engine.robot.n_tubes)[STEM + "stiffness"].sigma
    shapes = catalogue.get("contact", engine.robot.n_tubes).shapes
    neutral = dict(zip(shapes, map(float, engine.priors(shapes)[0]), strict=True))
    options = []
    for elevation in np.deg2rad((-60, -30, 0, 30, 60, 90)):
        for azimuth in np.deg2rad(np.arange(0, 360, 30) if elevation < 1.5 else [0]):
            normal = np.array(
                [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
            )
            height = tips @ normal
            distance = np.quantile(height, part)
            inside = np.maximum(height - distance, 0.0)
            if np.count_nonzero(inside) < FEWEST:
                continue
            column = -sigma * inside[:, None] * (by_force @ normal)
            plane = {"distance": distance, "azimuth": azimuth, "elevation": elevation}
            shape = neutral | {STEM + name: float(value) for name, value in plane.items()}
            names = (STEM + "stiffness", *shapes)
            options.append((Candidate(candidate.id, names, tuple(shape.items())), column[:, :, None]))
    return options
