"""The race: every candidate judged after a joint refit with the calibration, one accepted at a time."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose import contact, jump, metal, unsteady
from ctcr.diagnose.candidates import Candidate, is_of_metal
from ctcr.diagnose.decision import decide
from ctcr.diagnose.engine import OUTLIER, Engine, values_of
from ctcr.diagnose.prediction import predicts_better
from ctcr.diagnose.round import Entry, Round
from ctcr.effects import catalogue
from ctcr.errors import InputError
from ctcr.fit import folds, joint, one_sided

Array = NDArray[np.float64]
Progress = Callable[[str], None]

SURE = 5.0  # log evidence beyond which candidates can surely be told apart
CERTAIN = 200.0  # log evidence of a further effect that runs left out, by slopes alone, do not outweigh
REFITS = 6  # effects that are refitted, the best by their slopes
ITERATIONS = 5  # of a refit: kinks of an effect that is far behind need not be followed to the end
CONTENDS = 0.5  # of the best gain: a candidate with more is followed to the end
END = 50  # iterations by which a refit has ended, or never will
IN_REACH = 0.8  # of the best evidence on a few of many rows: candidates below it are not refitted to all
NEAR = 0.2  # of the best gain by slopes: candidates below it are not refitted
MAX_EFFECTS = 4
MOST_OUTLIERS = 0.01  # share of readings: where more are far off, the model may be wrong and not they


def misfit(fit: joint.Fit) -> float:
    """Chi-square of residual and prior, in units of the fit's inflated noise."""
    return fit.admitted_chi_square + fit.shift_square


def explained(fit: joint.Fit) -> float:
    """Chi-square that the noise as stated explains, in the units of misfit()."""
    position, rotation = fit.inflation
    used = (fit.weights > 0).sum(axis=0)
    return float(3 * (used[0] / position**2 + used[1] / rotation**2))


def excess(fit: joint.Fit) -> float:
    """Chi-square beyond what the noise as stated explains, at least its usual scatter."""
    return max(misfit(fit) - explained(fit), np.sqrt(2 * fit.observations))


def share_of(before: joint.Fit, after: joint.Fit, added: int) -> float:
    """Part of the excess that `added` parameters remove, at the same weights and noise."""
    removed = misfit(before) - misfit(after) - added
    return float(removed / max(excess(before), removed, 1.0))


def outliers(fit: joint.Fit) -> float:
    """Share of the fitted readings that are taken for outliers."""
    used = fit.weights[:, 0] > 0
    return float(np.mean(fit.weights[used, 0] < OUTLIER)) if used.any() else 0.0


def parameters(entries: Collection[Entry]) -> tuple[list[str], dict[str, float]]:
    """Names of all parameters of effects that are fitted, and the values at which others are held."""
    names = [name for entry in entries for name in entry.candidate.names]
    return names, dict(pair for entry in entries for pair in entry.candidate.shape)


def aside(round_: Round) -> dict[str, float]:
    """Values of variants of the accepted effect whose shape was fitted in the race, but which were not accepted."""
    found = {}
    for entry in reversed(round_.entries):
        if entry.id == round_.accepted.id and entry.fit is not None and entry is not round_.accepted:
            own = entry.candidate.names
            if any(name in own for name, _ in entry.candidate.shape):  # a place of strength 0 has no slopes
                found |= {name: value for name, value in values_of(entry.fit).items() if name in own}
    return found


def baseline(engine: Engine, accepted: list[Entry], start: dict[str, float], progress: Progress) -> joint.Fit:
    """Calibration and the accepted effects, outliers weighted; the part of the field error that the data ask for."""
    progress("calibration")
    names, fixed = parameters(accepted)
    return likeliest(engine, names, start, fixed)


def likeliest(engine: Engine, names: Sequence[str], start: dict[str, float], fixed: dict[str, float]) -> joint.Fit:
    """Calibration and these parameters of effects, fitted with the part of the field error that the data ask for."""

    def again(values: Array, like: joint.Fit | None) -> joint.Fit:
        from_there = dict(zip(full.names, map(float, values), strict=True))
        if like is None:
            return engine.fit(names, start=from_there, fixed=fixed, near=True)
        return engine.fit_like(like, names, start=from_there, fixed=fixed, near=True, tolerance=joint.COARSE)

    full = engine.fit(names, start=start, fixed=fixed, near=bool(start))
    full = one_sided.crossed(full, again)
    noise = engine.likeliest_noise(full)
    # From the full model's place: what effects do far from there, slopes do not tell.
    if noise is full.noise:
        return full
    return engine.fit(names, start=values_of(full), fixed=fixed, noise=noise, near=True)


