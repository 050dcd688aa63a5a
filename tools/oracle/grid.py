"""Elements along the deployed robot, such that every breakpoint (curved start, tip) is a node."""

from dataclasses import dataclass

import numpy as np
from robot import Robot

COINCIDENT = 1e-12  # [m] breakpoints closer than this are one: an element so short is below rounding


@dataclass(frozen=True)
class Grid:
    """M elements and N tubes; every array has the element (or node) as last axis."""

    h: np.ndarray  # (M,) element length [m]
    tip_node: np.ndarray  # (N,) node at the tip of tube i
    curved_node: np.ndarray  # (N,) first node of the precurved part, 0 when that lies behind the plate
    stiffness: np.ndarray  # (M,) K = sum of k_i over the tubes present [N m^2]
    precurvature_moment: np.ndarray  # (N, M) a_i = k_i kappa_i where tube i is curved, else 0 [N m]
    node_mass: np.ndarray  # (M+1,) lumped mass [kg]

    @property
    def n_elements(self) -> int:
        return self.h.size


def make_grid(robot: Robot, beta: np.ndarray, element_length: float, refinement: int = 1) -> Grid:
    """Grid for the grasp positions beta (N,) [m].

    Each segment gets ceil(length / element_length) equal elements, each cut into `refinement` parts: all elements
    shrink by the same factor, which Richardson extrapolation needs.
    """
    tips = np.array([tube.length for tube in robot.tubes]) + beta
    if np.any(np.diff(beta) < 0) or beta[-1] > 0 or np.any(np.diff(tips) > COINCIDENT) or tips[-1] < -COINCIDENT:
        raise ValueError(f"joints out of order: beta {beta}, tips {tips}")
    starts = np.maximum(tips - np.array([tube.curved_length for tube in robot.tubes]), 0.0)
    points = np.unique(np.concatenate([[0.0], starts, np.maximum(tips, 0.0)]))
    points = points[np.concatenate([[True], np.diff(points) > COINCIDENT])]
    counts = refinement * np.ceil(np.diff(points) / element_length - 1e-9).astype(int)
    node_of_point = np.concatenate([[0], np.cumsum(counts)])
    h = np.repeat(np.diff(points) / np.maximum(counts, 1), counts)

    def node_at(s: np.ndarray) -> np.ndarray:
        return node_of_point[np.argmin(np.abs(points[None, :] - s[:, None]), axis=1)]

    tip_node, curved_node = node_at(np.maximum(tips, 0.0)), node_at(starts)
    element = np.arange(h.size)
    present = element < tip_node[:, None]
    bending = np.array([tube.bending_stiffness for tube in robot.tubes])
    curvature = np.array([tube.curvature for tube in robot.tubes])
    curved = present & (element >= curved_node[:, None])
    half_mass = 0.5 * h * (np.array([tube.mass_per_length for tube in robot.tubes]) @ present)
    return Grid(
        h=h,
        tip_node=tip_node,
        curved_node=curved_node,
        stiffness=bending @ present,
        precurvature_moment=(bending * curvature)[:, None] * curved,
        node_mass=np.concatenate([half_mass, [0.0]]) + np.concatenate([[0.0], half_mass]),
    )
