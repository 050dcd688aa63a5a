"""How far the forms of effects err, and whether a further effect is a cause or only mends these errors."""

import math
from collections.abc import Iterable, Sequence
from typing import Protocol

from ctcr import settings
from ctcr.effects import catalogue


class Explaining(Protocol):
    """An effect with the fraction that it explains of the unexplained chi-square before it."""

    @property
    def id(self) -> str: ...

    @property
    def explained(self) -> float: ...


def left_by(effects: Iterable[Explaining]) -> float:
    """Part of the amplitude of the unexplained signal that effects leave, one after the other."""
    return math.sqrt(max(1 - sum(_parts(effects)), 0.0))


def form_error(effects: Sequence[Explaining]) -> float:
    """Part of the amplitude of their common signal by which the forms of effects err, as a standard deviation: each
    errs by its own part of what it explains of the variance that those before it left."""
    errors, parts = [catalogue.get(one.id).form_error for one in effects], _parts(effects)
    if not any(parts):
        return max(errors)
    return math.sqrt(sum(part * error**2 for part, error in zip(parts, errors, strict=True)) / sum(parts))


def log_density_of_errors(left: float, error: float) -> float:
    """Log density of the amplitude that errors of the forms leave: half-normal."""
    z = left / error
    return math.log(2 / (error * math.sqrt(2 * math.pi))) - z * z / 2


def log_density_of_cause(share: float) -> float:
    """Log density of the fraction of the residual before it that a cause explains: likely large."""
    return math.log(2 * min(max(share, 1e-3), 1 - 1e-3))


def log_density_of_mend(share: float, error: float) -> float:
    """Log density of the fraction of their residual that an effect explains which only mends the forms of others:
    exponential between 0 and 1, with the error of these forms as its scale."""
    return -min(max(share, 0.0), 1.0) / error - math.log(-error * math.expm1(-1 / error))


def log_odds_of_mend(share: float, before: Sequence[Explaining]) -> float:
    """Log Bayes factor of an effect that only mends the forms of those before it over a cause, by the fraction of their
    residual that it explains. Errors of forms leave a small residual. A cause may explain any fraction, as others may
    act beside it."""
    error = form_error(before)
    return log_density_of_errors(left_by(before), error) + log_density_of_mend(share, error)


def log_odds_of_imitation(shares: Sequence[float]) -> float:
    """Log odds that the effects from some point on imitate a cause outside the catalogue, over being causes, by the
    fraction of the residual before it that each explains."""
    odds, likeliest = 0.0, -math.inf
    for k, share in reversed([*enumerate(shares)]):
        odds += log_density_of_cause(1 - share) - log_density_of_cause(share)
        prior = settings.OUTSIDE_CATALOGUE * (settings.SECOND_CAUSE if k else 1.0)
        likeliest = max(likeliest, math.log(prior) + odds)
    return likeliest


def log_odds_of_cause(share: float, before: Sequence[Explaining]) -> float:
    """Log odds that an effect, which explains this fraction of the residual before it, is a cause: over one that mends
    the forms of earlier effects, where there are any, and over one that imitates a cause outside the catalogue."""
    imitation = log_odds_of_imitation([share])
    return -max(log_odds_of_mend(share, before), imitation) if before else -imitation


def _parts(effects: Iterable[Explaining]) -> list[float]:
    """Part of the unexplained variance that each explains, one after the other."""
    parts, remains = [], 1.0
    for one in effects:
        parts.append(remains * min(max(one.explained, 0.0), 1.0))
        remains -= parts[-1]
    return parts
