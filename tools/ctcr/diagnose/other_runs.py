"""What the runs that no fit saw hold beyond noise, and how much of it a model explains.

In units of the noise as stated, the tracker's smooth error included: where that is large, millimetres say little.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose.engine import Engine
from ctcr.fit import folds
from ctcr.fit.joint import Fit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def excess_of(engine: Engine, fit: Fit, rows: Mask, *, positions_alone: bool = False) -> Callable[[Array], float]:
    """What a residual (M, 6) holds in some rows (M,) beyond noise: chi-square, less that of noise. Readings that are
    outliers of the fit, the better the model, count for little."""
    there = replace(engine, rows=rows)
    weights = there.linear_fit(fit, max_iterations=0).weights.copy()
    if positions_alone:
        weights[:, 1] = 0.0
    noise = there.linear_fit(fit, weights=weights, inflation=np.ones(2), max_iterations=0)

    def excess(residual: Array) -> float:
        whitened = noise.whiten(np.nan_to_num(residual))
        return max(float(np.sum(whitened**2)) - len(whitened), 0.0)

    return excess


def explained(engine: Engine, before: Fit, after: Fit) -> dict[str, float]:
    """Share of the excess of positions that `after` explains, of each run that was not fitted, by what it is called.
    Not of those that noise explains under `before`."""
    table = engine.measurements
    group, shares = folds.groups(table), {}
    for k in np.unique(group[~engine.rows]):
        rows = (group == k) & ~engine.rows & engine.measured
        excess = excess_of(engine, after, rows, positions_alone=True)
        unexplained = excess(before.residual)
        if unexplained > 3 * np.sum(rows):  # as much again as noise
            run, lines = np.unique(table.run[rows]), table.row[rows]
            is_run = len(run) == 1 and not np.any((table.run == run[0]) & (group != k))
            name = f"run {run[0]}" if is_run else f"rows {lines.min()} to {lines.max()}"
            shares[name] = 1 - excess(after.residual) / unexplained
    return shares
