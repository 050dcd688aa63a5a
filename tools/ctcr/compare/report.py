"""The comparison as one HTML page that needs nothing else: no network, no other file."""

import html
from pathlib import Path

import numpy as np

from ctcr.compare import figures, terminal
from ctcr.compare.analysis import Comparison
from ctcr.compare.limits import limits
from ctcr.compare.scene import MOST_ARROWS, arrow_factor, scene
from ctcr.compare.summary import findings, headline, quiet
from ctcr.show import html_page
from ctcr.show.html_page import bullets, cards, figure, table
from ctcr.show.output import atomic_writer, listed


def write(c: Comparison, target: str | Path, source: str) -> None:
    """Write the report; source says what was compared. Raises InputError when the file cannot be written."""
    with atomic_writer(target) as file:
        file.write(page(c, source))


def page(c: Comparison, source: str) -> str:
    """The whole HTML text."""
    title = f"Model and measurement: {c.robot}"
    sections = [_opening(c, title), _findings(c), _view(c), _sizes(c), _directions(c), _dependences(c), _tables(c)]
    return html_page.page(title, sections, source, "ctcr compare", scene(c))


def _opening(c: Comparison, title: str) -> str:
    p, n, d = c.position_mm, c.noise, c.direction
    numbers = [
        ("error", f"{p.rms:.3g} mm", f"RMS error: {c.percent_of_length.rms:.2g} % of the deployed length"),
        ("error", f"{p.p95:.3g} mm", f"95 % are below; the largest is {p.maximum:.3g} mm"),
    ]
    if c.angle_deg:
        angle, most = c.angle_deg.rms, c.angle_deg.maximum
        numbers.append(("error", f"{angle:.3g}°", f"RMS {c.angle_kind} error, at most {most:.3g}°"))
    if np.isfinite(n.rms_mm):
        sources = {"revisits": f"{n.pairs} same-direction revisits", "rest": "at rest", "stated": "as stated"}
        numbers.append(("noise", f"{n.rms_mm:.2g} mm", f"noise of a reading, RMS ({sources[n.source]})"))
    if d:
        numbers.append(("back", f"{d.rms_mm:.3g} mm", f"out against return, RMS over {d.pairs} pairs of visits"))
    return f'<h1>{html.escape(title)}</h1><p class="lead">{html.escape(headline(c))}</p>{cards(numbers)}'


def _findings(c: Comparison) -> str:
    items = "".join(
        f'<li>{html.escape(item.text)}<span class="bar">'
        f'<i style="width:{100 * min(item.share, 1):.1f}%"></i></span></li>'
        for item in findings(c)
    )
    found = (
        f'<ol class="findings">{items}</ol><p class="soft">A bar is the share of the squared error that the finding '
        f"concerns; shares overlap.</p>"
        if items
        else "<p>No finding beyond noise.</p>"
    )
    text = f"<h2>What was found</h2>{found}"
    for title, lines in (
        ("", quiet(c)),
        ("What these data cannot say", limits(c)),
        ("What became of the table first", c.notices),
    ):
        if lines:
            heading = f"<h2>{title}</h2>" if title else ""
            text += heading + bullets(lines)
    return text


def _view(c: Comparison) -> str:
    count = len(c.headline.row)
    factor = arrow_factor(c)
    length = "at their true length" if factor == 1 else f"{factor:g} times as long as they are"
    note = f" {MOST_ARROWS} of {count} readings are shown, evenly spread." if count > MOST_ARROWS else ""
    return (
        '<h2>Measured and predicted tips</h2><div id="view"></div>'
        f'<p class="soft">Arrows lead from the predicted towards the measured tip, drawn {length}; tracker '
        f"frame.{note} Drag to turn, scroll to zoom.</p>"
    )


def _sizes(c: Comparison) -> str:
    left = figure(figures.histogram, c, 5.2, 3.4, "How large the errors are, against noise alone (logarithmic axis).")
    right = figure(figures.course, c, 5.2, 3.4, "The error in the order measured.")
    return f'<h2>How large, and when</h2><div class="pair">{left}{right}</div>'


def _directions(c: Comparison) -> str:
    drawn = figure(
        figures.out_and_return,
        c,
        10.4,
        3.6,
        "Visits of the same joints. The errors of two visits are compared, so that small differences of the joints "
        "do not count.",
        wide=True,
    )
    return f"<h2>Out and return</h2>{drawn}" if drawn else ""


def _dependences(c: Comparison) -> str:
    bars = figure(
        figures.ranking,
        c,
        10.4,
        4.6,
        f"How much of the squared error (its constant part removed) each quantity predicts on "
        f"{c.ranking.block_kind} that were left out. Red: findings, the later ones in what the stronger ones left. "
        f"The best of all quantities gets beyond the dashed line by chance in 1 of 80 tables.",
        wide=True,
    )
    if not bars:
        return ""
    panels = figure(
        figures.strongest,
        c,
        10.4,
        6.4,
        "The error against the strongest quantities, in the frame where each predicts best: readings (points) and "
        "means of equal groups (lines). An asterisk marks a finding.",
        wide=True,
    )
    return f"<h2>Where the error comes from</h2>{bars}{panels}"


def _tables(c: Comparison) -> str:
    parts = [
        table("Error, measured minus predicted", ["", "unit", *terminal.COLUMNS], terminal.error_rows(c), 2),
        table("Repeatability, mm", terminal.REPEAT_COLUMNS, terminal.repeat_rows(c), 1),
        table("By run, mm; mean error vector in the tracker frame", terminal.RUN_COLUMNS, terminal.run_rows(c), 0),
        table(terminal.ranking_title(c), terminal.RANKING_COLUMNS, terminal.ranking_rows(c), 2)
        if c.ranking.alone
        else "",
    ]
    for what, rows in (("not measured", c.sample.not_measured), ("not solved", c.sample.not_solved)):
        if len(rows):
            parts.append(f"<p>{len(rows)} rows {what}: {listed(rows, 200)}</p>")
    return "<h2>Numbers</h2>" + "".join(parts)
