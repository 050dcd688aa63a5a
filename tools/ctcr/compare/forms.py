"""The forms tried on the error: smooth functions of one quantity in several frames, and a few that are more."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.covariates import Covariate, has_speed
from ctcr.compare.sample import Sample

Array = NDArray[np.float64]

FRAME_NAMES = {
    "base": ("x", "y", "z"),
    "tip": ("tip x", "tip y", "along the tip"),
    "axis": ("outwards", "around the axis", "along the axis"),
    "motion": ("along the motion", "across, in the bend", "across, sideways"),
}


@dataclass(frozen=True)
class Form:
    """One way in which the error may depend on something."""

    name: str
    label: str
    frame: str  # key of FRAME_NAMES
    design: Array  # (K, P), or (3K, P) when it couples the three components
    covariate: Covariate | None = None
    constant: bool = True  # judged beyond a constant vector in the same frame

    @property
    def coupled(self) -> bool:
        """Whether one coefficient acts on all three components."""
        return self.name in ("frame_turn", "lag")


def all_forms(sample: Sample, rows: NDArray, items: list[Covariate]) -> list[Form]:
    """Every form tried: each quantity in three frames, and the few that are not functions of one quantity."""
    count = len(rows)
    ones = np.ones((count, 1))
    position = sample.base_position[rows]
    lever = position - position.mean(axis=0)
    turn = np.zeros((count, 3, 3))  # error = omega x lever = -[lever]x omega
    turn[:, 0, 1], turn[:, 0, 2] = lever[:, 2], -lever[:, 1]
    turn[:, 1, 0], turn[:, 1, 2] = -lever[:, 2], lever[:, 0]
    turn[:, 2, 0], turn[:, 2, 1] = lever[:, 1], -lever[:, 0]
    forms = [
        Form("frame_turn", "a turn of the tracker frame", "base", turn.reshape(-1, 3), constant=False),
        Form("tip_offset", "a constant offset in the frame of the tip", "tip", ones, constant=False),
        Form("motion_offset", "direction of the tip's motion", "motion", ones, constant=False),
    ]
    velocity = np.nan_to_num(sample.tip_velocity[rows])
    if has_speed(sample) and np.any(velocity):
        forms.append(Form("lag", "velocity of the tip (a delay)", "base", velocity.reshape(-1, 1), constant=False))
    for item in items:
        for columns in replace(item, value=item.value[rows]).bases():
            columns = np.nan_to_num(columns)
            forms += [Form(item.name, item.label, frame, columns, item) for frame in ("base", "tip", "axis")]
    return forms


def local_frames(sample: Sample, rows: NDArray) -> dict[str, Array]:
    """Axes of each frame as columns (K, 3, 3) in the base frame; zero where a frame is not defined."""
    tip = sample.tip_rotation[rows]
    position = sample.base_position[rows]
    away = np.column_stack([position[:, 0], position[:, 1], np.zeros(len(rows))])
    up = np.broadcast_to([0.0, 0.0, 1.0], away.shape)
    step = np.nan_to_num(sample.tip_step[rows])
    return {
        "base": np.broadcast_to(np.eye(3), tip.shape),
        "tip": np.nan_to_num(tip),
        "axis": _frame(away, up)[:, :, [0, 2, 1]] * np.array([1.0, -1.0, 1.0]),
        "motion": _frame(step, np.nan_to_num(tip[:, :, 2])),
    }


def _frame(first: Array, second: Array) -> Array:
    """Right-handed axes: along first, along second made square to it, and their cross product."""
    a = _unit(first)
    b = _unit(second - np.sum(second * a, axis=1, keepdims=True) * a)
    known = (a.any(axis=1) & b.any(axis=1))[:, None, None]
    return np.where(known, np.stack([a, b, np.cross(a, b)], axis=2), 0.0)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), 0.0)
