"""A diagnosis that ends at wrong conventions: on the terminal, as JSON, as a page."""

from typing import Any

from ctcr.conventions.review import Review
from ctcr.show import html_page
from ctcr.show.html_page import bullets, paragraph

VERDICT = "wrong_convention"
LEAD = "The measurements or the robot file follow another convention than the format says; no effect explains that."
ADVICE = "Correct this first, then diagnose again; --anyway goes on without."


def as_diagnosis(review: Review) -> dict[str, Any]:
    """For JSON, with the members that every diagnosis has."""
    first = review.findings[0]
    before, after = first.rms_mm
    return {
        "verdict": VERDICT,
        "effects": [],
        "leftover": {"structured": True, "depends_on": []},
        "rms_mm": {"calibrated": before, "corrected": after},
        "conventions": [one.as_dict() for one in review.findings],
    }


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
