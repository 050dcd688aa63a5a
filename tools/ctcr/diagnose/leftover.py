"""What no accepted effect explains: whether it has structure, and what it depends on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import effect_model, identify
from ctcr.compare.dependence import Ranking, rank
from ctcr.compare.sample import Sample, take_sample
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.race import is_rejected

LEVEL = 0.01  # chance that a dependence is named where there is none
OUTLIER = 0.3  # weight below which a reading's error is not looked at


@dataclass(frozen=True)
class Leftover:
    structured: bool
    before: Ranking  # of what depends on what before effects were added
    after: Ranking
    sample: Sample  # the readings that were ranked

    @property
    def depends_on(self) -> list[str]:
        return [item.name for item in self.after.chosen] if self.structured else []


def leftover_of(engine: Engine, before: identify.Fit, fit: identify.Fit) -> Leftover:
    sample = take_sample(
        engine.robot, engine.measurements, effect_model.readings(engine.robot, engine.measurements)
    )
    ranked = _rank(engine, sample, before)
    after = ranked if fit is before else _rank(engine, sample, fit)
    return Leftover(is_rejected(engine, fit), ranked, after, sample)


def _rank(engine: Engine, sample: Sample, fit: identify.Fit) -> Ranking:
    """What the position residual depends on, field error and outliers taken off."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    left = (fit.residual - fit.field)[rows, :3]
    weight: NDArray = fit.weights[rows, 0]
    left[~np.isfinite(left).all(axis=1) | ((weight > 0) & (weight < OUTLIER))] = 0.0
    pitch = engine.robot.actuation.translation_mm_per_rev
    error = left @ sample.rotation
    return rank(sample, error - error.mean(axis=0), 1e-3 * pitch if pitch else None, LEVEL)
