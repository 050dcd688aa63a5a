"""Effects that were accepted, and of what form they are."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose import decision
from ctcr.diagnose import race as racing
from ctcr.diagnose.candidates import Candidate, forms, other_strengths
from ctcr.diagnose.engine import FITS, Engine, values_of
from ctcr.diagnose.race import Entry, Progress
from ctcr.effects import catalogue
from ctcr.fit import joint

Array = NDArray[np.float64]

WRONG = 3.0  # times the stated noise that a fit admits which is hardly right
HOPELESS = 1.0  # log evidence lost per number read, as by three times the mean square error: such a law is not followed


@dataclass
class Accepted:
    """An effect that was accepted, with all that the data cannot tell from it."""

    entry: Entry
    ids: list[str]
    log_evidence: float
    margin: float
    share: float
    residual: Array | None = None  # (M, 3) [m] once it was in, with those accepted before
    aside: dict[str, float] = field(default_factory=dict)  # of its other variants, as the race left them


def with_shapes(
    engine: Engine, accepted: list[Accepted], one: Accepted, fit: joint.Fit, progress: Progress
) -> joint.Fit:
    """Frees what an accepted effect was not given in the race where that helps: its form may be another one.

    Where all of them are hardly right, those of its other strengths are tried too, of the effect accepted last.
    """
    given = one.entry.candidate
    effect = catalogue.get(given.id, engine.robot.n_tubes)
    others, ended = other_strengths(effect, given) if one is accepted[-1] else [], []
    for strength in (given, *others):
        tried = [form for form in forms(effect, strength, one.aside) if form != given]
        freed = _freed(engine, accepted, one, fit, tried, progress)
        gain = max((there.log_evidence for _, there in freed), default=-np.inf) - fit.log_evidence
        if strength is given and gain < decision.TIE:
            freed, ended = [], [(fit, one.entry, fit)]
        for entry, there in _open_laws(freed, fit):
            entries = [entry if a is one else a.entry for a in accepted]
            ended.append((racing.baseline(engine, entries, values_of(there), progress), entry, there))
            if np.max(ended[-1][0].inflation) < FITS:
                break  # it explains the readings: no other law can do more
        if min(np.max(there.inflation) for there, _, _ in ended) <= WRONG:
            break
    fit_with, entry, freed = max(ended, key=lambda end: end[0].log_evidence)
    if fit_with is fit:
        return fit
    one.entry = replace(entry, fit=freed.without_readings())
    one.share += (1 - one.share) * racing.share_of(fit, freed, len(freed.names) - len(fit.names))
    return fit_with


def _freed(
    engine: Engine, accepted: list[Accepted], one: Accepted, fit: joint.Fit, tried: list[Candidate], progress: Progress
) -> list[tuple[Entry, joint.Fit]]:
    """Forms of an accepted effect, each fitted in the noise of the fit with the given form."""
    found = []
    for form in tried:
        progress(f"freeing the shape of {form.id}")
        entry = replace(one.entry, candidate=form)
        names, fixed = racing.parameters([entry if a is one else a.entry for a in accepted])
        neutral = dict(zip(form.names, engine.priors(form.names)[0], strict=True))
        start = neutral | one.aside | dict(form.shape) | values_of(fit)
        found.append((entry, engine.fit_like(fit, names, start=start, fixed=fixed, near=True)))
    return found


def _open_laws(tried: list[tuple[Entry, joint.Fit]], fit: joint.Fit) -> list[tuple[Entry, joint.Fit]]:
    """The best form; or that of each law, the best first, where the noise of the fit before is what a wrong law asks
    for: in it laws can hardly be told apart, but for those that are far worse than what is given."""
    tried = sorted(tried, key=lambda pair: -pair[1].log_evidence)
    if np.max(fit.inflation) <= WRONG:
        return tried[:1]
    least = fit.log_evidence - HOPELESS * fit.observations
    tried = [(entry, freed) for entry, freed in tried if freed.log_evidence > least]
    laws = {}
    for entry, freed in tried:
        held = (pair for pair in entry.candidate.shape if pair[0] not in entry.candidate.names)
        laws.setdefault(tuple(held), (entry, freed))
    return list(laws.values())
