"""Random readings of two tubes, and the ways in which laboratories write them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

HOME = np.array([-0.3, -0.2])  # beta at flush tips [m]
ROWS = 24


@dataclass
class Truth:
    """What a log holds, in SI units: times (M,), runs (M,), joints (M, 2), forces and positions (M, 3), rotations."""

    t: np.ndarray
    run: np.ndarray
    beta: np.ndarray
    alpha: np.ndarray
    force: np.ndarray
    position: np.ndarray
    rotation: Rotation

    @property
    def quaternion(self) -> np.ndarray:
        """Scalar first (M, 4)."""
        return np.roll(self.rotation.as_quat(), 1, axis=1)

    @property
    def travel(self) -> np.ndarray:
        """Of the tubes from flush tips [m] (M, 2)."""
        return self.beta - HOME


def truth() -> Truth:
    rng = np.random.default_rng(11)
    travel = np.sort(rng.uniform(0.01, 0.09, (ROWS, 2)))[:, ::-1]
    return Truth(
        t=np.round(np.arange(ROWS) * 0.025 + rng.uniform(0, 0.01, ROWS), 6),
        run=np.repeat([0, 1], ROWS // 2),
        beta=np.round(HOME + travel, 6),
        alpha=np.round(rng.uniform(-6, 6, (ROWS, 2)), 6),
        force=np.round(rng.uniform(-0.2, 0.2, (ROWS, 3)), 4),
        position=np.round(rng.uniform(-0.2, 0.2, (ROWS, 3)), 6),
        rotation=Rotation.random(ROWS, random_state=3),
    )


def text(names, columns, delimiter=",", decimal=".") -> str:
    """A table of text: `columns` are arrays (M,) or (M, k), or lists of texts."""
    flat = [column for block in columns for column in _single(block)]
    rows = [[_field(value, decimal) for value in row] for row in zip(*flat, strict=True)]
    return "\n".join([*([delimiter.join(names)] if names else []), *map(delimiter.join, rows)]) + "\n"


def _single(block) -> list:
    if isinstance(block, np.ndarray):
        return list(block.reshape(len(block), -1).T)
    return [block]


def _field(value, decimal: str) -> str:
    if isinstance(value, float):
        return f"{value:.12g}".replace(".", decimal)
    return str(value)
