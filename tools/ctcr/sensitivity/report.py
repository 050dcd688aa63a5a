"""The study as one HTML page that needs nothing else."""

from pathlib import Path
from typing import Any

from ctcr.sensitivity import figures, terminal
from ctcr.show import html_page
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.output import write_text


def write(found: dict[str, Any], target: str | Path, source: str, accuracy: float) -> None:
    """Writes the page; `accuracy` [mm]. Raises InputError where the file cannot be written."""
    sections = ["<h1>Which parameters matter</h1>", bullets(terminal.closing(found, accuracy))]
    if study := found.get("open_loop"):
        text = (
            f"Distance between the tips that the nominal robot and a wrong one predict, at {study.configurations} "
            "random configurations, at both ends of each range; the lowest bar is all parameters at once, drawn within "
            "their ranges."
        )
        drawn = figure(figures.bars, study, 10.4, 0.22 * len(study.influences) + 1.6, text, wide=True)
        rows = table("Tip errors", terminal.OPEN_COLUMNS, terminal.open_rows(study), 1)
        sections.append(f"<h2>Open loop</h2>{drawn}{rows}")
    if study := found.get("closed_loop"):
        text = (
            "The controller's parameters are wrong, the robot is the nominal one. Increase of the largest tracking "
            f"error over {1e3 * study.nominal_maximum:.0f} µm with true parameters."
        )
        drawn = figure(figures.curves, study, 10.4, 5.4, text, wide=True)
        title = "Increase of the error, worst of the range"
        rows = table(title, terminal.CLOSED_COLUMNS, terminal.closed_rows(study), 2)
        sections.append(f"<h2>Closed loop</h2>{drawn}{rows}")
    write_text(html_page.page("Which parameters matter", sections, source, "ctcr sensitivity"), target)
