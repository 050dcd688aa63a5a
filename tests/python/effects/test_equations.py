"""The page of the effects' equations has every effect, every parameter and every source that the catalogue names."""

import re
from pathlib import Path

from ctcr.effects import catalogue

PAGE = Path(__file__).parents[3] / "docs" / "effect_equations.md"
MANY = 12  # parameters: a page gives the rule of their names
SOURCE = re.compile(r"((?:[A-Z][\w-]+(?:, | & )?)+(?: et al\.)?) (\d{4})")


def test_the_page_has_the_whole_catalogue():
    """Every effect has a section that names its parameters."""
    text = PAGE.read_text(encoding="utf-8")
    sections = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##)", text, re.DOTALL | re.MULTILINE))
    known = catalogue.catalogue(1)
    assert sections.keys() == known.keys()
    for identity, effect in known.items():
        names = {parameter.name for parameter in effect.parameters}
        words = set(re.findall(r"\w+", sections[identity]))
        assert len(names) > MANY or names <= words, (identity, names - words)


def test_the_page_lists_the_sources():
    """Every source that the catalogue cites is in the list."""
    text = PAGE.read_text(encoding="utf-8")
    listed = [" ".join(one.split()) for one in text[text.index("## Sources") :].split("\n- ")]
    cited = [match for effect in catalogue.catalogue(1).values() for match in SOURCE.findall(effect.reference)]
    assert len(cited) > 10
    for authors, year in cited:
        first = re.split(r"[ ,]", authors)[0]
        assert any(one.startswith(first) and year in one for one in listed), (authors, year)
