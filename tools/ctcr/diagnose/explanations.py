"""Posterior probabilities of all explanations of a table that a diagnosis weighed.

An explanation is noise alone, a set of effects, or a cause that no effect of the catalogue describes, alone or beside
effects. Four likelihoods weigh them:

- the log evidence of the joint fits. The form of an effect is known only to a part of its signal, so differences
  smaller than what an error of the form makes decide nothing: they are divided by 1 + form_error^2 times the evidence;
- the amplitude that effects leave of the unexplained signal of held-out runs, none where noise explains the residual of
  the fitted ones: half-normal with a standard deviation of the form error of the effects if nothing else acts, uniform
  if something does;
- the share that an effect explains of what was left before it: likely large for a cause that stands alone (density
  2 s), any for one beside others, likely small for an imitation (2 (1 - s)), and exponential for one that only mends
  the forms of the others. Their form error is its scale: the less exact they are, the more of what they leave may
  follow the form of another effect;
- the test of the residual of all readings, held-out ones too, against the noise as stated.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import softmax

from ctcr import settings
from ctcr.diagnose.form_errors import (
    form_error,
    left_by,
    log_density_of_cause,
    log_density_of_errors,
    log_density_of_mend,
    log_odds_of_mend,
)
from ctcr.diagnose.residual import Residual
from ctcr.diagnose.round import CandidateFit, Round
from ctcr.diagnose.selection import Accepted
from ctcr.effects import catalogue
from ctcr.show.wording import join


@dataclass(frozen=True)
class Explanation:
    """A set of effects, perhaps none, and whether a cause outside the catalogue acts too."""

    effects: frozenset[str]
    outside: bool
    probability: float

    @property
    def text(self) -> str:
        outside = "a cause outside the catalogue" if self.outside else ""
        return join([*sorted(self.effects), *filter(None, [outside])]) or "noise alone"

    def has(self, classes: Collection[Collection[str]]) -> bool:
        """Whether it holds an effect of each class."""
        return all(not self.effects.isdisjoint(alike) for alike in classes)

    def as_dict(self) -> dict[str, Any]:
        return {
            "effects": sorted(self.effects),
            "outside_catalogue": self.outside,
            "text": self.text,
            "probability": round(self.probability, 6),
        }


def weighed(
    rounds: list[Round], accepted: list[Accepted], residual: Residual, explained: Collection[float]
) -> list[Explanation]:
    """All explanations, the most probable first; their probabilities add up to 1.

    explained    fraction of the unexplained chi-square that the accepted effects explain, of each held-out run
    """
    none: frozenset[str] = frozenset()
    found = frozenset(a.id for a in accepted)
    cost = math.log(max(len({one.id for one in rounds[0].tried}), 2))  # of one effect among all
    rejects = math.log(1 - settings.REJECTION_MISSED if residual.structured else settings.REJECTION_MISSED)
    left = 1.0 if residual.structured else 0.0  # amplitude that is left of the unexplained signal
    if accepted:
        share = float(np.median([*explained])) if residual.structured and explained else 1.0
        left = math.sqrt(min(max(1 - share, 0.0), 1.0))
        complete = log_density_of_errors(left, form_error(accepted))
    else:
        complete = _noise(residual)
    values = sum(_plausible(a.best) for a in accepted)
    weights = {(found, False): complete + values}

    def weigh(effects: frozenset[str], weight: float, outside: bool = False) -> None:
        weights[effects, outside] = max(weights.get((effects, outside), -np.inf), weight)

    for a in accepted:
        refitted = _refitted(a.round)
        own, others = refitted[a.id].score, complete + values - _plausible(a.best)
        for rival in (one for one in refitted.values() if one.id not in found):  # in place of it
            behind = max(own - rival.score, 0.0)
            tempered = behind / (1 + catalogue.get(a.id).form_error ** 2 * max(own, 0.0))
            weigh(found - {a.id} | {rival.id}, others - tempered + _plausible(rival))
        rest = [b for b in accepted if b is not a]
        mends = log_odds_of_mend(a.beside, rest) if rest else -np.inf
        weigh(found - {a.id}, others - min(a.log_evidence - cost, -mends))
    for further in _refitted(rounds[-1]).values() if rounds[-1].accepted is None else ():
        gain = further.score - cost
        if accepted:  # then the forms of all of them together have to account for what is left
            leaves = log_density_of_errors(left * left_by([further]), form_error([*accepted, further]))
            mend = log_density_of_mend(further.explained, form_error(accepted))
            gain = min(gain, leaves - complete - mend)
        weigh(found | {further.id}, weights[found, False] + rejects + gain + _plausible(further))

    outside = math.log(settings.OUTSIDE_CATALOGUE) + rejects
    shares = [1 - left**2, *(a.explained for a in accepted[1:])] if accepted else []
    weigh(none, outside + sum(log_density_of_cause(1 - s) for s in shares), True)
    if accepted:
        weigh(found, outside + math.log(settings.SECOND_CAUSE) + values + sum(map(log_density_of_cause, shares)), True)
    every = [Explanation(*what, p) for what, p in zip(weights, softmax([*weights.values()]).tolist(), strict=True)]
    return sorted(every, key=lambda one: -one.probability)


def probability(
    explanations: list[Explanation], classes: Collection[Collection[str]], *, outside: bool = True
) -> float:
    """That an effect of each class acts; outside: whether a cause outside the catalogue may act too."""
    return sum(one.probability for one in explanations if one.has(classes) and (outside or not one.outside))


def _refitted(round_: Round) -> dict[str, CandidateFit]:
    """The best fit of each effect, by its id."""
    return {one.id: one for one in round_.best if one.refit is not None}


def _noise(residual: Residual) -> float:
    """Log Bayes factor of noise over what is missing, at most: -e p log p. Ref: Sellke, Bayarri & Berger 2001,
    "Calibration of p values for testing precise null hypotheses"."""
    p = min(max(residual.p_value, 1e-300), settings.OUTLIER_SIGNIFICANCE if residual.strays else 1.0)
    return math.log(-math.e * p * math.log(p)) if p < 1 / math.e else 0.0


def _plausible(one: CandidateFit) -> float:
    """Log probability that a cause has values such as these."""
    return math.log(settings.IMPLAUSIBLE) if one.implausible else 0.0