def arrived(engine: Engine, before: joint.Fit, accepted: list[Entry]) -> joint.Fit:
    """Where the refit of the last accepted effect leads in the end, at the weights of the fit before."""
    fit = accepted[-1].fit
    if fit.converged:
        return fit
    names, fixed = parameters(accepted)
    return engine.fit_like(before, names, start=values_of(fit), fixed=fixed, near=True)


def race(
    engine: Engine, before: joint.Fit, candidates: list[Candidate], accepted: list[Entry], progress: Progress
) -> Round:
    """One round: screens all candidates by their slopes, refits the best, and decides."""
    progress("screening all candidates")
    names, fixed = parameters(accepted)
    if accepted:  # what a refit without a further effect finds too is no gain of one
        again = engine.fit_like(before, names, start=values_of(before), fixed=fixed, near=True, tolerance=joint.COARSE)
        before = max(before, again, key=lambda fit: fit.log_evidence)
    screened = screen(*engine.thinned(before), candidates, fixed)
    if not screened:
        return Round(before, [], {}, reason="no effect is left to try")
    worth = [entry for entry in screened if entry.linear > max(1.0, NEAR * screened[0].linear)]
    chosen: list[Entry] = []
    for entry in _other_strengths_first(worth):
        same = [other for other in chosen if other.id == entry.id]
        if len(same) < 2 and (same or len({other.id for other in chosen}) < REFITS):
            chosen.append(entry)
    chosen = _in_reach(engine, before, chosen, fixed, progress)
    entries = refitted(engine, before, chosen, fixed, progress)
    if accepted:
        before, entries = _without_candidate(engine, before, entries, names, fixed)
    fitted = [entry.candidate for entry in entries]
    entries += [entry for entry in screened if entry.candidate not in fitted]
    entries.sort(key=lambda entry: (-entry.score, -entry.linear))
    round_ = Round(before, entries, {})
    tried = len({c.id for c in candidates})
    decide(round_, tried, bool(accepted), engine.rejects(before), _stand_ins(engine, accepted))
    unsure = round_.accepted and accepted and round_.accepted.score < CERTAIN
    if unsure and not predicts_better(engine, before, round_.accepted.fit):
        round_.reason = f"{round_.accepted.id} would not predict other runs better"
        round_.accepted, round_.ids = None, []
    round_.shed()
    return round_


def _other_strengths_first(entries: list[Entry]) -> list[Entry]:
    """In their order, but forms of the same parameters of an effect last: once it is accepted, all forms are tried."""
    first = {entry.candidate.names: entry for entry in reversed(entries)}
    return sorted(entries, key=lambda entry: first[entry.candidate.names] is not entry)


def _stand_ins(engine: Engine, accepted: list[Entry]) -> set[str]:
    """Look-alikes of accepted effects whose law is not known: it may be none of those that are offered."""
    known = (catalogue.get(entry.id, engine.robot.n_tubes) for entry in accepted)
    unsure = (effect for effect in known if effect.choices)
    return {identity for effect in unsure for identity in effect.look_alikes}


def screen(engine: Engine, before: joint.Fit, candidates: list[Candidate], fixed: dict[str, float]) -> list[Entry]:
    """All candidates with their gain by slopes, best first."""
    linear = unsteady.linear(engine, before)
    candidates = [c for c in candidates if not set(c.names) & set(before.names)]
    names = list(dict.fromkeys([name for c in candidates for name in c.names] + contact.FORCE))
    slopes = engine.slopes(before, names, fixed | {jump.WHEN: -1.0})
    place = {name: i for i, name in enumerate(names)}
    entries = []

    def worth(columns: Array) -> float:
        return linear.gain(before.whiten(columns)).log_evidence

    for candidate in candidates:
        own = slopes[:, :, [place[name] for name in candidate.names]]
        if candidate.shape:
            own = engine.slopes(before, candidate.names, fixed | dict(candidate.shape))
        kinds = [[(candidate, own)]]  # of each the best enters
        if candidate.id == "frame_jump":
            kinds = [jump.moment(engine, candidate, own, worth)]
        elif candidate.id == "contact":
            tip = slopes[:, :, [place[name] for name in contact.FORCE]] / engine.priors(contact.FORCE)[1]
            kinds = [contact.planes(engine, candidate, tip, part) for part in contact.DEPTHS]
        elif is_of_metal(candidate.names[0]):
            kinds = [metal.piece(engine, candidate, worth)]
        for options in kinds:
            gains = [(linear.gain(before.whiten(columns)), variant) for variant, columns in options]
            if gains:
                gain, variant = max(gains, key=lambda pair: pair[0].log_evidence)
                entries.append(Entry(variant, gain))
    return sorted(entries, key=lambda entry: -entry.linear)


