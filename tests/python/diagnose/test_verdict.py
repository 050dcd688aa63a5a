"""One word for what a diagnosis found, and the limits that decide it."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.diagnose import verdict
from ctcr.diagnose.leftover import Leftover

ROOT = Path(__file__).parents[3]


def test_the_tutorial_explains_every_verdict_with_its_limits():
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    words = ["nothing_missing", "identified", "probable", "ambiguous", "stand_in", "not_in_catalogue"]
    assert [word for word in rows if word in words] == words
    assert f"less than {100 * verdict.MOSTLY:.0f} %" in rows["probable"]
    assert f"less than {100 * verdict.EXPLAINED:.0f} %" in rows["stand_in"]


@pytest.mark.parametrize(
    ("before", "after", "explained", "structured", "outdone", "word"),
    [
        (0.3, 0.1, (0.95, 0.99, 0.9), True, False, "identified"),
        (0.3, 0.25, (0.3, 0.99, -0.2), True, False, "stand_in"),
        (0.3, 0.29, (0.3, 0.99, -0.2), False, False, "identified"),
        (0.3, 0.45, (1, 1, 1), False, False, "stand_in"),
        (0.061, 0.062, (), True, False, "identified"),
        (0.3, 0.16, (0.78, 0.99, 0.77), True, False, "probable"),
        (0.3, 0.2, (0.95, 0.99, -0.2), True, False, "probable"),
        (0.3, 0.1, (0.95, 0.99, 0.9), True, True, "stand_in"),
    ],
)
def test_what_other_runs_do_not_confirm_is_a_stand_in(before, after, explained, structured, outdone, word):
    noise = SimpleNamespace(position_jitter=0.06e-3 / np.sqrt(3))
    fits = [SimpleNamespace(noise=noise, rms_mm=lambda _, rms=rms: rms) for rms in (before, after)]
    entry = SimpleNamespace(id="delay", implausible=())
    found = SimpleNamespace(entry=entry, ids=["delay"], share=0.9, margin=20.0)
    left = Leftover(structured, [], None, SimpleNamespace(chosen=[]), None)
    runs = dict(zip(("run 3", "run 5", "run 8"), explained, strict=False))
    said = verdict.judge(*fits, [found], left, np.ones(3, bool), runs, outdone)
    assert said.word == word
    one_is_off = word == "probable" and explained[2] < 0
    assert any("run 8" in text for text in said.sentences) == one_is_off
