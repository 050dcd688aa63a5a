"""Where a piece of metal may stand that misleads the tracker, and its coils: looked for by the slopes of its volume."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ctcr import _core
from ctcr.diagnose.candidates import Candidate

FAR = (1.1, 1.5, 2.2, 3.5)  # distances from the centre of the readings, over that of far readings
DIRECTIONS = 48
BEST = 3  # places from which better ones are looked for
LEAST = 3.0  # log evidence below which none is
STEPS = 150


def piece(engine, candidate: Candidate, worth: Callable[[NDArray], float]) -> list[tuple[Candidate, NDArray]]:
    """The candidate with the piece of metal that `worth`, of slopes (M, 6, 1), likes best, and with its slopes."""
    _, sd, _, _ = engine.priors(candidate.names)
    centre = np.median(engine.positions, axis=0)
    radius = np.quantile(np.linalg.norm(engine.positions - centre, axis=1), 0.95)

    def slopes(place: NDArray) -> NDArray:  # of metal and coils
        metal, coils = place[:3], place[3:]
        column = -sd[0] * _core.beside_metal(engine.positions - coils, metal - coils)
        column[~engine.fitted] = 0.0
        return column[:, :, None]

    def cost(place: NDArray) -> float:
        return 0.5 * float(np.sum((place[3:] / sd[4:]) ** 2)) - worth(slopes(place))

    around = centre + radius * np.outer(FAR, _directions()).reshape(-1, 3)
    tried = [np.append(metal, np.zeros(3)) for metal in around]
    costs = [cost(place) for place in tried]
    best = tried[int(np.argmin(costs))]
    if min(costs) < -LEAST:
        size = np.repeat([0.2 * radius, 0.5 * float(sd[4])], 3)
        found = [
            minimize(
                cost,
                tried[k],
                method="Nelder-Mead",
                options={"maxfev": STEPS, "initial_simplex": tried[k] + np.vstack([np.zeros(6), np.diag(size)])},
            )
            for k in np.argsort(costs)[:BEST]
        ]
        best = min(found, key=lambda result: result.fun).x
    shape = tuple(zip(candidate.names[1:], map(float, best), strict=True))
    return [(Candidate(candidate.id, candidate.names, shape), slopes(best))]


def _directions() -> NDArray:
    """Unit vectors (DIRECTIONS, 3), evenly spread."""
    turn, height = np.pi * (3 - np.sqrt(5)), (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS - 1
    angle, across = turn * np.arange(DIRECTIONS), np.sqrt(1 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
