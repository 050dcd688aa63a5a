"""The study as one HTML page that needs nothing else."""

from pathlib import Path
from typing import Any

from ctcr.sensitivity import figures, terminal
from ctcr.show import html_page
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.output import atomic_writer


def write(found: dict[str, Any], accuracy: float, target: str | Path, robot: str, scenario: str | None) -> None:
    """Writes the page. Raises InputError where the file cannot be written."""
    sections = ["<h1>Which parameters matter</h1>", bullets(terminal.closing(found, accuracy))]
    if "open_loop" in found:
        study = found["open_loop"]
        text = (
            f"Distance between the tips that the nominal robot and a wrong one predict, at {study.configurations} "
            "random configurations, at both ends of each range; the lowest bar is all parameters at once, drawn within "
            "their ranges."
        )
        drawn = figure(figures.bars, study, 10.4, 0.22 * len(study.influences) + 1.6, text, wide=True)
        rows = table("Tip errors", ["parameter", *terminal.OPEN_COLUMNS], terminal.open_rows(study), 1)
        sections.append(f"<h2>Open loop</h2>{drawn}{rows}")
    if "closed_loop" in found:
        loop = found["closed_loop"]
        text = (
            "The controller's parameters are wrong, the robot is the nominal one. Increase of the largest tracking "
            f"error over {1e3 * loop.nominal_maximum:.0f} µm with true parameters."
        )
        drawn = figure(figures.curves, loop, 10.4, 5.4, text, wide=True)
        columns = ["parameter", *terminal.CLOSED_COLUMNS]
        rows = table("Increase of the error, worst of the range", columns, terminal.closed_rows(loop), 2)
        sections.append(f"<h2>Closed loop</h2>{drawn}{rows}")
    source = robot + (f" in {scenario}" if scenario else "")
    with atomic_writer(target) as file:
        file.write(html_page.page("Which parameters matter", sections, source, "ctcr sensitivity"))
