"""The race: every candidate judged after a joint refit with the calibration, one accepted at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ctcr import effects, identify
from ctcr.diagnose import contact, jump, split
from ctcr.diagnose.candidates import Candidate
from ctcr.diagnose.engine import Engine, Linear, values_of

Array = NDArray[np.float64]
Progress = Callable[[str], None]

EVIDENCE = 5.0  # of the best candidate over none, beyond the price of having looked at many: log(number of candidates)
SHARE = 0.25  # of the excess that an effect must remove
TIE = 3.0  # candidates whose log evidence is nearer than this cannot be told apart
SURE = 5.0  # ... and beyond this they are
SAME = 0.95  # share of a signal that another candidate can imitate, both ways: the same to these data
REFITS = 6  # effects that are refitted, the best by their slopes
NEAR = 0.5  # candidates below this part of the best linear gain are not refitted, unless few are left
MAX_EFFECTS = 4
SIGNIFICANCE = 0.01
SOUND = 1.05  # inflation of the noise up to which the model explains the readings
# Another noise must predict other runs so much better to be preferred to that of the most evidence.
BETTER = 0.95
FIELDS = (1.0, 0.3, 0.0)  # parts of the tracker's stated field error that are tried


@dataclass(frozen=True)
class Entry:
    """A candidate in one round of the race."""

    candidate: Candidate
    linear: float  # log evidence over none, by slopes
    refit: float | None = None  # after a joint refit; None: too far behind to be refitted
    share: float = 0.0  # of the excess chi-square that it removes
    fit: identify.Fit | None = None
    implausible: tuple[str, ...] = ()  # what its values, or those of the calibration, would have to be

    @property
    def score(self) -> float:
        return -np.inf if self.refit is None else self.refit

    @property
    def id(self) -> str:
        return self.candidate.id


@dataclass
class Round:
    """One round: the fit before, all entries, best first, and what came of it."""

    before: identify.Fit
    entries: list[Entry]
    overlaps: dict[
        str, float
    ]  # by id: share of the winner's signal that it imitates, or the other way round: the less
    accepted: Entry | None = None
    ids: list[str] = field(default_factory=list)  # the accepted effect and those the data cannot tell from it
    margin: float = np.inf  # log evidence over the best candidate outside these
    reason: str = ""  # why nothing was accepted


def excess(fit: identify.Fit) -> float:
    """Chi-square beyond what noise explains, in units of the fit's inflated noise."""
    position, rotation = fit.inflation
    used = (fit.weights > 0) & np.isfinite(fit.residual[:, ::3])
    explained = 3 * (used[:, 0].sum() / position**2 + used[:, 1].sum() / rotation**2)
    return fit.chi_square + fit.shift_square - explained


def is_rejected(engine: Engine, fit: identify.Fit) -> bool:
    """Whether noise alone, as stated, does not explain what is left."""
    if np.max(fit.inflation) > 1.2:
        return True
    names = [name for name in fit.names if name.startswith("effects.")]
    plain = engine.fit(
        names, start=values_of(fit), noise=fit.noise, weights=fit.weights, inflation=np.ones(2)
    )
    return plain.p_value < SIGNIFICANCE


def baseline(
    engine: Engine, accepted: list[Entry], start: dict[str, float], progress: Progress
) -> identify.Fit:
    """Calibration and the accepted effects, outliers weighted; the part of the field error that the data ask for."""
    names = [name for entry in accepted for name in entry.candidate.names]
    fixed = dict(pair for entry in accepted for pair in entry.candidate.shape)
    fits: list[identify.Fit] = []
    for part in FIELDS:
        progress(f"calibration with {part:.0%} of the stated field error")
        weights = fits[0].weights if fits else None
        fits.append(
            engine.fit(names, start=start, fixed=fixed, noise=engine.noise_with(part), weights=weights)
        )
        start = values_of(fits[-1])
    best = max(fits, key=lambda fit: fit.log_evidence)
    if best is not fits[0]:
        best = engine.fit(names, start=values_of(best), fixed=fixed, noise=best.noise)
    return best


