"""A diagnosis that ends at wrong conventions: on the terminal, as JSON, as a page."""

from typing import Any

from ctcr import settings
from ctcr.conventions.review import Review
from ctcr.show import html_page
from ctcr.show.html_page import bullets, paragraph

VERDICT = "wrong_convention"
LEAD = "The measurements or the robot file follow another convention than the format says; no effect explains that."
ADVICE = "Correct this first, then diagnose again; --anyway goes on without."


def as_diagnosis(review: Review) -> dict[str, Any]:
    """For JSON, with the members that every diagnosis has."""
    before, after = review.findings[0].rms_mm
    explanations = _explanations(review)
    return {
        "verdict": VERDICT,
        "probability": explanations[0]["probability"],
        "effects": [],
        "explanations": explanations,
        "leftover": {"structured": True, "depends_on": []},
        "rms_mm": {"calibrated": before, "corrected": after},
        "conventions": [one.as_dict() for one in review.findings],
    }


def _explanations(review: Review) -> list[dict[str, Any]]:
    """Explanations that share the probability: all findings together; the same with one finding replaced by a rival
    that explains the readings as well; and a cause that is no convention. The errors do not tell that cause from the
    others, so it keeps the prior odds of a cause outside the catalogue."""
    texts = [one.text for one in review.findings]
    sets = [texts]
    for k, one in enumerate(review.findings):
        sets += [[*texts[:k], rival.text, *texts[k + 1 :]] for rival in one.rivals]
    total = len(sets) + settings.OUTSIDE_CATALOGUE
    weighed = [("; ".join(own), False, 1 / total) for own in sets]
    weighed.append(("no convention", True, settings.OUTSIDE_CATALOGUE / total))
    return [
        {"effects": [], "outside_catalogue": outside, "text": text, "probability": round(probability, 6)}
        for text, outside, probability in weighed
    ]


def show(console: Any, review: Review) -> None:
    console.print(VERDICT.upper().replace("_", " "), style="bold")
    console.print(LEAD)
    for one in review.findings:
        console.print(f"  • {one.sentence}")
    console.print(ADVICE)


def page(review: Review) -> str:
    """The whole HTML text."""
    found = bullets([one.sentence for one in review.findings])
    sections = [paragraph(LEAD, "lead", bold="Wrong convention. "), found, paragraph(ADVICE, "soft")]
    return html_page.page(f"Conventions: {review.robot.name}", sections, [*review.robot.files, *review.readings.files])
