"""The paper's parameters and how wrong each may be (Boyer et al., Section V.A), as vectors of the library."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr.arrays import Array
from ctcr.model import parameters, recording
from ctcr.robot.description import Robot


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
    index: int  # of the parameter
    ends: tuple[float, float]  # its values at -1 and 1; a turn of the tracker frame counts from that frame [rad]

    def change(self, fraction: float) -> float:
        """The change in `unit` at a fraction in [-1, 1] of the range."""
        return fraction * (self.high if fraction > 0 else -self.low)


def all_varied(robot: Robot) -> list[Varied]:
    """The parameters of a robot: those of each tube, then those of the tracker frame T_ref."""
    nominal, found = parameters.values(robot), []
    index = {name: i for i, name in enumerate(parameters.names_of(robot.n_tubes))}

    def add(kind: str, tube: int | None, unit: str, low: float, high: float, name: str, changed: Callable) -> None:
        """`changed(value, change)`: the new value."""
        i, label = index[name], f"{kind}, tube {tube}" if tube else kind

        def at(fraction: float) -> Array:
            x = nominal.copy()
            x[i] = changed(x[i], fraction * (high if fraction > 0 else -low))
            return x

        found.append(Varied(label, kind, tube, unit, low, high, at, i, (at(-1)[i], at(1)[i])))

    def shift(scale: float) -> Callable:
        return lambda value, change: value + scale * change

    def percent(value: float, change: float) -> float:
        return value * (1 + change / 100)

    for i, tube in enumerate(robot.tubes, start=1):
        add("translation offset", i, "mm", -5, 5, f"actuation.home_translation.{i}", shift(1e-3))
        add("rotation offset", i, "deg", -5, 5, f"actuation.home_rotation.{i}", shift(pi / 180))
        add("length", i, "mm", -5, 5, f"tubes.{i}.length", shift(1e-3))
        if tube.curvature and tube.curved_length:
            add("curved length", i, "mm", -5, 5, f"tubes.{i}.curved_length", shift(1e-3))
            add("precurvature", i, "%", -10, 10, f"tubes.{i}.curvature", percent)
        if tube.bending_stiffness_Nm2 is None:
            add("Young's modulus", i, "GPa", -15, 15, f"tubes.{i}.youngs_modulus", shift(1e9))

            def wall(inner: float, change: float, outer: float = tube.outer_diameter) -> float:
                return outer - percent(outer - inner, change)

            add("wall thickness", i, "%", -15, 15, f"tubes.{i}.inner_diameter", wall)
        else:
            add("bending stiffness", i, "%", -25, 25, f"tubes.{i}.bending_stiffness", percent)
        nu = tube.poisson_ratio
        add("Poisson's ratio", i, "", -nu, 0.5 - nu, f"tubes.{i}.poisson_ratio", shift(1.0))
    for axis in "xyz":
        add(f"tracker position {axis}", None, "mm", -3, 3, f"tracker.position.{axis}", shift(1e-3))
    vector, limit = [index[f"tracker.rotation.{axis}"] for axis in "xyz"], 3 * pi / 180
    for axis, i, direction in zip("xyz", vector, np.eye(3), strict=True):

        def turned(fraction: float, direction: Array = direction) -> Array:
            x = nominal.copy()
            turn = Rotation.from_rotvec(fraction * limit * direction)
            x[vector] = (turn * Rotation.from_rotvec(nominal[vector])).as_rotvec()
            return x

        name = f"tracker rotation {axis}"
        found.append(Varied(name, name, None, "deg", -3, 3, turned, i, (-limit, limit)))
    return found


def together(robot: Robot, varied: list[Varied]) -> tuple[Array, Array]:
    """Lowest and highest value of every parameter when all vary; the turn of the tracker frame counts from it."""
    low = recording.values(robot)[: len(parameters.names_of(robot.n_tubes))]
    high = low.copy()
    for one in varied:
        low[one.index], high[one.index] = min(one.ends), max(one.ends)
    return low, high
