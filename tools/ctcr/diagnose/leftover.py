"""What no accepted effect explains: whether it has structure, and what it depends on."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.dependence import Ranking, rank
from ctcr.compare.sample import Sample, take_sample
from ctcr.diagnose.engine import OUTLIER, Engine
from ctcr.diagnose.far_off import come_together
from ctcr.fit import joint
from ctcr.model import effect_model
from ctcr.show.output import listed

LEVEL = 0.01  # chance that a dependence is named where there is none
SHOWN = 6


@dataclass(frozen=True)
class Leftover:
    rejected: bool  # whether noise as stated does not explain it
    places: list[int]  # rows of the table that are far off the same way as their neighbours
    before: Ranking  # of what depends on what before effects were added
    after: Ranking
    sample: Sample  # the readings that were ranked
    allowed: list[str] = field(default_factory=list)  # what else the errors with effects allow for

    @property
    def structured(self) -> bool:
        return self.rejected or bool(self.places)

    @property
    def depends_on(self) -> list[str]:
        return [item.name for item in self.after.chosen] if self.structured else []

    @property
    def at_places(self) -> list[str]:
        """Which readings are off together; nothing where none are."""
        if not self.places:
            return []
        rows = listed(self.places, SHOWN)
        return [
            f"{len(self.places)} readings (rows {rows}) are far off the same way as their neighbours in joints and "
            "load: something acts just there."
        ]

    @property
    def in_words(self) -> list[str]:
        if not self.structured:
            return [*self.allowed, "What is left is noise."]
        on = ", ".join(item.label for item in self.after.chosen)
        depends = f"it depends on {on}" if on else "no quantity alone tells how large it is on other runs"
        rejected = [f"What is left is more than noise; {depends}."] if self.rejected else []
        return rejected + self.allowed + self.at_places


def leftover_of(engine: Engine, before: joint.Fit, fit: joint.Fit, allowed: list[str]) -> Leftover:
    sample = take_sample(engine.robot, engine.measurements, effect_model.readings(engine.robot, engine.measurements))
    ranked = _rank(engine, sample, before)
    after = ranked if fit is before else _rank(engine, sample, fit)
    places = engine.measurements.row[come_together(engine.measurements, fit)].tolist()
    return Leftover(engine.rejects(fit), places, ranked, after, sample, allowed)


def _rank(engine: Engine, sample: Sample, fit: joint.Fit) -> Ranking:
    """What the position residual depends on, field error and outliers taken off."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    left = (fit.residual - fit.field)[rows, :3]
    weight: NDArray = fit.weights[rows, 0]
    left[~np.isfinite(left).all(axis=1) | ((weight > 0) & (weight < OUTLIER))] = 0.0
    pitch = engine.robot.actuation.translation_mm_per_rev
    error = left @ sample.rotation
    return rank(sample, error - error.mean(axis=0), 1e-3 * pitch if pitch else None, LEVEL)
