"""What the tubes of a simulated bench are made of, the standard robot or one with a hidden effect.

`Mechanics` lists everything that can differ from the standard robot; its defaults are the standard robot. `configure`
turns it into the energy of one configuration.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from energy import SHORTEST_TRANSMISSION
from friction import FrictionLaw
from grid import make_grid
from kernel import Problem
from robot import Robot, Tube

Profile = Callable[[np.ndarray], np.ndarray]  # distance from the grasped point (n,) [m] -> precurvature (n, 3) [1/m]


@dataclass(frozen=True)
class Joint:
    """A place where the whole bundle tilts: energy stiffness (|tilt| - gap)^2 / 2 beyond the gap, centring below."""

    stiffness: float  # [N m/rad]
    centring: float = 0.0  # [N m/rad]
    gap: float = 0.0  # [rad]
    arm: float = 0.0  # [m] by which the pivot lies behind the plate


@dataclass(frozen=True)
class Yielding:
    """A part of every section's stiffness that yields at a bending strain: the loop of a superelastic material."""

    share: float  # of the bending stiffness
    curvature: float  # [1/m] at which it yields


@dataclass
class Mechanics:
    """Tubes from the innermost outwards. Effects change it in place."""

    robot: Robot
    profile: list[Profile] = field(default_factory=list)
    ellipticity: np.ndarray | None = None  # (N, 2) (k_x - k_y) / (k_x + k_y) times (cos, sin) of twice its direction
    tangent: np.ndarray | None = None  # (N, T) tangent over initial bending stiffness against bending
    table_step: float = 0.25  # [1/m] of `tangent`
    torsion_factor: np.ndarray | None = None  # (N,)
    drive_compliance: np.ndarray | None = None  # (N,) [rad/(N m)]
    drive_hardening: float = 0.0  # [1/(N m)^2] relative loss of drive compliance per squared torque
    entry: Joint | None = None
    sleeve: dict[int, Joint] = field(default_factory=dict)  # at the end of tube i, which the inner ones leave
    # (N-1,) [m] radial: tubes with own centre lines, each in the bore of the next. Beside them only tip_force acts.
    bore_gap: np.ndarray | None = None
    tip_force: np.ndarray = field(default_factory=lambda: np.zeros(3))  # [N] base frame, constant
    cable_pull: float = 0.0  # [N] along the tip's tangent, backwards
    obstacle: np.ndarray | None = None  # (O, 5) centre, radius [m], Hertz stiffness [N/m^2.5]
    friction: FrictionLaw | None = None
    yielding: Yielding | None = None
    warming: Callable[[float], float] = lambda time: 0.0  # relative change of stiffness and curvature at a time [s]
    ageing: Callable[[float], np.ndarray | float] = lambda time: 0.0  # (N,) that of the curvature alone

    def __post_init__(self) -> None:
        self.profile = self.profile or [standard_profile(tube) for tube in self.robot.tubes]

    @property
    def has_history(self) -> bool:
        return self.friction is not None or self.yielding is not None


def standard_profile(tube: Tube) -> Profile:
    """Straight, then constant curvature up to the tip."""
    start = tube.length - tube.curved_length
    return lambda distance: tube.curvature * (distance >= start)[:, None] * np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Configuration:
    """The robot at one joint position: elements with joints inserted, and where the named places are."""

    s: np.ndarray  # (M+1,) arc length of the nodes [m]
    h: np.ndarray  # (M,) 0 for a joint
    tip_node: np.ndarray  # (N,)
    curved_node: np.ndarray  # (N,)
    fields: dict[str, np.ndarray]  # of `Problem`, all but force and contacts
    weight: np.ndarray  # (M+1, 3) [N]

    @property
    def middle(self) -> np.ndarray:
        return 0.5 * (self.s[1:] + self.s[:-1])

    def problem(self, tip_force: np.ndarray, **history: np.ndarray) -> Problem:
        """Energy with a dead load (3,) [N] at the tip of tube 1, and contacts and anchors where there is history."""
        force = self.weight.copy()
        force[self.tip_node[0]] += tip_force
        return Problem(h=self.h, tip=self.tip_node, force=force, **self.fields, **history)


