"""What comes of a round of the race: an effect is accepted, with those the data cannot tell from it, or none is."""

from collections.abc import Collection

import numpy as np

from ctcr.diagnose.round import Entry, Round

EVIDENCE = 5.0  # of the best candidate over none, beyond the price of having looked at many: log(number of candidates)
UNASKED = 10.0  # evidence needed of a further effect besides where noise alone explains what is left, and
FIRST_UNASKED = 5.0  # of the first one
SHARE = 0.25  # of the excess that a further effect must remove, and
FIRST_SHARE = 0.1  # the first one, and
STAND_IN_SHARE = 0.5  # a look-alike of one whose law is not known, which it imitates in part
TIE = 3.0  # candidates whose log evidence is nearer than this cannot be told apart
ALIKE = 0.5  # ... and of forms of one effect the plainest is taken
SAME = 0.95  # share of a signal that another candidate can imitate, both ways: the same to these data


def decide(round_: Round, tried: int, is_further: bool, is_rejected: bool, stand_ins: Collection[str] = ()) -> None:
    """Accepts the best entry, with all that the data cannot tell from it, or says why not.

    tried: number of effects that were looked at; is_further: whether others are in the model already; is_rejected:
    whether the noise as stated does not explain what is left; stand_ins: look-alikes of those in the model whose law is
    not known.
    """
    unasked = UNASKED if is_further else FIRST_UNASKED
    round_.needed = EVIDENCE + np.log(tried)
    threshold = round_.needed + (0.0 if is_rejected else unasked)
    refitted = [entry for entry in round_.entries if entry.fit is not None]
    fitted = [entry for entry in refitted if not (is_further and entry.implausible)]
    if not fitted:
        round_.reason = "no candidate explains anything"
        if refitted:
            wanted = ", ".join(refitted[0].implausible)
            round_.reason = f"the best candidate, {refitted[0].id}, wants what is hardly possible, {wanted}"
        return
    best = fitted[0]
    alike = [entry for entry in fitted if entry.id == best.id and best.score - entry.score < ALIKE]
    best = min(alike, key=lambda entry: len(entry.candidate.shape))
    if best.score < threshold:
        round_.reason = f"the best candidate, {best.id}, gains {best.score:.1f} in log evidence: below {threshold:.1f}"
        return
    needed = SHARE if is_further else FIRST_SHARE
    if best.id in stand_ins:
        needed = STAND_IN_SHARE
    if best.share < needed:
        round_.is_stand_in = best.share + 2 * best.spread < needed
        share = f"{best.share:.0%} of what is left: below {needed:.0%}"
        round_.reason = f"the best candidate, {best.id}, removes {share}, as stand-ins do"
        return
    rivals = [entry for entry in round_.entries if entry.fit is not None and entry.id != best.id]
    for rival in rivals:
        overlap = min(imitated(best, rival), imitated(rival, best))
        round_.overlaps[rival.id] = max(overlap, round_.overlaps.get(rival.id, 0.0))
    same = [entry for entry in rivals if best.score - entry.score < TIE or round_.overlaps[entry.id] >= SAME]
    round_.accepted = best
    round_.ids = [best.id, *dict.fromkeys(entry.id for entry in same)]
    others = [entry.score for entry in rivals if entry.id not in round_.ids]
    round_.margin = best.score - max(others, default=-np.inf)


def imitated(entry: Entry, by: Entry) -> float:
    """Share of an entry's signal that another one can imitate together with the calibration."""
    signal = entry.gain.signal
    q, r = np.linalg.qr(by.gain.columns)
    keep = np.abs(np.diag(r)) > 1e-9 * np.abs(np.diag(r)).max(initial=1e-300)
    return float(np.sum((q[:, keep].T @ signal) ** 2) / max(signal @ signal, 1e-300))