def predictive(engine: Engine, fit: identify.Fit, accepted: list[Entry], progress: Progress) -> identify.Fit:
    """The same parameters fitted for prediction: with the part of the field error that predicts other runs best.

    A field error that is not there lets calibration stay wrong; one that is there and left out bends it.
    """
    if np.max(fit.inflation) < SOUND:
        return fit  # nothing is wrong with the model that the field could have been bent to hide
    names = [name for entry in accepted for name in entry.candidate.names]
    fixed = dict(pair for entry in accepted for pair in entry.candidate.shape)
    fold = split.groups(engine.measurements) % 4  # the fourth is locked away
    plain = fit.weights[:, 0] > 0.3
    errors: dict[float, float] = {}
    for part in FIELDS:
        progress(f"prediction with {part:.0%} of the stated field error")
        square = 0.0
        for out in (engine.rows & (fold == k) for k in range(3)):
            trial = engine.fit(
                names,
                start=values_of(fit),
                fixed=fixed,
                noise=engine.noise_with(part),
                weights=fit.weights * ~out[:, None],
            )
            square += np.nan_to_num(trial.rms_mm(out & plain)) ** 2
        errors[part] = square
    part = min(errors, key=lambda part: errors[part])
    noise = engine.noise_with(part)
    usual = min(FIELDS, key=lambda p: abs(engine.noise_with(p).position_field - fit.noise.position_field))
    if errors[part] > BETTER**2 * errors[usual]:
        return fit
    return engine.fit(names, start=values_of(fit), fixed=fixed, noise=noise, weights=fit.weights)


def race(
    engine: Engine,
    before: identify.Fit,
    candidates: list[Candidate],
    accepted: list[Entry],
    progress: Progress,
) -> Round:
    """One round: screens all candidates by their slopes, refits the best, and decides."""
    progress("screening all candidates")
    linear = engine.linear(before)
    fixed = dict(pair for entry in accepted for pair in entry.candidate.shape)
    screened = screen(engine, before, linear, candidates, fixed)
    if not screened:
        return Round(before, [], {}, reason="no effect is left to try")
    worth = [entry for entry in screened if entry.linear > 1.0]
    chosen: list[Entry] = []
    for entry in worth:
        same = [other for other in chosen if other.id == entry.id]
        if len(same) < 2 and (same or len({other.id for other in chosen}) < REFITS):
            chosen.append(entry)
    entries = [refit(engine, before, entry, fixed, progress) for entry in chosen]
    entries += [entry for entry in screened if entry not in chosen]
    entries.sort(key=lambda entry: (-entry.score, -entry.linear))
    round_ = Round(before, entries, {})
    decide(engine, round_, linear, fixed, len({c.id for c in candidates}))
    return round_


def screen(
    engine: Engine, before: identify.Fit, linear: Linear, candidates: list[Candidate], fixed: dict[str, float]
) -> list[Entry]:
    """All candidates with their linear gain, best first."""
    names = list(dict.fromkeys(name for c in candidates for name in c.names if name not in before.names))
    slopes = engine.columns(before, names, fixed | {jump.WHEN: -1.0})
    place = {name: i for i, name in enumerate(names)}
    tip = engine.columns(before, contact.FORCE, fixed) / engine.priors(contact.FORCE)[1]
    entries = []
    for candidate in candidates:
        if any(name not in place for name in candidate.names):
            continue
        own = slopes[:, :, [place[name] for name in candidate.names]]
        if candidate.id == "frame_jump":
            options = jump.moments(engine, candidate, own)
        elif candidate.id == "contact":
            options = contact.planes(engine, candidate, tip)
        else:
            options = [(candidate, own)]
        gains = [(linear.gain(before.whiten(columns)), variant) for variant, columns in options]
        if gains:
            gain, variant = max(gains, key=lambda pair: pair[0].log_evidence)
            entries.append(Entry(variant, gain.log_evidence))
    return sorted(entries, key=lambda entry: -entry.linear)


