"""One word for what a diagnosis found: outcomes for a real diagnosis, and for the same one with other evidence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import verdict
from ctcr.diagnose.explanations import probability, weighed
from ctcr.show.wording import most

ROOT = Path(__file__).parents[3]
RUNS = ("run 3", "run 5", "run 8")


def judged(found, **changes):
    """The verdict on a diagnosis, with some of what it is judged by changed."""
    given = {
        "rounds": found.rounds,
        "accepted": found.accepted,
        "residual": found.residual,
        "explained": dict.fromkeys(RUNS, 0.99),
    }
    return verdict.judge(**given | changes)


def without(found):
    """Rounds that accept nothing, as the best candidate explains nothing."""
    first = found.rounds[0]
    tried = [replace(one, refit=None if one.refit is None else -5.0, explained=0.0) for one in first.tried]
    return [replace(first, tried=tried, accepted=None, ids=[])]


def test_words_in_tutorial():
    """The tutorial explains every verdict, in the order of the module's table."""
    words = ["nothing_missing", "identified", "probable", "ambiguous", "stand_in", "not_in_catalogue"]
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    rows = [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")]
    assert [word for word in rows if word in words] == words
    assert sorted(line.split("`")[1] for line in verdict.__doc__.splitlines() if line.startswith("| `")) == sorted(
        words
    )


def test_probabilities(tip_load):
    """They add up to 1, the most probable explanation comes first, and each set of effects stands there once."""
    for left in (0.0, 1.0):
        for shares in ([], [1.0], [0.9, 0.5], [-3.0]):
            residual = replace(tip_load.residual, p_value=left)
            for rounds, accepted in ((tip_load.rounds, tip_load.accepted), (without(tip_load), [])):
                every = weighed(rounds, accepted, residual, shares)
                sizes = [one.probability for one in every]
                assert sum(sizes) == pytest.approx(1) and sizes == sorted(sizes, reverse=True)
                assert len({(one.effects, one.outside) for one in every}) == len(every)


def test_nothing_accepted(tip_load):
    """Without an effect the residual decides: noise, or structure for which the catalogue has no cause."""
    noise, more = (replace(tip_load.residual, p_value=p, clusters=[]) for p in (0.5, 1e-6))
    rounds = without(tip_load)
    assert judged(tip_load, rounds=rounds, accepted=[], residual=noise).word == "nothing_missing"
    assert judged(tip_load, rounds=rounds, accepted=[], residual=more).word == "not_in_catalogue"
    at_joints = judged(tip_load, rounds=rounds, accepted=[], residual=replace(noise, clusters=[7, 8]))
    assert at_joints.word == "not_in_catalogue" and "rows 7, 8" in " ".join(at_joints.sentences)


def test_not_sure(tip_load):
    """An effect that is likelier than noise, but not sure, is named where noise explains the residual, and the
    probability of the verdict is that of noise."""
    (round_,), noise = without(tip_load), replace(tip_load.residual, p_value=0.5, clusters=[])
    gain = np.log(len({one.id for one in round_.tried}) / settings.REJECTION_MISSED) + 2.0
    tried = [replace(one, refit=gain) if one.refit is not None else one for one in round_.tried[:1]]
    found = judged(tip_load, rounds=[replace(round_, tried=[*tried, *round_.tried[1:]])], accepted=[], residual=noise)
    assert found.word == "nothing_missing" and found.explanations[0].effects
    assert found.probability == next(one.probability for one in found.explanations if one.text == "noise alone") < 0.5
    assert found.explanations[0].text in found.sentences[1]
    assert found.undecided


def test_rivals(tip_load):
    """The nearer another effect comes, the less probable the accepted one; where both are as likely, both are named."""
    (one,), first = tip_load.accepted, tip_load.rounds[0]
    own = next(tried for tried in first.tried if tried.id == one.id)
    found = []
    for behind in (300.0, 30.0, 3.0, 0.0):
        rival = replace(own, candidate=replace(own.candidate, id="contact"), refit=own.refit - behind)
        kept = [tried for tried in first.tried if tried.id == one.id]
        beside = replace(one, round=replace(first, tried=[*kept, rival]))
        found.append(probability(judged(tip_load, accepted=[beside]).explanations, [one.ids]))
    assert found == sorted(found, reverse=True) and found[0] > 0.9 and found[-1] == pytest.approx(0.5, abs=0.01)
    either = replace(beside, round=replace(beside.round, ids=[one.id, "contact"]))
    both = judged(tip_load, accepted=[either])
    assert both.word == "ambiguous" and both.probability > 0.9


def test_implausible_values(tip_load):
    """Values that are hardly possible make the effect less probable."""
    (one,) = tip_load.accepted
    odd = replace(one, best=replace(one.best, implausible=("mass = 3 kg",)))
    assert judged(tip_load, accepted=[odd]).probability < judged(tip_load).probability


def test_implausible_final_values(tip_load):
    """The values said to be implausible are the fitted ones, whatever an earlier fit asked for."""
    (one,), final = tip_load.accepted, tip_load.final
    early = replace(one, best=replace(one.best, implausible=("mass = 3 kg",)))
    assert replace(tip_load, accepted=[early]).in_doubt == []
    heavy = final.values.copy()
    heavy[final.names.index("effects.tip_load.mass")] = 70.0
    assert "effects.tip_load.mass = 70 kg" in replace(tip_load, final=replace(final, values=heavy)).in_doubt[0]


def test_predicts_no_better(tip_load):
    """Where effects do not lower the error on held-out readings, both errors are said beside the verdict."""
    exchanged = replace(tip_load, calibrated=tip_load.with_effects, with_effects=tip_load.calibrated)
    (said,), errors = exchanged.in_doubt, exchanged.rms_mm
    assert said.startswith("Held-out readings are predicted no better for it: ")
    assert f"{errors['calibrated']:.3f} mm without effects, {errors['with_effects']:.3f} mm with them" in said
    assert tip_load.in_doubt == []


@pytest.mark.parametrize("rejected", [True, False])
def test_held_out_runs(tip_load, rejected):
    """The less effects explain of held-out runs, the less sure the verdict, and where they explain nothing they are not
    named; noise asks for nothing."""
    left = replace(tip_load.residual, p_value=0.0 if rejected else 0.5)
    sure = ["not_in_catalogue", "stand_in", "probable", "identified"]
    words = [
        judged(tip_load, residual=left, explained=dict.fromkeys(RUNS, part)).word for part in np.linspace(-1, 1, 80)
    ]
    assert words == (sorted(words, key=sure.index) if rejected else ["identified"] * 80)
    assert not rejected or set(words) == set(sure)
    one_off = judged(tip_load, residual=left, explained=dict(zip(RUNS, (0.95, 0.99, -0.2), strict=True)))
    assert one_off.word == "identified"  # the median run counts, and the odd one is named
    assert any("run 8" in sentence for sentence in one_off.sentences) == rejected


def test_found_beside_an_unknown_cause(tip_load):
    """Where much is left, an effect that explains little imitates; several that each explain most are found, and
    something else acts too."""
    one, left = tip_load.accepted[0], replace(tip_load.residual, p_value=0.0)
    first = tip_load.rounds[0]
    own = next(tried for tried in first.tried if tried.id == one.id)
    other = replace(own, candidate=replace(own.candidate, id="friction"))
    second = replace(first, tried=[other], accepted=other, ids=["friction"])
    rounds = [first, second, *tip_load.rounds[1:]]
    best, other = (replace(fit, explained=0.8) for fit in (one.best, other))
    many = [replace(one, best=best, beside=0.8), replace(one, best=other, round=second, beside=0.8)]
    explained = dict.fromkeys(RUNS, 0.6)
    imitates = judged(tip_load, residual=left, explained=dict.fromkeys(RUNS, 0.3))
    assert imitates.word == "stand_in" and f"(probability {most(imitates.probability)})" in imitates.sentences[0]
    both = judged(tip_load, rounds=rounds, accepted=many, residual=left, explained=explained)
    assert both.word == "probable" and both.explanations[0].outside and both.explanations[0].effects


def test_further_effect(tip_load):
    """An effect that was not accepted completes an explanation only if hardly anything is left with it."""
    first, left = tip_load.rounds[0], replace(tip_load.residual, p_value=0.0)
    own = next(tried for tried in first.tried if tried.id == "tip_load")
    accepted = [replace(tip_load.accepted[0], best=replace(own, explained=0.3))]
    found = []
    for share in (0.1, 0.5, 0.9, 0.999):
        further = replace(own, candidate=replace(own.candidate, id="friction"), explained=share)
        rounds = [*tip_load.rounds[:1], replace(first, tried=[further], accepted=None, ids=[])]
        every = judged(tip_load, rounds=rounds, accepted=accepted, residual=left, explained=dict.fromkeys(RUNS, 0.3))
        found.append(probability(every.explanations, [["tip_load"], ["friction"]], outside=False))
    assert found == sorted(found) and found[0] < 0.01 and found[-1] > 0.9
