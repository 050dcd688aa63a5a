"""The paper as data: its robot (Table II, weightless), random designs near it, and its numbers beside ours."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr.robot.description import Actuation, Robot, Tracker
from ctcr.robot.table_ii import table_ii

COLUMNS = {
    "where": "in the paper",
    "what": "",
    "why ours differs": "",
    "paper": "its value",
    "ours": "what this library finds",
    "ratio": "ours over the paper's",
}


@dataclass(frozen=True)
class Claim:
    """A number of the paper beside ours, both in `unit`; `why` says why they differ, or what ours means."""

    where: str
    what: str
    paper: float
    ours: float
    unit: str
    why: str = ""

    @property
    def ratio(self) -> float | None:
        return self.ours / self.paper if self.paper else None

    def row(self) -> list[str]:
        """The row of a table with COLUMNS."""
        ratio = "" if self.ratio is None else f"{self.ratio:.3g}"
        values = [f"{value:.4g} {self.unit}".strip() for value in (self.paper, self.ours)]
        return [self.where, self.what, self.why, *values, ratio]


def paper_robot() -> Robot:
    """Table II with its transmission and tracker frame.

    The paper does not say in which order its angles of T_ref turn; no result depends on it.
    """
    actuation = Actuation(
        translation_mm_per_rev=2.0,
        rotation_rev_per_rev=-1.0,
        home_translation_mm=[-298.0, -220.5, -145.0],
        home_rotation_deg=[3.55, -0.22, 2.71],
    )
    tracker = Tracker(
        sensor_on_tube=1,
        rate_Hz=40.0,
        jitter_mm=0.035,
        jitter_deg=None,
        accuracy_95_mm=0.88,
        accuracy_95_deg=0.48,
        position_mm=[-48.25, -7.25, 5.61],
        rotation_vector_rad=Rotation.from_euler("xyz", [120.26, -0.17, 180.13], degrees=True).as_rotvec().tolist(),
    )
    return table_ii().model_copy(update={"actuation": actuation, "tracker": tracker})


def random_design(random: np.random.Generator) -> Robot:
    """Table II with other stiffnesses, and with curvatures and curved lengths up to its largest."""
    robot = paper_robot().model_copy(deep=True)
    for tube in robot.tubes:
        tube.curvature_per_m = random.uniform(0, 10)
        tube.curved_length_mm = random.uniform(10, 50)
        tube.youngs_modulus_GPa *= random.uniform(0.7, 1.3)
    return robot


def random_rows(robot: Robot, count: int, random: np.random.Generator, most_force: float):
    """Joints beta, alpha (count, N), uniform over what the order of the tubes allows, and tip forces (count, 3)."""
    kept = np.empty((0, robot.n_tubes))
    while len(kept) < count:
        beta = -robot.lengths * random.uniform(size=(20 * count, robot.n_tubes))
        behind, beyond = np.diff(beta, append=0), -np.diff(robot.lengths + beta, append=0)
        kept = np.vstack([kept, beta[(behind >= 0).all(axis=1) & (beyond >= 0).all(axis=1)]])
    force = random.standard_normal((count, 3))
    force *= most_force * random.uniform(size=(count, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    return kept[:count], random.uniform(-np.pi, np.pi, (count, robot.n_tubes)), force
