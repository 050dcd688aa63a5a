"""When the tracker frame may have jumped: between runs, or at a longer pause."""

import numpy as np
from numpy.typing import NDArray

from ctcr import recording
from ctcr.diagnose.candidates import Candidate

WHEN = "effects.frame_jump.when"
MOST = 40  # moments that are tried


def moments(engine, candidate: Candidate, columns: NDArray) -> list[tuple[Candidate, NDArray]]:
    """The candidate at each moment, with its slopes; `columns` are those of a frame displaced in all rows."""
    part = recording.session_part(engine.measurements)
    starts = np.flatnonzero(np.diff(engine.measurements.run)) + 1
    if len(starts) < 3:
        starts = np.linspace(0, len(part), MOST + 2, dtype=int)[1:-1]
    starts = starts[np.linspace(0, len(starts) - 1, min(MOST, len(starts)), dtype=int)]
    options = []
    for start in np.unique(starts):
        when = 0.5 * (part[start - 1] + part[start])
        after = (part > when)[:, None, None]
        options.append((Candidate(candidate.id, candidate.names, ((WHEN, float(when)),)), columns * after))
    return options
