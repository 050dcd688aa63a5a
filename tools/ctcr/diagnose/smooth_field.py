"""A tracker's field that is distorted by more than the dipole of a small piece of metal.

A bar, a table or several pieces do not act as one dipole, but their error too is alike where readings are near to one
another. So the residual of a fit with a distorted field is modelled as a Gaussian process in space.
"""

from itertools import product

import numpy as np

from ctcr import settings
from ctcr.diagnose.engine import Engine
from ctcr.effects import catalogue
from ctcr.fit.joint import Fit
from ctcr.model.noise import Noise, changed, with_field

CORRECTED = "Errors with the effects found are corrected for it: those of held-out readings by others nearby."


def likeliest_noise(engine: Engine, fit: Fit) -> Noise | None:
    """The tracker's noise with the smooth error that a linearised fit with a distorted field leaves; None where that
    effect is not in the fit, or no smooth error is sure."""
    effects = catalogue.all_effects(engine.robot.n_tubes).values()
    of_field = {name for effect in effects if effect.names_with("source") for name in effect.names()}
    if of_field.isdisjoint(fit.names):
        return None
    engine, at = engine.thinned(fit)
    stated = engine.noise
    ratio = stated.rotation_field / stated.position_field if stated.position_field > 0 else 0.0
    tried = (
        changed(stated, position_field=size, rotation_field=turned * size, correlation_length=length)
        for length, size, turned in product(settings.SMOOTH_LENGTHS, settings.SMOOTH_SIZES, {0.0, ratio})
    )
    fits = (engine.linear_fit(at, noise=noise, weights=at.weights) for noise in tried)
    best = max(fits, key=lambda fit: fit.log_evidence)
    plain = engine.linear_fit(at, weights=at.weights)
    return best.noise if best.log_evidence > plain.log_evidence + settings.DECISIVE else None


def corrected(engine: Engine, fit: Fit, noise: Noise) -> Fit:
    """The linearised fit under that noise, to readings without the smooth error; rows that were not fitted are
    corrected by those near to them."""
    there = engine.linear_fit(fit, noise=noise, **fit.frozen)
    more, jitter = -np.nan_to_num(there.field), with_field(noise, 0.0)
    return engine.linear_fit(there, more=more, noise=jitter, max_iterations=0, **there.frozen)


def message(noise: Noise) -> str:
    return (
        "The field is distorted by more than the small piece of metal that was fitted: the residual is smooth in "
        f"space, {1e3 * noise.position_field:.2g} mm an axis (standard deviation), and changes within "
        f"{1e3 * noise.correlation_length:.2g} mm. A robot file cannot hold that: better find the metal and remove it."
    )