def configure(
    mechanics: Mechanics,
    beta: np.ndarray,
    alpha: np.ndarray,
    element_length: float,
    time: float = 0.0,
    refinement: int = 1,
) -> Configuration:
    """The grid of make_grid() and the properties of its elements at joints beta (N,) [m], alpha (N,) [rad]."""
    robot, warmth = mechanics.robot, mechanics.warming(time)
    grid = make_grid(robot, beta, element_length, refinement)
    joints = {int(grid.tip_node[i]): joint for i, joint in mechanics.sleeve.items() if grid.tip_node[i] > 0}
    if mechanics.entry:
        joints[0] = mechanics.entry
    places = np.array(sorted(joints), dtype=int)
    h = np.insert(grid.h, places, 0.0)
    weight = grid.node_mass[:, None] * robot.gravity

    def shifted(node: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Node numbers after the insertion; a tube's own end lies before the joint that its end makes."""
        return node + np.searchsorted(places, node, side="left") + (own & np.isin(node, places))

    elements = h.size
    s = np.concatenate([[0.0], np.cumsum(h)])
    distance = 0.5 * (s[1:] + s[:-1])[None, :] - np.asarray(beta)[:, None]
    stiffness = np.array([tube.bending_stiffness for tube in robot.tubes]) * (1 + warmth)
    ellipticity = np.zeros((stiffness.size, 2)) if mechanics.ellipticity is None else mechanics.ellipticity
    section = stiffness[:, None] * np.stack([1 + ellipticity[:, 0], ellipticity[:, 1], 1 - ellipticity[:, 0]], axis=1)
    joint = np.zeros((elements, 4))
    for k, node in enumerate(places):
        parts = joints[int(node)]
        joint[node + k] = parts.stiffness, parts.centring, parts.gap, parts.arm
    fields = {
        "stiffness": section,
        "torsion": _torsion(mechanics) * (1 + warmth),
        "precurvature": np.stack([p(d) for p, d in zip(mechanics.profile, distance, strict=True)])
        * (1 + warmth + np.broadcast_to(mechanics.ageing(time), stiffness.shape))[:, None, None],
        "base": np.stack([alpha, *_base(mechanics, beta, 1 + warmth)], axis=1),
        "joint": joint,
    }
    if mechanics.tangent is not None:
        if mechanics.ellipticity is not None:
            raise ValueError("a section that softens cannot have a stiff direction as well")
        fields |= {"tangent": mechanics.tangent, "table_step": mechanics.table_step}
    if mechanics.obstacle is not None:
        fields["obstacle"] = mechanics.obstacle
    if mechanics.yielding:
        share = mechanics.yielding.share
        fields["stiffness"] = (1 - share) * section
        fields["plastic"] = share * stiffness[:, None] * np.array([1.0, mechanics.yielding.curvature])
    # The entry tilts everything, so also the tubes that are flush; a sleeve's joint only what goes on inside it.
    tip = shifted(grid.tip_node, np.zeros(stiffness.size, dtype=bool))
    tip = np.where(grid.tip_node == 0, 0, tip)
    return Configuration(
        s=s,
        h=h,
        tip_node=tip,
        curved_node=shifted(grid.curved_node, np.ones(stiffness.size, dtype=bool)),
        fields=fields,
        weight=np.insert(weight, places, 0.0, axis=0),
    )


def _torsion(mechanics: Mechanics) -> np.ndarray:
    torsion = np.array([tube.torsional_stiffness for tube in mechanics.robot.tubes])
    return torsion if mechanics.torsion_factor is None else torsion * mechanics.torsion_factor


def _base(mechanics: Mechanics, beta: np.ndarray, warm: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness [N m/rad] and cubic stiffness [N m/rad^3] between drive and plate.

    Tube and drive in series twist by compliance x torque - drive compliance x hardening x torque^3; inverted to third
    order.
    """
    drive = mechanics.drive_compliance
    drive = np.zeros(beta.size) if drive is None else drive
    compliance = np.maximum(-beta, SHORTEST_TRANSMISSION) / (_torsion(mechanics) * warm) + drive
    return 1 / compliance, drive * mechanics.drive_hardening / compliance**4
