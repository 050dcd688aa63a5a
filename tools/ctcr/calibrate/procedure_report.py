"""A procedure that measures one thing at a time, as one HTML page that needs nothing else."""

import html
from pathlib import Path

from ctcr import html_page
from ctcr.calibrate.outcome import Outcome, cells
from ctcr.calibrate.procedure_figures import WIDTH
from ctcr.html_page import bullets, figure, table
from ctcr.output import atomic_writer


def write(outcome: Outcome, target: str | Path, command: str, source: str, robot=None) -> None:
    """Write the report; source says what was measured. Raises InputError when the file cannot be written."""
    with atomic_writer(target) as file:
        file.write(page(outcome, command, source, robot))


def page(outcome: Outcome, command: str, source: str, robot=None) -> str:
    """The whole HTML text."""
    title = f"{outcome.title}: {robot.name}" if robot else outcome.title
    sections = [f"<h1>{html.escape(title)}</h1>"]
    if outcome.notices:
        sections.append("<h2>To know</h2>" + bullets(outcome.notices))
    if outcome.picture:
        p = outcome.picture
        sections.append(figure(p.plot, p.subject, WIDTH, p.height, p.caption, wide=True))
    sections.append(table("Found, with one standard deviation", *cells(outcome), 2))
    return html_page.page(title, sections, source, command)
