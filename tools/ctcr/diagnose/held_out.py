"""Prediction of runs that a fit has not seen: cross-validation within the fitted runs, and the held-out runs."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.diagnose.engine import Engine, effects_in, values_of
from ctcr.errors import InputError, Problem
from ctcr.fit import folds, joint
from ctcr.model.noise import with_field
from ctcr.show.wording import counted
from ctcr.table.measurements import Measurements


def check_size(measurements: Measurements) -> None:
    """Raises InputError where too little was measured to fit a part of it and to judge on the rest."""
    count = int(measurements.measured.sum())
    if not count:
        raise InputError(Problem("the table holds no measured poses: nothing can be fitted"))
    if count < settings.FOLDS:
        text = f"{counted(count, 'measured pose')}: effects are fitted to a part and judged on the rest, which takes"
        raise InputError(Problem(f"{text} {settings.FOLDS} or more", measurements.source))


def cross_validated(engine: Engine, fit: joint.Fit, noise: Any = None) -> Array:
    """Mean square position errors [mm^2] of fitted runs, each left out with a few others, of the model linearised at a
    fit."""
    group = folds.groups(engine.measurements)
    plain, squares = fit.weights[:, 0] > settings.OUTLIER_WEIGHT, []
    for fold in folds.each_fold(group):
        out = engine.rows & fold
        if not out.any():
            continue
        inflation = fit.inflation if noise is None else None  # another noise has its own
        trial = engine.linear_fit(fit, noise=noise, weights=fit.weights * ~out[:, None], inflation=inflation)
        square = 1e6 * np.sum(trial.residual[:, :3] ** 2, axis=1)
        judged = out & plain & np.isfinite(square)
        of_run = np.bincount(group[judged], square[judged]) / np.maximum(np.bincount(group[judged]), 1)
        squares += of_run[of_run > 0].tolist()
    return np.array(squares)


def typical(squares: Array) -> float:
    """The geometric mean. A run that goes where no other went would dominate the arithmetic mean."""
    return float(np.exp(np.log(squares).mean()))


def fit_to_predict(
    engine: Engine, fit: joint.Fit, fixed: dict[str, float], tolerance: float = settings.COARSE
) -> joint.Fit:
    """The same parameters fitted under the noise that predicts best; `fixed` are values of effects that are held."""
    noise = _noise_that_predicts(engine, fit)
    if noise is fit.noise:
        return fit
    start = values_of(fit)
    return engine.fit(
        effects_in(fit), start=start, fixed=fixed, noise=noise, weights=fit.weights, near=True, tolerance=tolerance
    )


def _noise_that_predicts(engine: Engine, fit: joint.Fit) -> Any:
    """The noise of a fit, or that with the part of the field error that predicts left-out runs better.

    A field error that is not there lets calibration stay wrong; one that is there and left out biases it.
    """
    tried = {part: with_field(engine.noise, part) for part in settings.FIELD_PARTS}
    errors = {part: typical(cross_validated(engine, fit, noise)) for part, noise in tried.items()}
    part = min(errors, key=lambda part: errors[part])
    usual = min(tried, key=lambda p: abs(tried[p].position_field - fit.noise.position_field))
    return fit.noise if errors[part] > settings.NOISE_BETTER**2 * errors[usual] else tried[part]


def unexplained_of(fit: joint.Fit, rows: Mask, *, positions_alone: bool = False) -> Callable[[Array], float]:
    """The unexplained chi-square of a residual (M, 6) in some rows (M,) that were not fitted, as a function of it.

    Its unit is the noise as stated, the tracker's smooth error included: where that is large, millimetres say little.
    What the uncertainty of the fitted parameters explains does not count. Readings that are outliers of `fit` count
    for little, so `fit` should be the better one of the fits that are compared.
    """
    weights = joint.linear_fit(fit, only=rows, max_iterations=0).weights.copy()
    if positions_alone:
        weights[:, 1] = 0.0
    noise = joint.linear_fit(fit, only=rows, weights=weights, inflation=np.ones(2), max_iterations=0)

    _, jacobian = noise.whitened()
    expected = len(jacobian) + float(np.sum(jacobian @ fit.covariance * jacobian))

    def unexplained(residual: Array) -> float:
        whitened = noise.whiten(np.nan_to_num(residual[rows]))
        return max(float(np.sum(whitened**2)) - expected, 0.0)

    return unexplained


def explained_by_run(engine: Engine, before: joint.Fit, after: joint.Fit) -> dict[str, float]:
    """Fraction of the unexplained chi-square of positions that `after` explains, by the name of each held-out run.

    Runs that noise explains under `before` are left out. Where it explains all, they are judged together: effects must
    not make them worse by more than three standard deviations of their chi-square.
    """
    table = engine.measurements
    group, fractions = folds.groups(table), {}
    for k in np.unique(group[~engine.rows]):
        rows = (group == k) & ~engine.rows & table.measured
        unexplained = unexplained_of(after, rows, positions_alone=True)
        to_explain = unexplained(before.residual)
        if to_explain > 3 * np.sum(rows):  # as much as the noise leaves: less does not say how much effects explain
            run, lines = np.unique(table.run[rows]), table.row[rows]
            is_run = len(run) == 1 and not np.any((table.run == run[0]) & (group != k))
            name = f"run {run[0]}" if is_run else f"rows {lines.min()} to {lines.max()}"
            fractions[name] = 1 - unexplained(after.residual) / to_explain
    every = ~engine.rows & table.measured
    if not fractions and every.any():
        unexplained, scatter = unexplained_of(after, every, positions_alone=True), np.sqrt(6 * np.sum(every))
        worse = max(unexplained(after.residual) - 3 * scatter, 0.0)
        fractions = {"the held-out readings": 1 - worse / max(unexplained(before.residual), scatter)} if worse else {}
    return fractions
