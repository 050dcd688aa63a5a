"""When the tracker frame may have jumped: at the start of a run or at any row near the best of these."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose.candidates import Candidate
from ctcr.model import recording
from ctcr.table.measurements import Measurements

WHEN = "effects.frame_jump.when"
MOST = 40  # moments that are tried at a time

Option = tuple[Candidate, NDArray]


def moment(engine, candidate: Candidate, columns: NDArray, worth: Callable[[NDArray], float]) -> list[Option]:
    """The candidate at the best moment, with its slopes; none where no moment brings anything.

    `columns` are the slopes of a frame displaced in all rows, `worth` says what slopes bring.
    """
    measurements, best, gain = engine.measurements, None, 0.0
    part, fitted = recording.session_part(measurements), np.flatnonzero(engine.fitted)  # others cannot tell
    fitted = fitted[np.argsort(part[fitted], kind="stable")]  # rows need not be in the order of time

    def jumped(k: int) -> NDArray:
        return columns * (part >= part[fitted[k]])[:, None, None]

    places = np.flatnonzero(np.diff(measurements.run[fitted])) + 1  # among fitted rows
    if len(places) < 3:
        places = np.arange(1, len(fitted))
    while len(places):
        places = places[np.unique(np.linspace(0, len(places) - 1, MOST).astype(int))]
        gains = [worth(jumped(place)) for place in places]
        if max(gains) <= gain:
            break
        k = int(np.argmax(gains))
        best, gain = int(places[k]), gains[k]
        low, high = (places[j] if 0 <= j < len(places) else end for j, end in ((k - 1, 0), (k + 1, len(fitted))))
        places = np.setdiff1d(np.arange(low + 1, high), places)
    if best is None:
        return []
    when = float(0.5 * (part[fitted[best - 1]] + part[fitted[best]]))
    penalty = float(np.log(len(fitted) - 1))  # it could have been at any row but the first
    return [(Candidate(candidate.id, candidate.names, ((WHEN, when),), penalty), jumped(best))]


def uncertain_rows(measurements: Measurements, fitted: NDArray[np.bool_], when: float) -> NDArray[np.bool_]:
    """Rows (M,) between the last one that was fitted before a jump and the first one after it."""
    part = recording.session_part(measurements)
    before, after = part[fitted & (part < when)], part[fitted & (part > when)]
    return (part > before.max(initial=-1.0)) & (part < after.min(initial=2.0))
