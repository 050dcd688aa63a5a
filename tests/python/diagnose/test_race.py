"""A round of the race asks what a further effect adds, and not what a better fit of the others would."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.diagnose import add, decision, prediction
from ctcr.diagnose import race as racing
from ctcr.diagnose.candidates import Candidate, candidates, forms, other_strengths
from ctcr.diagnose.engine import Engine, Gain
from ctcr.effects.catalogue import get
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file

ROOT = Path(__file__).parents[3]
MASS = "effects.tip_load.mass"
SPREAD = "effects.delay.spread"


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROOT / "examples" / "robots" / "table2.yaml")


def test_a_fit_that_did_not_end_gives_no_further_effect_its_gain(robot, plan):
    made = simulation.simulate(add.with_values(robot, ["tip_load"], {MASS: 0.01}), plan, "jitter", seed=4)
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool))
    candidate = Candidate("tip_load", (MASS,))
    ended = engine.fit([MASS])
    early = engine.fit_like(ended, [MASS], max_iterations=1)
    assert ended.log_evidence - early.log_evidence > 2 * decision.UNASKED
    accepted = racing.Entry(candidate, Gain(0.0, *4 * [np.zeros(1)]), fit=early)
    pool = [c for c in candidates(robot, made)[0] if c.id not in ("tip_load", "contact")]
    round_ = racing.race(engine, early, pool, [accepted], lambda _: None)
    assert round_.accepted is None
    assert round_.before.log_evidence == pytest.approx(ended.log_evidence, abs=1.0)
    assert max(entry.score for entry in round_.entries) < decision.EVIDENCE


def test_a_delay_whose_moments_are_spread_is_freed_from_where_it_entered(robot, plan):
    timed = replace(plan, t=np.arange(len(plan), dtype=float))
    found = [c for c in candidates(robot, timed)[0] if c.id == "delay"]
    assert [dict(c.shape) for c in found] == [{}, {SPREAD: 0.5}]
    for candidate in found:
        [form] = forms(get("delay", robot.n_tubes), candidate)
        assert form.names == ("effects.delay.delay", SPREAD)
        assert form.shape == candidate.shape


@pytest.mark.parametrize(("better", "chosen"), [(0.4, {}), (0.6, {SPREAD: 0.5})])
def test_of_forms_that_are_as_likely_the_plainest_is_taken(better, chosen):
    gain = Gain(0.0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 1)))
    plain, spread, other = (
        racing.Entry(Candidate(identity, (name,), shape), gain, refit=score, share=0.9, fit=object())
        for identity, name, shape, score in (
            ("delay", "effects.delay.delay", (), 100.0),
            ("delay", "effects.delay.delay", ((SPREAD, 0.5),), 100.0 + better),
            ("tip_load", MASS, (), 20.0),
        )
    )
    round_ = racing.Round(None, [spread, plain, other], {})
    decision.decide(round_, tried=20, is_further=False, is_rejected=True)
    assert dict(round_.accepted.candidate.shape) == chosen
    assert round_.ids == ["delay"] and [entry.id for entry in round_.best] == ["delay", "tip_load"]
    assert round_.best[0] is round_.accepted


def test_a_further_effect_with_a_value_that_is_hardly_possible_is_said_to_be_that():
    gain = Gain(0.0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 1)))
    entry = racing.Entry(
        Candidate("tip_load", (MASS,)), gain, refit=600.0, share=0.9, fit=object(), implausible=(f"{MASS} = 3 kg",)
    )
    round_ = racing.Round(None, [entry], {})
    decision.decide(round_, tried=20, is_further=True, is_rejected=True)
    assert round_.accepted is None
    assert round_.why_not == (
        f"Nothing accepted: the best candidate, tip_load, wants what is hardly possible, {MASS} = 3 kg."
    )


@pytest.mark.parametrize(("stand_ins", "accepted"), [((), True), (("tip_load",), False)])
def test_what_may_stand_in_for_an_unknown_law_must_explain_more(stand_ins, accepted):
    gain = Gain(0.0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 1)))
    entry = racing.Entry(Candidate("tip_load", (MASS,)), gain, refit=60.0, share=0.4, fit=object())
    round_ = racing.Round(None, [entry], {})
    decision.decide(round_, tried=20, is_further=True, is_rejected=True, stand_ins=stand_ins)
    assert (round_.accepted is entry) == accepted
    assert accepted or "40% of what is left: below 50%" in round_.reason


def test_look_alikes_of_friction_whose_law_is_one_of_several_may_stand_in(robot):
    engine = SimpleNamespace(robot=robot)

    def stand_ins(*ids):
        return racing._stand_ins(engine, [racing.Entry(Candidate(name, ()), gain=None) for name in ids])

    assert stand_ins("softening", "friction") == set(get("friction", 3).look_alikes)
    assert stand_ins("softening") == set()


def test_candidates_that_contend_are_followed_to_the_end(monkeypatch):
    """One that is slow to fit must not lose to one that is quick."""
    asked = []

    def refit(engine, before, evidence, entry, fixed, progress, iterations):
        asked.append((entry.id, iterations))
        ended = iterations == racing.END or entry.id == "delay"
        score = {"delay": 80.0, "contact": 110.0 if ended else 64.0, "softening": 9.0}[entry.id]
        return replace(entry, refit=score, fit=SimpleNamespace(converged=ended))

    monkeypatch.setattr(racing, "_refit", refit)
    monkeypatch.setattr(racing.unsteady, "evidence", lambda engine, fit: 0.0)
    names = ("delay", "contact", "softening")
    entries = [racing.Entry(Candidate(name, ()), gain=None) for name in names]
    found = racing.refitted(None, None, entries, {}, lambda _: None)
    assert [entry.score for entry in found] == [80.0, 110.0, 9.0]
    assert asked == [(name, racing.ITERATIONS) for name in names] + [("contact", racing.END)]


def test_what_predicts_the_typical_run_better_predicts_better(monkeypatch):
    """One run that goes where no other went does not outweigh all."""
    before = np.full(9, 0.09)
    after = np.array([*np.full(8, 0.04), 1.4])
    errors = {"before": before, "after": after, "same": before * 0.99}
    monkeypatch.setattr(prediction, "held_out", lambda engine, fit: errors[fit])
    engine = SimpleNamespace(noise=SimpleNamespace(position_jitter=35e-6))
    assert prediction.predicts_better(engine, "before", "after")
    assert not prediction.predicts_better(engine, "before", "same")
    assert not prediction.predicts_better(engine, "after", "before")


def test_forms_of_the_same_parameters_are_refitted_after_others():
    gain = Gain(0.0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 1)))
    told = ["coefficient 1", "coefficient 2", "play 1", "torque 1", "torque 2"]
    entries = [
        racing.Entry(Candidate("any", (name,), (("form", float(form)),)), gain)
        for name, form in (text.split() for text in told)
    ]
    order = [told[entries.index(entry)] for entry in racing._other_strengths_first(entries)]
    assert order == ["coefficient 1", "play 1", "torque 1", "coefficient 2", "torque 2"]


def test_an_effect_whose_law_is_open_has_other_strengths():
    friction = get("friction", 3)
    coefficient, torque = (tuple(friction.names(name)) for name in ("coefficient", "torque_per_length"))
    shape = (("effects.friction.insertion", 0.0),)
    assert other_strengths(friction, Candidate("friction", coefficient, shape)) == [
        Candidate("friction", torque, shape)
    ]
    freed = Candidate("friction", (*torque, "effects.friction.slip_angle"))
    assert [other.names for other in other_strengths(friction, freed)] == [coefficient]
    for identity in ("tip_load", "precurvature_profile", "field_distortion"):
        effect = get(identity, 3)
        assert not other_strengths(effect, Candidate(identity, tuple(effect.amplitudes)))


def test_what_was_picked_among_many_values_pays_for_it():
    gain = Gain(12.0, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 1)))
    assert racing.Entry(Candidate("frame_jump", (MASS,), (), 5.0), gain).linear == 7.0


@pytest.mark.parametrize(("offset", "accepted"), [(2e-3, True), (1.2e-4, False)])
def test_a_prediction_by_slopes_does_not_outweigh_all_evidence(robot, plan, monkeypatch, offset, accepted):
    hidden = {MASS: 0.01, "effects.sensor_offset.x": offset}
    made = simulation.simulate(add.with_values(robot, ["tip_load", "sensor_offset"], hidden), plan, "jitter", seed=5)
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool))
    before = engine.fit([MASS])
    first = racing.Entry(Candidate("tip_load", (MASS,)), Gain(0.0, *4 * [np.zeros(1)]), fit=before)
    pool = [c for c in candidates(robot, made)[0] if c.id == "sensor_offset"]
    monkeypatch.setattr(racing, "predicts_better", lambda *_: False)
    monkeypatch.setattr(racing, "CERTAIN", 90.0)  # these are few rows
    round_ = racing.race(engine, before, pool, [first], lambda _: None)
    assert (round_.entries[0].score > racing.CERTAIN) == accepted and round_.entries[0].score > round_.needed
    assert round_.ids == (["sensor_offset"] if accepted else [])
    assert ("predict other runs" in round_.reason) != accepted
