"""The verdict: one word for programs, plain sentences for people. Both follow from the probabilities of explanations.

| word | where |
|---|---|
| `nothing_missing` | noise alone is the most probable explanation, or explains the residual and no effect is sure |
| `not_in_catalogue` | a cause outside the catalogue is, and no effect predicts held-out runs better; or none is sure |
| `stand_in` | a cause outside the catalogue is; effects imitate it and predict held-out runs better |
| `ambiguous` | effects are, and the data cannot tell some of them apart |
| `identified` | effects are, and act with a probability of SURE without a cause outside the catalogue |
| `probable` | effects are, with less |
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ctcr import settings
from ctcr.diagnose.explanations import Explanation, probability, weighed
from ctcr.diagnose.form_errors import form_error
from ctcr.diagnose.residual import Residual
from ctcr.diagnose.round import Round
from ctcr.diagnose.selection import Accepted
from ctcr.show.wording import join, listed, most

SHOWN = 0.99  # probability of all explanations that are shown, together


@dataclass
class Verdict:
    word: str  # nothing_missing, identified, probable, ambiguous, stand_in, not_in_catalogue
    probability: float  # that it is right
    explanations: list[Explanation]  # all that were weighed, the most probable first
    sentences: list[str] = field(default_factory=list)

    @property
    def rows(self) -> list[list[str]]:
        """What acts, and with which probability, of the likeliest explanations."""
        return [[one.text, most(one.probability)] for one in self.likeliest]

    @property
    def likeliest(self) -> list[Explanation]:
        """Those that people look at: the most probable ones, together nearly certain."""
        before = np.cumsum([0.0, *(one.probability for one in self.explanations)])[:-1]
        return [one for one, sum_ in zip(self.explanations, before, strict=True) if sum_ < SHOWN]

    @property
    def undecided(self) -> list[str]:
        """Ids of the effects that some of the likeliest explanations hold, and others do not."""
        likely = [one.effects for one in self.likeliest]
        return sorted(frozenset.union(*likely) - frozenset.intersection(*likely))

    @property
    def names_no_cause(self) -> bool:
        """Whether something is missing, and no effect of the catalogue is said to be it."""
        return self.word in ("stand_in", "not_in_catalogue")


def judge(rounds: list[Round], accepted: list[Accepted], residual: Residual, explained: Mapping[str, float]) -> Verdict:
    """
    explained    fraction of the unexplained chi-square that effects explain, by held-out run (explained_by_run)
    """
    every = weighed(rounds, accepted, residual, explained.values())
    classes = [a.ids for a in accepted]
    outside = sum(one.probability for one in every if one.outside)
    noise = sum(one.probability for one in every if not one.effects and not one.outside)
    likeliest = every[0]
    if likeliest.outside and not likeliest.effects:
        names = join([a.id for a in accepted])
        if accepted and not (explained and np.median([*explained.values()]) <= 0):
            beside = "it" if len(accepted) == 1 else "them"
            acts = f"a cause outside the catalogue acts, alone or beside {beside} (probability {most(outside)})"
            return Verdict("stand_in", outside, every, [f"{names} can explain a part of the error, but {acts}."])
        sentences = ["Something is missing that no effect of the catalogue explains.", *residual.about_outliers]
        if accepted:
            sentences.append(f"With {names} the fitted readings are predicted better, and the held-out ones are not.")
        return Verdict("not_in_catalogue", outside, every, sentences)
    if not accepted:
        if likeliest.effects and residual.structured:
            rival = f"the likeliest explanation, {likeliest.text} ({most(likeliest.probability)}), is not decided"
            sentences = [f"More than noise is left; {rival} by these data.", *residual.about_outliers]
            return Verdict("not_in_catalogue", 1 - noise, every, sentences)
        sentences = ["Calibration and the tracker's noise explain these measurements."]
        if likeliest.effects:
            likelier = f"{likeliest.text} ({most(likeliest.probability)}) is likelier than noise alone"
            sentences.append(f"Yet {likelier}, which these data do not decide.")
        return Verdict("nothing_missing", noise, every, sentences)
    present, alone = probability(every, classes), probability(every, classes, outside=False)
    names = join([" or ".join(ids) for ids in classes])
    verb = "explains" if len(accepted) == 1 else "explain"
    sentences = [f"Given this catalogue, {names} {verb} the error (probability {most(alone)})."]
    if residual.rejected:
        usual = 1 - (2 * form_error(accepted)) ** 2
        odd = [run for run, share in explained.items() if share < usual]
        sentences += [f"More than noise is left{f', most of it in {listed(odd)}' if odd else ''}."]
    sentences += residual.about_outliers
    if any(len(ids) > 1 for ids in classes):
        return Verdict("ambiguous", present, every, ["These data cannot tell some effects apart.", *sentences])
    word = "identified" if alone >= settings.SURE else "probable"
    rival = next((one for one in every if not one.has(classes) or one.outside), None)
    if word == "probable" and rival:
        sentences.append(f"The next explanation is {rival.text} ({most(rival.probability)}).")
    return Verdict(word, present, every, sentences)
