"""Writing the project's two file formats: robot.yaml and the table of joints, loads and poses."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
LOADS = {"force": ("fx_N", "fy_N", "fz_N"), "moment": ("mx_Nm", "my_Nm", "mz_Nm")}


def pose_fields(position: np.ndarray, rotation: np.ndarray) -> list[float]:
    """The seven pose columns: position [m], unit quaternion with the scalar first and not negative."""
    return [*position, *Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)]


def write_table(
    path: Path,
    rows: Iterable[Iterable[float]],
    n_tubes: int,
    loads: tuple[str, ...],
    leading: tuple[str, ...] = (),
    pose: tuple[str, ...] = POSE,
) -> None:
    """Rows of (leading, beta, alpha, loads, pose) as CSV with 12 significant digits; pose: its columns."""
    tubes = range(1, n_tubes + 1)
    names = [*leading, *(f"beta{i}_m" for i in tubes), *(f"alpha{i}_rad" for i in tubes)]
    names += [column for load in loads for column in LOADS[load]] + list(pose)
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(names)] + [",".join(f"{float(value) + 0.0:.12g}" for value in row[: len(names)]) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_robot(path: Path, description: dict) -> None:
    """A robot.yaml."""
    path.parent.mkdir(parents=True, exist_ok=True)
    yaml = YAML()
    yaml.default_flow_style = False
    yaml.representer.ignore_aliases = lambda _: True
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(description, file)
