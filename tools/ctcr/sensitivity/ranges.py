"""The paper's parameters and how wrong each may be (Boyer et al., Section V.A), as vectors of the library."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ctcr.model import parameters
from ctcr.robot.description import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Varied:
    """One parameter: at(-1) and at(1) are the values of all parameters at the two ends of its range."""

    name: str  # "rotation offset, tube 2"
    kind: str  # "rotation offset"
    tube: int | None  # from 1; None: of the tracker
    unit: str
    low: float  # change at -1, in that unit
    high: float  # at 1
    at: Callable[[float], Array]
    bounds: Callable[[float], list[tuple[int, float]]]  # places and values of what varies together

    def change(self, fraction: float) -> float:
        """The change that a fraction in [-1, 1] of the range stands for, in `unit`."""
        return fraction * (self.high if fraction > 0 else -self.low)


def all_varied(robot: Robot) -> list[Varied]:
    """The parameters of a robot: of each tube, then those of the tracker frame T_ref."""
    names, nominal = parameters.names_of(robot.n_tubes), parameters.values(robot)
    place = {name: i for i, name in enumerate(names)}
    found: list[Varied] = []

    def add(kind: str, tube: int | None, unit: str, low: float, high: float, changed: dict[str, Callable]) -> None:
        """`changed` {name: value at a change}."""

        def values(fraction: float) -> list[tuple[int, float]]:
            change = fraction * (high if fraction > 0 else -low)
            return [(place[name], value(change)) for name, value in changed.items()]

        def at(fraction: float) -> Array:
            x = nominal.copy()
            for i, value in values(fraction):
                x[i] = value
            return x

        label = f"{kind}, tube {tube}" if tube else kind
        found.append(Varied(label, kind, tube, unit, low, high, at, values))

    def shift(name: str, scale: float) -> dict[str, Callable]:
        return {name: lambda change: nominal[place[name]] + scale * change}

    def percent(name: str) -> dict[str, Callable]:
        return {name: lambda change: nominal[place[name]] * (1 + change / 100)}

    for i, tube in enumerate(robot.tubes, start=1):
        add("translation offset", i, "mm", -5, 5, shift(f"actuation.home_translation.{i}", 1e-3))
        add("rotation offset", i, "deg", -5, 5, shift(f"actuation.home_rotation.{i}", pi / 180))
        add("length", i, "mm", -5, 5, shift(f"tubes.{i}.length", 1e-3))
        if tube.curvature and tube.curved_length:
            add("curved length", i, "mm", -5, 5, shift(f"tubes.{i}.curved_length", 1e-3))
            add("precurvature", i, "%", -10, 10, percent(f"tubes.{i}.curvature"))
        if tube.bending_stiffness_Nm2 is None:
            add("Young's modulus", i, "GPa", -15, 15, shift(f"tubes.{i}.youngs_modulus", 1e9))
            inner, outer = tube.inner_diameter, tube.outer_diameter
            wall = {f"tubes.{i}.inner_diameter": lambda change, d=inner, o=outer: o - (o - d) * (1 + change / 100)}
            add("wall thickness", i, "%", -15, 15, wall)
        else:
            add("bending stiffness", i, "%", -25, 25, percent(f"tubes.{i}.bending_stiffness"))
        nu = tube.poisson_ratio
        add("Poisson's ratio", i, "", -nu, 0.5 - nu, shift(f"tubes.{i}.poisson_ratio", 1.0))
    for axis in "xyz":
        add(f"tracker position {axis}", None, "mm", -3, 3, shift(f"tracker.position.{axis}", 1e-3))
    for k, axis in enumerate("xyz"):
        found.append(_turned(nominal, [place[f"tracker.rotation.{a}"] for a in "xyz"], k, axis))
    return found


def _turned(nominal: Array, places: list[int], k: int, axis: str) -> Varied:
    """The tracker frame turned about one of the tracker's axes."""
    limit = 3 * pi / 180

    def at(fraction: float) -> Array:
        x = nominal.copy()
        turn = Rotation.from_rotvec(fraction * limit * np.eye(3)[k])
        x[places] = (turn * Rotation.from_rotvec(nominal[places])).as_rotvec()
        return x

    return Varied(
        f"tracker rotation {axis}",
        f"tracker rotation {axis}",
        None,
        "deg",
        -3,
        3,
        at,
        lambda fraction: [(places[k], fraction * limit)],
    )


def together(robot: Robot, varied: list[Varied]) -> tuple[Array, Array]:
    """Lowest and highest value of every parameter when all vary; the turn of the tracker frame counts from it."""
    low = parameters.values(robot)
    for i, name in enumerate(parameters.names_of(robot.n_tubes)):
        if name.startswith("tracker.rotation."):
            low[i] = 0.0
    high = low.copy()
    for one in varied:
        for (i, a), (_, b) in zip(one.bounds(-1), one.bounds(1), strict=True):
            low[i], high[i] = min(a, b), max(a, b)
    return low, high
