"""How well a model predicts runs that it was not fitted to, and the noise under which it does so best."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr import settings
from ctcr.diagnose.engine import OUTLIER, Engine, values_of
from ctcr.fit import folds, joint

Array = NDArray[np.float64]

HELD_OUT_SHARE = 0.1  # of the error of other runs that a further effect must remove
# Another noise must predict other runs so much better to be preferred to that of the most evidence.
BETTER = 0.95
MUCH_BETTER = 0.9  # where the model explains the readings as it is
SOUND = 1.05  # inflation of the noise up to which it does


def held_out(engine: Engine, fit: joint.Fit, noise: Any = None) -> Array:
    """Mean square position errors [mm^2] of runs, each left out with a few others, of the model linearised at a fit."""
    group = folds.groups(engine.measurements)
    plain, squares = fit.weights[:, 0] > OUTLIER, []
    for fold in range(settings.FOLDS):
        out = engine.rows & (group % settings.FOLDS == fold)
        if not out.any():
            continue
        inflation = fit.inflation if noise is None else None  # another noise has its own
        trial = engine.linear_fit(fit, noise=noise, weights=fit.weights * ~out[:, None], inflation=inflation)
        errors = (trial.rms_mm(out & plain & (group == k)) for k in np.unique(group[out]))
        squares += [error**2 for error in errors if error > 0]
    return np.array(squares)


def typical(squares: Array) -> float:
    """Of the typical run: one that goes where no other went would outweigh all."""
    return float(np.exp(np.log(squares).mean()))


def noise_for_prediction(engine: Engine, fit: joint.Fit) -> Any:
    """The noise of a fit, or that with the part of the field error that predicts other runs better.

    A field error that is not there lets calibration stay wrong; one that is there and left out bends it.
    """
    tried = {part: engine.noise_with(part) for part in joint.FIELDS}
    errors = {part: typical(held_out(engine, fit, noise)) for part, noise in tried.items()}
    part = min(errors, key=lambda part: errors[part])
    usual = min(tried, key=lambda p: abs(tried[p].position_field - fit.noise.position_field))
    needed = MUCH_BETTER if np.max(fit.inflation) < SOUND else BETTER
    return fit.noise if errors[part] > needed**2 * errors[usual] else tried[part]


def predictive(engine: Engine, fit: joint.Fit, fixed: dict[str, float], tolerance: float = joint.COARSE) -> joint.Fit:
    """The same parameters fitted under that noise; `fixed` are values of effects that are held."""
    noise = noise_for_prediction(engine, fit)
    if noise is fit.noise:
        return fit
    added = [name for name in fit.names if name.startswith("effects.")]
    return engine.fit(
        added, start=values_of(fit), fixed=fixed, noise=noise, weights=fit.weights, near=True, tolerance=tolerance
    )


def predicts_better(engine: Engine, before: joint.Fit, after: joint.Fit) -> bool:
    """Whether a further effect makes errors of runs left out smaller by its share of what noise does not explain."""
    jitter = 3e6 * engine.noise.position_jitter**2
    old, new = typical(held_out(engine, before)), typical(held_out(engine, after))
    return old - new >= HELD_OUT_SHARE * max(old - jitter, 0.0)