def refit(
    engine: Engine, before: identify.Fit, entry: Entry, fixed: dict[str, float], progress: Progress
) -> Entry:
    """The entry after a joint fit with calibration and what was accepted before, at the same weights and noise."""
    candidate = entry.candidate
    progress(f"fitting {candidate.label}")
    added = [name for name in before.names if name.startswith("effects.")]
    names = [*added, *candidate.names]
    try:
        fit = engine.fit(
            names, start=values_of(before) | contact.start_of(candidate), fixed=fixed | dict(candidate.shape),
            noise=before.noise, weights=before.weights, inflation=before.inflation,
        )  # fmt: skip
    except identify.InputError:
        return entry
    gained = fit.log_evidence - before.log_evidence
    removed = (
        before.chi_square + before.shift_square - fit.chi_square - fit.shift_square - len(candidate.names)
    )
    spread = np.sqrt(2 * before.observations)
    share = removed / max(excess(before), spread, removed, 1.0)
    return replace(
        entry,
        refit=gained,
        share=float(share),
        fit=fit,
        implausible=tuple(implausible(engine, fit, candidate)),
    )


def implausible(engine: Engine, fit: identify.Fit, candidate: Candidate) -> list[str]:
    """Values beyond the soft bounds of their effect, by more than two standard deviations."""
    known = effects.parameter_of(engine.robot.n_tubes)
    found = []
    for name, value, sd in zip(fit.names, fit.values, fit.sd, strict=True):
        if name not in candidate.names or name not in known:
            continue
        low, high = known[name].soft
        if value + 2 * sd < low or value - 2 * sd > high:
            found.append(f"{name} = {value:.3g} {known[name].unit}".rstrip())
    return found


def decide(engine: Engine, round_: Round, linear: Linear, fixed: dict[str, float], tried: int) -> None:
    """Accepts the best entry, with all that the data cannot tell from it, or says why not."""
    best = next((entry for entry in round_.entries if entry.fit is not None), None)
    if best is None:
        round_.reason = "no candidate explains anything"
        return
    threshold = EVIDENCE + np.log(tried)
    if best.score < threshold:
        round_.reason = (
            f"the best candidate, {best.id}, gains {best.score:.1f} in log evidence: below {threshold:.1f}"
        )
        return
    if best.share < SHARE:
        share = f"{best.share:.0%} of what is left: below {SHARE:.0%}"
        round_.reason = f"the best candidate, {best.id}, removes {share}, as stand-ins do"
        return
    rivals = [entry for entry in round_.entries if entry.fit is not None and entry.id != best.id]
    round_.overlaps = overlaps(engine, round_.before, linear, best, rivals, fixed)
    same = [entry for entry in rivals if best.score - entry.score < TIE or round_.overlaps[entry.id] >= SAME]
    round_.accepted = best
    round_.ids = [best.id, *dict.fromkeys(entry.id for entry in same)]
    others = [entry.score for entry in rivals if entry.id not in round_.ids]
    round_.margin = best.score - max(others, default=-np.inf)


def overlaps(
    engine: Engine,
    before: identify.Fit,
    linear: Linear,
    best: Entry,
    rivals: list[Entry],
    fixed: dict[str, float],
) -> dict[str, float]:
    """By id: the share of the winner's signal that a rival imitates, or of the rival's by the winner: the less."""

    def left(entry: Entry) -> tuple[Array, Array]:
        columns = before.whiten(
            engine.columns(before, entry.candidate.names, fixed | dict(entry.candidate.shape))
        )
        rest = linear.without_calibration(columns)
        mean, sd, _, _ = engine.priors(entry.candidate.names)
        fitted = values_of(entry.fit)
        eta = (np.array([fitted[name] for name in entry.candidate.names]) - mean) / sd
        return rest, rest @ eta

    def imitated(signal: Array, by: Array) -> float:
        q, r = np.linalg.qr(by)
        keep = np.abs(np.diag(r)) > 1e-9 * np.abs(np.diag(r)).max(initial=1e-300)
        return float(np.sum((q[:, keep].T @ signal) ** 2) / max(signal @ signal, 1e-300))

    own, signal = left(best)
    found: dict[str, float] = {}
    for rival in rivals:
        others, theirs = left(rival)
        overlap = min(imitated(signal, others), imitated(theirs, own))
        found[rival.id] = max(overlap, found.get(rival.id, 0.0))
    return found
