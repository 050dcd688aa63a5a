"""Effects that were accepted early are chosen anew beside those that were accepted later."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.round import run_round
from ctcr.diagnose.selection import Selection
from ctcr.model.noise import noise_of_readings
from hidden_sessions import measured

OFFSET = {"effects.sensor_offset.x": 8e-4, "effects.sensor_offset.y": -5e-4}
BENT = {"effects.straight_curvature.bend_x.1": 0.6, "effects.straight_curvature.bend_x.2": -0.4}
WEIGHT = {"effects.tip_load.mass": 3e-3}


def selected(robot, hidden, *offered, seed=3):
    """What was accepted when only the effects `offered` could be, one group after the other, and then all."""
    made = measured(robot, np.random.default_rng(seed), hidden)
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool), tolerance=settings.COARSE)
    pool, _ = candidates(robot, made)
    chosen = Selection(engine)
    chosen.fit = chosen.calibrated = chosen.calibrate([], {})
    for ids in offered:
        chosen.last = None
        chosen.grow([c for c in pool if c.id in ids])
    before = [a.id for a in chosen.accepted]
    chosen.revise(pool)
    return before, chosen


def test_better_calibration(robot):
    """Where a round comes upon a better optimum of the calibration, the selection goes on from there."""
    made = measured(robot, np.random.default_rng(1), {})
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool), tolerance=settings.COARSE)
    chosen = Selection(engine)
    ended = chosen.calibrate([], {})
    chosen.fit = chosen.calibrated = engine.fit_like(ended, [], {}, max_iterations=0)
    assert not chosen.take_one([c for c in candidates(robot, made)[0] if c.id in ("tip_load", "softening")])
    assert chosen.calibrated is chosen.fit
    assert chosen.fit.log_evidence == pytest.approx(ended.log_evidence, abs=settings.COARSE)


def test_gain_that_does_not_last(robot):
    """An effect whose gain in a round was an accident of where a fit began is not kept, and leaves no trace."""
    made = measured(robot, np.random.default_rng(1), {})
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool), tolerance=settings.COARSE)
    chosen = Selection(engine)
    before = chosen.fit = chosen.calibrated = chosen.calibrate([], {})
    round_ = run_round(engine, before, [c for c in candidates(robot, made)[0] if c.id == "tip_load"], [])
    lucky = round_.tried[0]
    fit = engine.fit_like(before, lucky.candidate.names)
    round_.accepted, round_.ids = replace(lucky, fit=fit, refit=20.0), [lucky.id]
    round_.tried = [round_.accepted]
    assert not chosen._accept(round_)
    assert chosen.fit is before and not chosen.accepted and not chosen.history
    assert round_.tried[0].refit < settings.DECISIVE and "in a converged fit" in round_.why_not


@pytest.mark.parametrize("seed", [3, 4])
def test_exchange(robot, seed, monkeypatch):
    """An effect that imitated the right one gives way to it, whatever was accepted in between."""
    monkeypatch.setattr(settings, "OUTSIDE_CATALOGUE", 1e-6)  # else it is taken to imitate one
    before, chosen = selected(robot, OFFSET | BENT, ["tip_load"], ["sensor_offset"], seed=seed)
    assert before == ["tip_load", "sensor_offset"]
    assert {a.id for a in chosen.accepted} == {"sensor_offset", "straight_curvature"}
    (changed,) = [round_ for round_ in chosen.rounds if round_.anew]
    assert changed.anew == "tip_load" and changed.accepted.id == "straight_curvature"


def test_superfluous(robot):
    """An effect that later ones made superfluous is dropped, and the round says so."""
    before, chosen = selected(robot, BENT, ["tip_load"], ["straight_curvature"])
    assert before == ["tip_load", "straight_curvature"]
    assert [a.id for a in chosen.accepted] == ["straight_curvature"]
    assert any(
        round_.anew == "tip_load" and round_.why_not.startswith("Dropped tip_load: ") for round_ in chosen.rounds
    )


def test_right_ones_stay(robot):
    """Right effects stay, in whatever order they were accepted."""
    for order in (["tip_load"], ["sensor_offset"]), (["sensor_offset"], ["tip_load"]):
        before, chosen = selected(robot, OFFSET | WEIGHT, *order)
        assert [a.id for a in chosen.accepted] == before == [identity for (identity,) in order]
        assert chosen.last and chosen.last.accepted is None
        assert all(a.log_evidence > settings.DECISIVE for a in chosen.accepted)


def test_weak(robot):
    """The effect that is least probably a cause beside the others is dropped, and none where all surely are causes."""
    _, chosen = selected(robot, OFFSET | WEIGHT, ["sensor_offset"], ["tip_load"])
    assert len(chosen.accepted) == 2 and not chosen._without_weakest()
    chosen.accepted[1].beside = 0.01
    weakest = chosen.accepted[1].id
    assert chosen._without_weakest() and weakest not in [a.id for a in chosen.accepted]
    assert len(chosen.accepted) == 1 and not any(weakest in name for name in chosen.fit.names)


def test_known_in_a_round(robot):
    """A known candidate is compared with the others at the readings of the round, even if it was found at fewer; and it
    needs no others."""
    _, chosen = selected(robot, OFFSET | WEIGHT, ["sensor_offset"], ["tip_load"])
    one, other = chosen.accepted
    short = replace(one.best.gain, signal=one.best.gain.signal[:7], columns=one.best.gain.columns[:7])
    known = replace(one.best, fit=chosen.fit, gain=short)
    pool, _ = candidates(robot, chosen.engine.measurements)
    for offered in ([c for c in pool if c.id in ("field_distortion", "frame_drift", "sensor_offset")], []):
        round_ = run_round(chosen.engine, chosen._fit_with([other]), offered, [other.best], known)
        assert round_.accepted.id == one.id
        assert len({len(tried.gain.signal) for tried in round_.tried}) == 1
