"""The residual that no accepted effect explains: whether it has structure, and on which quantities it depends."""

from dataclasses import dataclass, field

import numpy as np

from ctcr import settings
from ctcr.compare.dependence import Ranking, rank
from ctcr.compare.sample import Sample, take_sample
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.outliers import are_many, clustered, down_weighted, unexplained_runs
from ctcr.fit import joint
from ctcr.model.table_poses import readings
from ctcr.show.wording import listed, percent, runs_named


@dataclass(frozen=True)
class Residual:
    p_value: float  # of the noise as stated, of all readings
    clusters: list[int]  # rows of the table that are outliers in the same direction as their neighbours
    runs: list[int]  # of which most readings are outliers, those that no fit saw too
    many_outliers: float  # fraction of the fitted readings that are outliers, if a tracker does not make so many
    before: Ranking  # of quantities on which the residual depends, before effects were added
    after: Ranking
    sample: Sample  # the readings that were ranked
    corrections: list[str] = field(default_factory=list)  # nuisance errors for which the errors are corrected

    @property
    def rejected(self) -> bool:
        """Whether the noise as stated does not explain it."""
        return self.p_value < settings.SIGNIFICANCE

    @property
    def structured(self) -> bool:
        return self.rejected or self.strays

    @property
    def strays(self) -> bool:
        """Whether there are outliers that a tracker does not make."""
        return bool(self.clusters or self.runs or self.many_outliers)

    @property
    def depends_on(self) -> list[str]:
        return [item.name for item in self.after.chosen] if self.structured else []

    @property
    def about_outliers(self) -> list[str]:
        if self.runs:
            are = f"{runs_named(self.runs)} {'are' if len(self.runs) > 1 else 'is'}".capitalize()
            return [f"{are} unlike the others: most of the readings are outliers there. What was different?"]
        if self.many_outliers:
            many = f"{percent(self.many_outliers)} of the readings are outliers, more than a tracker makes"
            return [f"{many}: does the robot snap, or is the sensor loose?"]
        if not self.clusters:
            return []
        return [
            f"{len(self.clusters)} readings (rows {listed(self.clusters)}) are outliers in the same direction "
            "as their neighbours in joints and load: something acts at these joints."
        ]

    @property
    def messages(self) -> list[str]:
        if not self.structured:
            return [*self.corrections, "The residual is noise."]
        on = ", ".join(item.label for item in self.after.chosen)
        nothing = "no quantity alone predicts its size on held-out readings: is tracker.jitter_mm right?"
        depends = f"it depends on {on}." if on else nothing
        rejected = [f"The residual is more than noise; {depends}"] if self.rejected else []
        return rejected + self.corrections + self.about_outliers


def residual_of(engine: Engine, before: joint.Fit, fit: joint.Fit, corrections: list[str]) -> Residual:
    sample = take_sample(engine.robot, engine.measurements, readings(engine.robot, engine.measurements))
    ranked = _rank(engine, sample, before)
    after = ranked if fit is before else _rank(engine, sample, fit)
    clusters = engine.measurements.row[clustered(engine.measurements, fit)].tolist()
    many = float(down_weighted(fit).sum() / (fit.weights[:, 0] > 0).sum()) if are_many(fit) else 0.0
    runs, every = [], fit
    if not corrections:  # else a held-out run has nuisance errors of its own, which no fit knows
        runs = unexplained_runs(engine.measurements, fit)
        likeliest = joint.with_likeliest_field(joint.linear_fit(fit, noise=engine.noise))
        every = joint.linear_fit(fit, noise=likeliest.noise)  # held-out readings too
    return Residual(joint.p_value(every), clusters, runs, many, ranked, after, sample, corrections)


def _rank(engine: Engine, sample: Sample, fit: joint.Fit) -> Ranking:
    """The quantities on which the position residual depends, without field error and outliers."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    left = (fit.residual - fit.field)[rows, :3]
    left[~np.isfinite(left).all(axis=1) | down_weighted(fit)[rows]] = 0.0
    error = left @ sample.rotation
    return rank(sample, error - error.mean(axis=0), settings.SIGNIFICANCE)
