"""One round of forward selection: the candidates that were fitted, and what was decided."""

from dataclasses import dataclass, field, replace

import numpy as np

from ctcr.diagnose.candidates import Candidate
from ctcr.diagnose.engine import Gain
from ctcr.fit import joint


@dataclass(frozen=True)
class Entry:
    """A candidate in one round of the race."""

    candidate: Candidate
    gain: Gain  # over none, by slopes
    refit: float | None = None  # log evidence after a joint refit; None: too far behind to be refitted
    share: float = 0.0  # of the excess chi-square that it removes
    spread: float = np.inf  # standard deviation of that share
    fit: joint.Fit | None = None
    implausible: tuple[str, ...] = ()  # what its values, or those of the calibration, would have to be

    @property
    def linear(self) -> float:
        return self.gain.log_evidence - self.candidate.price

    @property
    def score(self) -> float:
        return -np.inf if self.refit is None else self.refit

    @property
    def id(self) -> str:
        return self.candidate.id


@dataclass
class Round:
    """One round: the fit before, all entries, best first, and what came of it."""

    before: joint.Fit
    entries: list[Entry]
    overlaps: dict[str, float]  # by id: share of the winner's signal that it imitates, or the other way round: the less
    accepted: Entry | None = None
    ids: list[str] = field(default_factory=list)  # the accepted effect and those the data cannot tell from it
    margin: float = np.inf  # log evidence over the best candidate outside these
    reason: str = ""  # why nothing was accepted
    needed: float = np.inf  # log evidence below which nothing is accepted in any case
    is_stand_in: bool = False  # whether the best candidate surely removes too little of the excess

    @property
    def why_not(self) -> str:
        """A sentence, or nothing where an effect was accepted."""
        return f"Nothing accepted: {self.reason}." if self.reason else ""

    @property
    def best(self) -> list[Entry]:
        """Of each effect the accepted form, or the best one; those that were refitted come first."""
        found = {entry.id: entry for entry in reversed(self.entries)}
        if self.accepted:
            found[self.accepted.id] = self.accepted
        return sorted(found.values(), key=lambda entry: (-entry.score, -entry.linear))

    def shed(self) -> None:
        """Gives back the memory of what was fitted: of many rows, a round would keep as much as all else."""
        self.before = self.before.without_readings()
        for place, entry in enumerate(self.entries):
            if entry.fit is not None:
                self.entries[place] = replace(entry, fit=entry.fit.without_readings())
            if entry is self.accepted:
                self.accepted = self.entries[place]

    def is_hopeless(self, more: float) -> bool:
        """Whether nothing would be accepted even with `more` times the readings."""
        best = max((entry.score for entry in self.entries), default=-np.inf)
        return self.accepted is None and (self.is_stand_in or more * best < self.needed)
