"""One word for what a diagnosis found: outcomes for a real diagnosis, and for the same one with other evidence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import verdict

ROOT = Path(__file__).parents[3]
RUNS = ("run 3", "run 5", "run 8")


def judged(found, **changes):
    """The verdict on a diagnosis, with some of what it is judged by changed."""
    given = {
        "calibrated": found.calibrated,
        "with_effects": found.with_effects,
        "accepted": found.accepted,
        "residual": found.residual,
        "judged": found.judged,
        "explained": dict.fromkeys(RUNS, 0.99),
        "outdone": False,
    }
    return verdict.judge(**given | changes)


def test_words_in_tutorial():
    """The tutorial explains every verdict, with its limits."""
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    words = ["nothing_missing", "identified", "probable", "ambiguous", "stand_in", "not_in_catalogue"]
    assert [word for word in rows if word in words] == words
    assert f"less than {100 * settings.MOSTLY:.0f} %" in rows["probable"]
    assert f"less than {100 * settings.NOT_SPURIOUS:.0f} %" in rows["stand_in"]


def test_nothing_accepted(tip_load):
    """Without an effect the residual decides: noise, or structure for which the catalogue has no cause."""
    noise, more = (replace(tip_load.residual, rejected=rejected, clusters=[]) for rejected in (False, True))
    assert judged(tip_load, accepted=[], residual=noise).word == "nothing_missing"
    assert judged(tip_load, accepted=[], residual=more).word == "not_in_catalogue"
    at_joints = judged(tip_load, accepted=[], residual=replace(noise, clusters=[7, 8]))
    assert at_joints.word == "not_in_catalogue" and "rows 7, 8" in " ".join(at_joints.sentences)


def test_doubts(tip_load):
    """Each doubt takes the word of certainty away, and says so."""
    (one,) = tip_load.accepted
    doubts = {
        "ambiguous": {"accepted": [replace(one, ids=["tip_load", "contact"])]},
        "probable": {"accepted": [replace(one, margin=0.0)]},
        "stand_in": {"accepted": [replace(one, best=replace(one.best, implausible=("mass = 3 kg",)))]},
    }
    assert judged(tip_load).word == "identified"
    assert {word: judged(tip_load, **change).word for word, change in doubts.items()} == {word: word for word in doubts}
    assert judged(tip_load, outdone=True).word == "stand_in"


def test_worse_prediction_is_spurious(tip_load):
    """Effects with which held-out runs are predicted far worse than without are not there."""
    swapped = judged(tip_load, calibrated=tip_load.with_effects, with_effects=tip_load.calibrated)
    assert swapped.word == "stand_in" and "worse" in swapped.sentences[0]


@pytest.mark.parametrize("rejected", [True, False])
def test_held_out_runs(tip_load, rejected):
    """The less effects explain of held-out runs, the less sure the verdict; noise asks for nothing."""
    left = replace(tip_load.residual, rejected=rejected)
    sure = ["stand_in", "probable", "identified"]
    words = [
        judged(tip_load, residual=left, explained=dict.fromkeys(RUNS, part)).word for part in np.linspace(0, 1, 50)
    ]
    assert words == (sorted(words, key=sure.index) if rejected else ["identified"] * 50)
    assert not rejected or set(words) == set(sure)
    one_off = judged(tip_load, residual=left, explained=dict(zip(RUNS, (0.95, 0.99, -0.2), strict=True)))
    assert one_off.word == ("probable" if rejected else "identified")  # the median run counts, and the odd one is named
    assert any("run 8" in sentence for sentence in one_off.sentences) == rejected
