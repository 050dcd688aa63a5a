"""All steps of a diagnosis, in their order."""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr import effects, identify
from ctcr.diagnose import race as racing
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.leftover import Leftover, leftover_of
from ctcr.diagnose.race import Entry, Progress, Round
from ctcr.diagnose.split import locked_rows
from ctcr.diagnose.verdict import Verdict, judge
from ctcr.measurements import Measurements
from ctcr.robot import Robot

Array = NDArray[np.float64]


@dataclass
class Accepted:
    """An effect that was accepted, with all that the data cannot tell from it."""

    entry: Entry
    ids: list[str]
    log_evidence: float
    margin: float
    share: float


@dataclass
class Diagnosis:
    robot: Robot
    measurements: Measurements
    locked: NDArray[np.bool_]  # rows that no fit saw
    unseen: dict[str, str]  # effects that these data cannot show, and why
    calibrated: identify.Fit  # without effects
    final: identify.Fit
    noise_floor_mm: float  # of the locked rows
    rounds: list[Round]
    accepted: list[Accepted]
    leftover: Leftover
    verdict: Verdict
    seconds: float = 0.0

    @property
    def rms_mm(self) -> dict[str, float]:
        """Of the locked rows."""
        return {
            "nominal": self.calibrated.nominal_rms_mm(self.locked),
            "calibrated": self.calibrated.rms_mm(self.locked),
            "with_effects": self.final.rms_mm(self.locked),
            "noise_floor": self.noise_floor_mm,
        }

    def parameters(self, accepted: Accepted) -> dict[str, float]:
        """Fitted values by name, without the id."""
        stem = f"effects.{accepted.entry.id}."
        values = values_of(self.final)
        return {name.removeprefix(stem): value for name, value in values.items() if name.startswith(stem)}

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict.word,
            "effects": [
                {
                    "class": a.ids,
                    "parameters": self.parameters(a),
                    "delta_log_evidence": round(a.log_evidence, 3),
                }
                for a in self.accepted
            ],
            "leftover": {"structured": self.leftover.structured, "depends_on": self.leftover.depends_on},
            "rms_mm": {name: round(value, 5) for name, value in self.rms_mm.items()},
            "seconds": round(self.seconds, 2),
        }


def diagnose(
    robot: Robot, measurements: Measurements, *, progress: Progress = lambda _: None, threads: int = 0
) -> Diagnosis:
    """Which effects are missing. Raises InputError where no fit is possible."""
    began = perf_counter()
    locked = locked_rows(measurements)
    engine = Engine(robot, measurements, identify.noise_of(robot), ~locked, threads=threads)
    pool, unseen = candidates(robot, measurements)
    pool = [c for c in pool if c.id not in robot.effects]

    calibrated = fit = racing.baseline(engine, [], {}, progress)
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    while len(accepted) < racing.MAX_EFFECTS:
        round_ = racing.race(engine, fit, pool, [a.entry for a in accepted], progress)
        rounds.append(round_)
        if round_.accepted is None:
            break
        entry = round_.accepted
        accepted.append(Accepted(entry, round_.ids, entry.refit, round_.margin, entry.share))
        fit = racing.baseline(engine, [a.entry for a in accepted], values_of(entry.fit), progress)
        if racing.is_rejected(engine, fit):
            fit = _with_shapes(engine, accepted, fit, progress)
        pool = [c for c in pool if c.id != entry.id]
    if len(accepted) > 1:
        fit = _backward(engine, accepted, fit, progress)
    progress("what is left")
    leftover = leftover_of(engine, calibrated, fit)
    entries = [a.entry for a in accepted]
    calibrated = racing.predictive(engine, calibrated, [], progress)
    floor = fit.floor_mm(locked)
    fit = racing.predictive(engine, fit, entries, progress) if entries else calibrated
    verdict = judge(calibrated, fit, accepted, rounds, leftover, locked)
    result = Diagnosis(
        robot, measurements, locked, unseen, calibrated, fit, floor, rounds, accepted, leftover, verdict
    )
    result.seconds = perf_counter() - began
    return result


def _with_shapes(
    engine: Engine, accepted: list[Accepted], fit: identify.Fit, progress: Progress
) -> identify.Fit:
    """Frees the shape parameters of the last accepted effect where that helps: its form may be another one."""
    last = accepted[-1].entry
    effect = effects.get(last.id, engine.robot.n_tubes)
    shapes = [name for name in effect.shapes if name not in last.candidate.names and name != racing.jump.WHEN]
    if not shapes:
        return fit
    progress(f"freeing the shape of {last.id}")
    entry = replace(last, candidate=replace(last.candidate, names=(*last.candidate.names, *shapes)))
    names, fixed = racing.parameters([*(a.entry for a in accepted[:-1]), entry])
    freed = engine.fit(
        names,
        start=values_of(fit),
        fixed=fixed,
        noise=fit.noise,
        weights=fit.weights,
        inflation=fit.inflation,
    )
    if freed.log_evidence - fit.log_evidence < racing.TIE:
        return fit
    accepted[-1].entry = replace(entry, fit=freed)
    return racing.baseline(engine, [a.entry for a in accepted], values_of(freed), progress)


def _backward(
    engine: Engine, accepted: list[Accepted], fit: identify.Fit, progress: Progress
) -> identify.Fit:
    """Drops accepted effects that the others have made superfluous."""
    for a in list(accepted[:-1]):
        rest = [b for b in accepted if b is not a]
        progress(f"without {a.entry.id}")
        names, fixed = racing.parameters(b.entry for b in rest)
        without = engine.fit(
            names,
            start=values_of(fit),
            fixed=fixed,
            noise=fit.noise,
            weights=fit.weights,
            inflation=fit.inflation,
        )
        a.log_evidence = fit.log_evidence - without.log_evidence
        if a.log_evidence < racing.EVIDENCE:
            accepted.remove(a)
            return racing.baseline(engine, [b.entry for b in accepted], values_of(without), progress)
    return fit
