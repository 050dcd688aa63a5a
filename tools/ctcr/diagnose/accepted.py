"""Effects that were accepted, and of what form they are."""

from dataclasses import dataclass, field, replace

import numpy as np

from ctcr import effects, identify
from ctcr.diagnose import decision
from ctcr.diagnose import race as racing
from ctcr.diagnose.candidates import forms
from ctcr.diagnose.engine import FITS, Engine, values_of
from ctcr.diagnose.race import Entry, Progress

WRONG = 3.0  # times the stated noise that a fit admits which is hardly right


@dataclass
class Accepted:
    """An effect that was accepted, with all that the data cannot tell from it."""

    entry: Entry
    ids: list[str]
    log_evidence: float
    margin: float
    share: float
    rms_mm: float = np.nan  # of the runs that no fit saw, once it was in, with those accepted before
    aside: dict[str, float] = field(default_factory=dict)  # of its other variants, as the race left them


def with_shapes(
    engine: Engine, accepted: list[Accepted], one: Accepted, fit: identify.Fit, progress: Progress
) -> identify.Fit:
    """Frees what an accepted effect was not given in the race where that helps: its form may be another one."""
    tried = _freed(engine, accepted, one, fit, progress)
    best = max((freed.log_evidence for _, freed in tried), default=-np.inf)
    if best - fit.log_evidence < decision.TIE:
        return fit
    ended = []
    for entry, freed in _open_laws(tried, fit):
        entries = [entry if a is one else a.entry for a in accepted]
        ended.append((racing.baseline(engine, entries, values_of(freed), progress), entry, freed))
        if np.max(ended[-1][0].inflation) < FITS:
            break  # it explains the readings: no other law can do more
    fit_with, entry, freed = max(ended, key=lambda one: one[0].log_evidence)
    one.entry = replace(entry, fit=freed.without_readings())
    one.share += (1 - one.share) * racing.share_of(fit, freed, len(freed.names) - len(fit.names))
    return fit_with


def _freed(
    engine: Engine, accepted: list[Accepted], one: Accepted, fit: identify.Fit, progress: Progress
) -> list[tuple[Entry, identify.Fit]]:
    """All forms of an accepted effect that give it more, each fitted in the noise of the fit with the given form."""
    given = one.entry.candidate
    tried = []
    for form in forms(effects.get(given.id, engine.robot.n_tubes), given, one.aside):
        if form == given:
            continue  # nothing is left to free
        progress(f"freeing the shape of {given.id}")
        entry = replace(one.entry, candidate=form)
        names, fixed = racing.parameters([entry if a is one else a.entry for a in accepted])
        neutral = dict(zip(form.names, engine.priors(form.names)[0], strict=True))
        start = neutral | one.aside | dict(form.shape) | values_of(fit)
        tried.append((entry, engine.fit_like(fit, names, start=start, fixed=fixed, near=True)))
    return tried


def _open_laws(
    tried: list[tuple[Entry, identify.Fit]], fit: identify.Fit
) -> list[tuple[Entry, identify.Fit]]:
    """The best form; or that of each law, the best first, where the noise of the fit before is what a wrong law asks
    for: in it laws can hardly be told apart."""
    tried = sorted(tried, key=lambda pair: -pair[1].log_evidence)
    if np.max(fit.inflation) <= WRONG:
        return tried[:1]
    laws = {}
    for entry, freed in tried:
        held = (pair for pair in entry.candidate.shape if pair[0] not in entry.candidate.names)
        laws.setdefault(tuple(held), (entry, freed))
    return list(laws.values())
