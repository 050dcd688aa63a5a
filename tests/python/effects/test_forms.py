"""What the catalogue says of the error of a form is what fuller models measured."""

import math
from collections import Counter
from pathlib import Path

from ctcr.effects import catalogue, user_effects

PAGE = Path(__file__).parents[3] / "docs" / "effect_forms.md"


def test_form_errors():
    """The amplitude that a form leaves of a fuller model's signal after calibration is no odd value of its stated
    standard deviation."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.read_text("utf-8").splitlines()]
    measured = [(row[0], float(row[6])) for row in rows if len(row) == 9 and row[0] in catalogue.catalogue(1)]
    assert len(measured) > 10
    for identity, explained in measured:
        left = math.sqrt(1 - explained / 100)
        assert left <= 1.1 * catalogue.get(identity).form_error, identity


def test_usual_form_error():
    """Users' effects begin with what most effects of the library have, and the tutorial tells this and the others."""
    usual = Counter(effect.form_error for effect in catalogue.catalogue(1).values()).most_common(1)[0][0]
    assert user_effects.Effect.form_error == usual
    others = [f"that of {e.id} by {e.form_error:.0%}" for e in catalogue.catalogue(1).values() if e.form_error != usual]
    told = " ".join(PAGE.with_name("effects.md").read_text("utf-8").replace(" %", "%").split())
    assert f"taken to err by {usual:.0%} of its signal, {', '.join(others)} (" in told
