"""Where a candidate begins: a global search for what no derivative finds at the neutral values.

A moment, a surface and a local source have no derivative where their amplitude is zero, and many local optima. Each is
searched by the linearised gain of the amplitude alone. The quantities of its parameters say which one an effect needs.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from ctcr import _core, settings
from ctcr.arrays import Array, Mask, evenly
from ctcr.diagnose.candidates import Candidate
from ctcr.diagnose.engine import Engine
from ctcr.effects import catalogue
from ctcr.model.recording import session_part
from ctcr.table.measurements import Measurements

Worth = Callable[[Array], float]  # linearised gain in log evidence by derivatives (M, 6, k)
Option = tuple[Candidate, Array]  # with its derivatives (M, 6, k)

EVERYWHERE = -1.0  # a moment before the session: the effect acts on all rows


def options(engine: Engine, candidate: Candidate, columns: Array, by_force: Array, worth: Worth) -> list[list[Option]]:
    """Starts of a candidate, in lists: the best start of each list takes part in the round.

    columns   (M, 6, k) derivatives by the candidate's parameters, where it has a moment: of an effect on all rows
    by_force  (M, 6, 3) derivatives by a force at the tip [1/N]
    """
    effect = catalogue.get(candidate.id, engine.robot.n_tubes)
    if moment := effect.names_with("moment"):
        return [best_moment(engine.measurements, engine.fitted, candidate, moment[0], columns, worth)]
    if surface := effect.names_with("surface"):
        return [_surfaces(engine, candidate, surface, by_force, part) for part in settings.SURFACE_OUTSIDE]
    if candidate.names[0] in effect.names_with("source"):
        return [[_source(engine, candidate, worth)]]
    return [[(candidate, columns)]]


def best_moment(
    measurements: Measurements, rows: Mask, candidate: Candidate, name: str, columns: Array, worth: Worth
) -> list[Option]:
    """The candidate from the best moment: the start of a run, or any row near the best of these. None where no moment
    gains anything. Rows (M,) that are not fitted cannot tell."""
    best, gain = None, 0.0
    part, fitted = session_part(measurements), np.flatnonzero(rows)
    fitted = fitted[np.argsort(part[fitted], kind="stable")]  # rows need not be in the order of time

    def from_row(k: int) -> Array:
        return columns * (part >= part[fitted[k]])[:, None, None]

    tried = np.flatnonzero(np.diff(measurements.run[fitted])) + 1  # among fitted rows
    if len(tried) < 3:
        tried = np.arange(1, len(fitted))
    while len(tried):
        tried = tried[evenly(len(tried), settings.MOMENTS_AT_A_TIME)]
        gains = [worth(from_row(k)) for k in tried]
        if max(gains) <= gain:
            break
        k = int(np.argmax(gains))
        best, gain = int(tried[k]), gains[k]
        low, high = (tried[j] if 0 <= j < len(tried) else end for j, end in ((k - 1, 0), (k + 1, len(fitted))))
        tried = np.setdiff1d(np.arange(low + 1, high), tried)
    if best is None:
        return []
    when = float(0.5 * (part[fitted[best - 1]] + part[fitted[best]]))
    penalty = float(np.log(len(fitted) - 1))  # it could have been at any row but the first
    return [(Candidate(candidate.id, candidate.names, ((name, when),), penalty), from_row(best))]


def rows_around(measurements: Measurements, fitted: Mask, when: float) -> Mask:
    """Rows (M,) between the last fitted one before a moment and the first one after it: on which side is unknown."""
    part = session_part(measurements)
    before, after = part[fitted & (part < when)], part[fitted & (part > when)]
    return (part > before.max(initial=-1.0)) & (part < after.min(initial=2.0))


def _surfaces(engine: Engine, candidate: Candidate, surface: list[str], by_force: Array, part: float) -> list[Option]:
    """The candidate with each plane that leaves this part of the tips outside: a force along its normal, in proportion
    to the depth of the tip."""
    stiffness, shapes = candidate.names, catalogue.get(candidate.id, engine.robot.n_tubes).shapes
    sd = engine.priors(stiffness)[1][0]
    usual = dict(zip(shapes, map(float, engine.priors(shapes)[0]), strict=True))
    found = []
    around = np.deg2rad(np.arange(0, 360, 360 / settings.SURFACE_AZIMUTHS))
    for elevation in np.deg2rad(settings.SURFACE_ELEVATIONS):
        for azimuth in around if elevation < 1.5 else [0.0]:
            height, normal = heights(engine, azimuth, elevation), _normal(azimuth, elevation)
            distance = np.quantile(height[engine.fitted], part)
            depth = np.maximum(height - distance, 0.0)
            if np.count_nonzero(depth[engine.fitted]) < settings.FEWEST_CONTACTS:
                continue
            column = -sd * depth[:, None] * (by_force @ normal)
            shape = usual | dict(zip(surface, map(float, (distance, azimuth, elevation)), strict=True))
            found.append((Candidate(candidate.id, (*stiffness, *shapes), tuple(shape.items())), column[:, :, None]))
    return found


def heights(engine: Engine, azimuth: float, elevation: float) -> Array:
    """Heights (M,) [m] of the tips above a plane through the origin of the base frame, along its normal."""
    tracker = engine.robot.tracker
    return (engine.positions - tracker.position) @ tracker.rotation @ _normal(azimuth, elevation)


def _normal(azimuth: float, elevation: float) -> Array:
    across = np.cos(elevation)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])


def _source(engine: Engine, candidate: Candidate, worth: Worth) -> Option:
    """The candidate with the best position of a local source of field: a grid around the readings, then a simplex."""
    _, sd, _, _ = engine.priors(candidate.names)
    readings = engine.positions[engine.fitted]
    centre = np.median(readings, axis=0)
    radius = np.quantile(np.linalg.norm(readings - centre, axis=1), settings.SOURCE_FAR)

    def derivative(at: Array) -> Array:  # by the volume, with metal and coils at[:3] and at[3:]
        column = -sd[0] * _core.metal_distortion(engine.positions - at[3:], at[:3] - at[3:])
        column[~engine.fitted] = 0.0
        return column[:, :, None]

    def cost(at: Array) -> float:
        return 0.5 * float(np.sum((at[3:] / sd[4:]) ** 2)) - worth(derivative(at))

    around = centre + radius * np.outer(settings.SOURCE_DISTANCES, _directions()).reshape(-1, 3)
    tried = [np.append(metal, np.zeros(3)) for metal in around]
    costs = [cost(at) for at in tried]
    best = tried[int(np.argmin(costs))]
    if min(costs) < -settings.TIE:
        edges = np.multiply(settings.SOURCE_SIMPLEX, (radius, sd[4]))
        steps = np.vstack([np.zeros(6), np.diag(np.repeat(edges, 3))])
        options = {"maxfev": settings.SOURCE_EVALUATIONS}
        found = [
            minimize(cost, at, method="Nelder-Mead", options=options | {"initial_simplex": at + steps})
            for at in (tried[k] for k in np.argsort(costs)[: settings.SOURCE_STARTS])
        ]
        best = min(found, key=lambda result: result.fun).x
    shape = tuple(zip(candidate.names[1:], map(float, best), strict=True))
    return Candidate(candidate.id, candidate.names, shape), derivative(best)


def _directions() -> Array:
    """Unit vectors (SOURCE_DIRECTIONS, 3), evenly spread on a sphere (Fibonacci lattice)."""
    count = settings.SOURCE_DIRECTIONS
    angle, height = np.pi * (3 - np.sqrt(5)) * np.arange(count), (2 * np.arange(count) + 1) / count - 1
    across = np.sqrt(1 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
