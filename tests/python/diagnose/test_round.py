"""A round of stepwise selection: it asks what a further effect adds, not what a better fit of the others would add."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import held_out
from ctcr.diagnose import round as rounds
from ctcr.diagnose.candidates import Candidate, candidates, forms, other_amplitudes
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.linearised import Gain
from ctcr.diagnose.round import CandidateFit, Round
from ctcr.effects import catalogue
from ctcr.effects.catalogue import get
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from hidden_sessions import measured

MASS = "effects.tip_load.mass"
SPREAD = "effects.delay.spread"
NO_GAIN = Gain(0.0, *4 * [np.zeros(1)], removed=0.0)


def engine_for(robot, plan, hidden, seed=4):
    """An engine that fits all readings, with jitter, of a robot with hidden effects."""
    ids = list(dict.fromkeys(name.split(".")[1] for name in hidden))
    made = simulation.simulate(catalogue.with_values(robot, ids, hidden), plan, "jitter", seed=seed)
    return Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool))


def pool(engine, *ids):
    return [c for c in candidates(engine.robot, engine.measurements)[0] if c.id in ids]


@pytest.fixture(scope="module")
def weighted(robot, plan):
    return engine_for(robot, plan, {MASS: 0.01})


# ---- Rounds on small simulated sets


def test_unconverged_fit(weighted):
    """The gain of converging the fit before is no gain of a further effect."""
    ended = weighted.fit([MASS])
    early = weighted.fit_like(ended, [MASS], {}, max_iterations=1, near=False)
    assert ended.log_evidence - early.log_evidence > 20
    accepted = CandidateFit(Candidate("tip_load", (MASS,)), NO_GAIN, fit=early)
    others = [c for c in candidates(weighted.robot, weighted.measurements)[0] if c.id not in ("tip_load", "contact")]
    round_ = rounds.run_round(weighted, early, others, [accepted])
    assert round_.accepted is None
    assert round_.before.log_evidence == pytest.approx(ended.log_evidence, abs=1.0)
    assert max(one.score for one in round_.tried) < settings.DECISIVE


@pytest.fixture
def stuck(robot):
    """An engine of readings without any effect, its calibration, and one that ended where it began."""
    made = measured(robot, np.random.default_rng(1), {})
    engine = Engine(robot, made, noise_of_readings(robot, made), np.ones(len(made), bool))
    ended = engine.fit()
    there = engine.fit_like(ended, [], {}, max_iterations=0)
    assert ended.log_evidence - there.log_evidence > 20
    return engine, ended, there


def test_astray(stuck):
    """A candidate whose fit goes astray from its linearised start is fitted from the values before."""
    engine, _, there = stuck
    (one,) = rounds.Refits(engine, there, {}).of_all(rounds.screen(engine, there, pool(engine, "softening"), {})[:1])
    assert one.linear > 0 and one.score > 0


def test_calibration_from_elsewhere(stuck):
    """What calibration alone gains from where the best candidate led is no gain of that candidate."""
    engine, ended, there = stuck
    round_ = rounds.run_round(engine, there, pool(engine, "tip_load", "softening"), [])
    assert round_.accepted is None
    assert round_.before.log_evidence == pytest.approx(ended.log_evidence, abs=1.0)


def test_contenders_converge(weighted, monkeypatch):
    """A candidate that is slow to fit does not lose to one that is quick."""
    monkeypatch.setattr(settings, "FIRST_ITERATIONS", 1)
    before = weighted.less_widened(weighted.fit(), candidates(weighted.robot, weighted.measurements)[0], {})
    screened = rounds.screen(weighted, before, pool(weighted, "tip_load", "softening"), {})
    tried = rounds.Refits(weighted, before, {}).of_all(screened)
    best = max(tried, key=lambda one: one.score)
    assert best.id == "tip_load" and best.fit.converged
    assert all(one.fit.iterations <= 1 for one in tried if one.score < settings.CONTENDS * best.score)


def test_free_shape(robot, plan):
    """A candidate is refitted in its best shape: one whose usual shape is wrong does not lose for that alone."""
    knee = {"gamma.1": 0.01, "gamma.2": 0.01, "gamma.3": 0.01, "plateau": 0.35, "sharpness": 7.0}
    engine = engine_for(robot, plan, {f"effects.softening.{name}": value for name, value in knee.items()})
    before = engine.fit()
    screened = rounds.screen(engine, before, pool(engine, "softening"), {})
    (one,) = rounds.Refits(engine, before, {}).of_all(screened)
    held = engine.fit_like(before, screened[0].candidate.names)
    assert set(one.candidate.names) > set(screened[0].candidate.names)
    assert one.fit.log_evidence > held.log_evidence + settings.DECISIVE


def test_impossible_values(robot):
    """A surface pushes: where it would have to pull, another one that pushes takes part, or none."""
    pushed = measured(robot, np.random.default_rng(1), {"effects.tip_load.force_x": 0.01})
    engine = Engine(robot, pushed, noise_of_readings(robot, pushed), np.ones(len(pushed), bool))
    screened = rounds.screen(engine, engine.fit(), pool(engine, "contact"), {})
    assert max(one.linear for one in screened) > settings.DECISIVE
    assert all((one.gain.values >= 0).all() for one in screened)


def test_best_of_few_rows(robot, plan, monkeypatch):
    """The candidate that is best on a part of many rows is refitted to all, even without evidence for it."""
    monkeypatch.setattr(settings, "FEW_ROWS", 20)
    engine = engine_for(robot, plan, {})
    before = engine.fit()
    screened = rounds.screen(engine, before, pool(engine, "tip_load", "softening", "straight_curvature"), {})
    kept = rounds.Refits(engine, before, {}).in_reach(screened)
    assert kept and {one.candidate for one in kept} <= {one.candidate for one in screened}


def test_one_odd_run():
    """One run that goes where no other went does not dominate the typical error."""
    before, after = np.full(9, 0.09), np.array([*np.full(8, 0.04), 1.4])
    assert held_out.typical(after) < held_out.typical(before) < np.mean(after)


# ---- Laws of the decision


def candidate_fit(identity, score, *, shape=(), explained=0.9, columns=None, **changes):
    columns = np.zeros((1, 1)) if columns is None else columns
    gain = Gain(score, np.zeros(1), np.zeros(1), columns[:, 0], columns, removed=2 * score)
    candidate = Candidate(identity, (f"effects.{identity}.any",), shape)
    return CandidateFit(candidate, gain, refit=score, explained=explained, fit=object(), **changes)


def decided(*tried, before=(), is_rejected=True, surely=False):
    """A round beside effects that explained all but a thousandth each."""
    round_ = Round(None, sorted(tried, key=lambda one: -one.score))
    accepted = [candidate_fit(identity, 500.0, explained=0.999) for identity in before]
    rounds.decide(round_, 20, accepted, is_rejected, surely)
    return round_


FRICTION = ("friction",)
SCORES, FRACTIONS = np.linspace(0, 30, 61), np.linspace(0, 1, 51)
STRICTER = ({}, {"is_rejected": False}, {"before": FRICTION})


def accepted_over(scores=(100.0,), fractions=(0.9,), **options):
    """Whether a candidate is accepted, for all scores and fractions explained."""
    return np.array(
        [
            decided(candidate_fit("delay", s, explained=f), **options).accepted is not None
            for s in scores
            for f in fractions
        ]
    )


@pytest.mark.parametrize("options", STRICTER)
def test_more_evidence_never_rejects(options):
    """Acceptance is monotone in the log evidence and in the fraction explained, and a rejection gives its reason."""
    for accepted in (accepted_over(SCORES, **options), accepted_over(fractions=FRACTIONS, **options)):
        assert (np.diff(accepted.astype(int)) >= 0).all() and accepted[-1] and not accepted[0]
    assert decided(candidate_fit("delay", 0.0), **options).why_not.startswith(
        "Nothing accepted: the best candidate, delay"
    )


def test_stricter():
    """More is asked where noise explains the residual, and of an effect beside others, whose forms it may mend."""
    by_score = [accepted_over(SCORES, **options).sum() for options in STRICTER]
    by_fraction = [accepted_over(fractions=FRACTIONS, **options).sum() for options in STRICTER]
    assert by_score[0] > by_score[1] and by_fraction[0] > by_fraction[2]


def test_surely():
    """A fraction that is little known counts for less where an effect must surely be a cause."""
    for sd, accepted in ((0.0, True), (0.1, True), (1.0, False)):
        one = candidate_fit("delay", 100.0, explained=0.9, explained_sd=sd)
        assert decided(one, before=FRICTION).accepted
        assert (decided(one, before=FRICTION, surely=True).accepted is not None) == accepted


def test_why_stricter():
    """A rejection says what else the candidate may be."""
    alone = decided(candidate_fit("delay", 100.0, explained=0.0)).why_not
    after = decided(candidate_fit("delay", 100.0, explained=0.0), before=FRICTION).why_not
    assert "a cause outside the catalogue" in alone and "forms of the effects before it" not in alone
    assert "a cause outside the catalogue" in after and "forms of the effects before it" in after


def test_hopeless():
    """More readings may save a round that only lacks evidence, not one whose best candidate is surely spurious."""
    few = decided(candidate_fit("delay", 3.0))
    assert few.is_hopeless(1) and not few.is_hopeless(10)
    spurious, unsure = (decided(candidate_fit("delay", 100.0, explained=0.01, explained_sd=sd)) for sd in (0.001, 1.0))
    assert spurious.is_hopeless(1e6) and not unsure.is_hopeless(1.5)
    assert not decided(candidate_fit("delay", 100.0)).is_hopeless(1)
    assert Round(None, []).is_hopeless(1e6)


def test_simplest_form():
    """Of forms that are equally likely the one with the fewest settings is taken, else the likeliest."""
    for better, shape in ((0.4 * settings.COARSE, ()), (2 * settings.COARSE, ((SPREAD, 0.5),))):
        plain, spread = candidate_fit("delay", 100.0), candidate_fit("delay", 100.0 + better, shape=((SPREAD, 0.5),))
        round_ = decided(plain, spread, candidate_fit("tip_load", 20.0))
        assert round_.accepted.candidate.shape == shape and round_.ids == ["delay"]
        assert [one.id for one in round_.best] == ["delay", "tip_load"] and round_.best[0] is round_.accepted


def test_indistinguishable():
    """Named together: candidates of nearly equal evidence. Those far behind are not, whatever their signal is."""
    signal = np.random.default_rng(0).normal(size=(40, 1))
    best = candidate_fit("delay", 100.0, columns=signal)
    near = candidate_fit("clearance", 100.0 - 0.5 * settings.TIE)
    behind = candidate_fit("contact", 50.0, columns=2 * signal)
    round_ = decided(best, near, behind)
    assert round_.ids == ["delay", "clearance"] and round_.margin == pytest.approx(50.0)


def test_implausible_further_effect():
    """A further effect that needs an implausible value is not accepted, and the value is named."""
    wants = candidate_fit("tip_load", 600.0, implausible=(f"{MASS} = 3 kg",))
    assert decided(wants).accepted
    assert f"{MASS} = 3 kg" in decided(wants, before=FRICTION).why_not
    plausible = candidate_fit("delay", 100.0)
    assert decided(wants, plausible, before=FRICTION).ids[0] == "delay"


def test_penalty():
    """A candidate whose start was picked among many pays for it."""
    candidate = Candidate("frame_jump", (MASS,), (), penalty=5.0)
    assert CandidateFit(candidate, replace(NO_GAIN, log_evidence=12.0)).linear == 7.0


# ---- Candidates and the forms that they may take


def test_form_keeps_its_start(robot, plan):
    """A delay whose averaging window is open is freed from the start with which it entered."""
    timed = replace(plan, t=np.arange(len(plan), dtype=float))
    found = [c for c in candidates(robot, timed)[0] if c.id == "delay"]
    assert [dict(c.shape) for c in found] == [{}, {SPREAD: 0.5}]
    for candidate in found:
        [form] = forms(get("delay", robot.n_tubes), candidate)
        assert form.names == ("effects.delay.delay", SPREAD)
        assert form.shape == candidate.shape


def test_moment_is_no_law():
    """A jump keeps the moment at which it was found, and its look-alikes need no more than those of other effects."""
    effect = get("frame_jump", 3)
    candidate = Candidate(effect.id, tuple(effect.amplitudes), (("effects.frame_jump.when", 0.3),))
    assert {form.shape for form in forms(effect, candidate)} == {candidate.shape}
    assert not effect.laws and get("friction", 3).laws == ["effects.friction.law"]


def test_with_shape():
    """The amplitudes stay first; a local source, which has a variant of its own, is not added to others."""
    for effect in catalogue.all_effects(3).values():
        source = set(effect.names_with("source"))
        for names in effect.variants or [tuple(p.name for p in effect.parameters if p.kind == "amplitude")]:
            candidate = Candidate(effect.id, tuple(effect.names(*names)))
            free = candidate.with_shape(3)
            assert free.names[: len(candidate.names)] == candidate.names and free.with_shape(3) == free
            assert set(free.names) - set(candidate.names) <= set(effect.of_kind("shape")) - source
            assert set(effect.of_kind("shape")) - source <= set(free.names)


def test_variety_first():
    """Other parameters of an effect are refitted before other forms of the same ones."""
    found = [
        replace(candidate_fit("delay", 20.0 - k, shape=shape), candidate=Candidate("delay", (name,), shape))
        for k, (name, shape) in enumerate([("a", ()), ("a", ((SPREAD, 0.5),)), ("b", ())])
    ]
    assert [one.candidate.names for one in rounds.worth_a_refit(found)] == [("a",), ("b",)]


def test_other_amplitudes():
    """An effect with several constitutive laws has other amplitudes by which it may act."""
    friction = get("friction", 3)
    coefficient, torque = (tuple(friction.names(name)) for name in ("coefficient", "torque_per_length"))
    shape = (("effects.friction.insertion", 0.0),)
    assert other_amplitudes(friction, Candidate("friction", coefficient, shape)) == [
        Candidate("friction", torque, shape)
    ]
    freed = Candidate("friction", (*torque, "effects.friction.slip_angle"))
    assert [other.names for other in other_amplitudes(friction, freed)] == [coefficient]
    for identity in ("tip_load", "precurvature_profile", "field_distortion"):
        effect = get(identity, 3)
        assert not other_amplitudes(effect, Candidate(identity, tuple(effect.amplitudes)))