def _in_reach(
    engine: Engine, before: joint.Fit, chosen: list[Entry], fixed: dict[str, float], progress: Progress
) -> list[Entry]:
    """Those that a refit to a few of many rows does not leave far behind the best, with where that ended."""
    few = folds.few_of(engine.fitted)
    if few is None or len(chosen) < 2:
        return chosen
    small = replace(engine, rows=few)
    added = [name for name in before.names if name.startswith("effects.")]
    base = small.fit_like(before, added, start=values_of(before), fixed=fixed, near=True)
    tried = refitted(small, base, chosen, fixed, progress)
    best = max(entry.score for entry in tried)
    reach = min(best, IN_REACH * best)  # the best itself always is
    return [replace(entry, fit=there.fit) for entry, there in zip(chosen, tried, strict=True) if there.score >= reach]


def refitted(
    engine: Engine, before: joint.Fit, entries: list[Entry], fixed: dict[str, float], progress: Progress
) -> list[Entry]:
    """The entries after a joint fit with calibration and what was accepted before, at the same weights and noise."""
    evidence = unsteady.evidence(engine, before)
    tried = [_refit(engine, before, evidence, entry, fixed, progress, ITERATIONS) for entry in entries]
    near = CONTENDS * max((entry.score for entry in tried), default=0.0)
    return [
        _refit(engine, before, evidence, entry, fixed, progress, END)
        if entry.fit and not entry.fit.converged and entry.score > near
        else entry
        for entry in tried
    ]


def _without_candidate(
    engine: Engine, before: joint.Fit, entries: list[Entry], names: list[str], fixed: dict[str, float]
) -> tuple[joint.Fit, list[Entry]]:
    """The fit before and the entries, after a fit without the best candidate from where it led: what that finds too, as
    another place of the effects accepted before, is no gain of it."""
    best = max((entry for entry in entries if entry.fit), key=lambda entry: entry.score, default=None)
    if best is None:
        return before, entries
    there = engine.fit_like(before, names, start=values_of(best.fit), fixed=fixed, near=True, tolerance=joint.COARSE)
    found = there.log_evidence - before.log_evidence
    if found <= 0:
        return before, entries
    entries = [
        entry
        if entry.fit is None
        else replace(entry, refit=entry.refit - found, share=share_of(there, entry.fit, len(entry.candidate.names)))
        for entry in entries
    ]
    return there, entries


def _refit(
    engine: Engine,
    before: joint.Fit,
    evidence: float,
    entry: Entry,
    fixed: dict[str, float],
    progress: Progress,
    iterations: int,
) -> Entry:
    """One of them; `evidence` is that of the fit before."""
    candidate = entry.candidate
    progress(f"fitting {candidate.label}")
    added = [name for name in before.names if name.startswith("effects.")]
    first = values_of(entry.fit) if entry.fit else begin(engine, before, entry)
    for start in (first, values_of(before)):
        try:
            fit = engine.fit_like(
                before,
                [*added, *candidate.names],
                start=start,
                fixed=fixed | dict(candidate.shape),
                max_iterations=iterations,
                tolerance=joint.COARSE,
                near=entry.fit is not None,
            )
            break
        except InputError:
            continue  # the model has no solution there
    else:
        return replace(entry, fit=None)
    share = share_of(before, fit, len(candidate.names))
    return replace(
        entry,
        refit=unsteady.evidence(engine, fit) - evidence - candidate.price,
        share=share,
        # A chi-square removed has a standard deviation of twice its root.
        spread=2 * np.sqrt(max(share, 0.0) / max(excess(before), 1.0)),
        fit=fit,
        implausible=tuple(implausible(engine, fit, candidate)),
    )


def begin(engine: Engine, before: joint.Fit, entry: Entry) -> dict[str, float]:
    """Where the slopes say that the refit will end."""
    fitted = entry.candidate.names[: len(entry.gain.values)]  # the shapes of a contact come after
    neutral, sd, _, _ = engine.priors(fitted)
    moved = before.values + before.prior_sd * entry.gain.calibration[: len(before.names)]
    own = dict(zip(fitted, neutral + sd * entry.gain.values, strict=True))
    return dict(zip(before.names, map(float, moved), strict=True)) | dict(entry.candidate.shape) | own


def implausible(engine: Engine, fit: joint.Fit, candidate: Candidate) -> list[str]:
    """Values beyond the soft bounds of their effect, by more than two standard deviations."""
    known = catalogue.parameter_of(engine.robot.n_tubes)
    found = []
    for name, value, sd in zip(fit.names, fit.values, fit.sd, strict=True):
        if name not in candidate.names or name not in known:
            continue
        low, high = known[name].soft
        if value + 2 * sd < low or value - 2 * sd > high:
            found.append(f"{name} = {value:.3g} {known[name].unit}".rstrip())
    return found
