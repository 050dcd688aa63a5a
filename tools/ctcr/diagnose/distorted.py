"""A tracker's field that is distorted by more than a small piece of metal.

What a bar, a table or several pieces do is not what a dipole does, but it too is alike where readings are near to one
another: what a fit with the effect leaves is smooth in space.
"""

from typing import Any

import numpy as np

from ctcr import _core
from ctcr.diagnose.engine import Engine
from ctcr.fit.joint import Fit, with_field

EFFECT = "effects.field_distortion."
LENGTHS = (0.025, 0.04, 0.07)  # over which what is left may change [m]
SIZES = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4)  # its standard deviation [m]
SURE = 5.0  # log evidence from which it is allowed for, and told

FOLLOWED = "Errors with the effects found allow for it: readings of runs that no fit saw are corrected by those nearby."


def noise_of(engine: Engine, fit: Fit) -> Any:
    """The tracker's noise with a smooth error such as a fit with a distorted field leaves, by slopes; None where the
    effect is not in it, or leaves nothing smooth for sure."""
    if not any(name.startswith(EFFECT) for name in fit.names):
        return None
    engine, at = engine.thinned(fit)
    stated = engine.noise
    ratio = stated.rotation_field / stated.position_field if stated.position_field > 0 else 0.0
    best = engine.linear_fit(at, weights=at.weights)
    least = best.log_evidence + SURE
    for length in LENGTHS:
        for size in SIZES:
            for turned in {0.0, ratio}:
                noise = _core.Noise(
                    position_jitter=stated.position_jitter,
                    rotation_jitter=stated.rotation_jitter,
                    position_field=size,
                    rotation_field=turned * size,
                    correlation_length=length,
                )
                tried = engine.linear_fit(at, noise=noise, weights=at.weights)
                best = max(best, tried, key=lambda one: one.log_evidence)
    return best.noise if best.log_evidence > least else None


def taken_off(engine: Engine, fit: Fit, noise: Any) -> Fit:
    """The fit by slopes under that noise, to readings without the smooth error: in rows that were not fitted, as those
    near to them tell it."""
    there = engine.linear_fit(fit, noise=noise, weights=fit.weights, inflation=fit.inflation)
    return engine.linear_fit(
        there,
        more=-np.nan_to_num(there.field),
        noise=with_field(noise, 0.0),
        weights=there.weights,
        inflation=there.inflation,
        max_iterations=0,
    )


def in_words(noise: Any) -> str:
    """What is to be said of that noise."""
    return (
        "The field is distorted by more than the small piece of metal that was fitted: what that leaves is smooth, "
        f"{1e3 * noise.position_field:.2g} mm an axis (standard deviation), and changes within "
        f"{1e3 * noise.correlation_length:.2g} mm. A robot file does not hold that: better find the metal, remove it."
    )
