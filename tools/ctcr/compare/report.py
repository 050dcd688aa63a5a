"""The comparison as one HTML page that needs nothing else: no network, no other file."""

from functools import partial

import numpy as np

from ctcr.arrays import Integers, evenly
from ctcr.compare import figures, terminal
from ctcr.compare.analysis import Comparison
from ctcr.compare.summary import findings, headline, held_out
from ctcr.show import html_page
from ctcr.show import scene as show
from ctcr.show.html_page import as_html, bullets, cards, figure, paragraph, table, view
from ctcr.show.wording import counted, percent

MOST_ARROWS = 1500
ARROW_SHARE = 0.12  # of the workspace that a large error (95 %) may fill on the page


def page(c: Comparison) -> str:
    """The whole HTML text."""
    title = f"Model and measurement: {c.robot}"
    sections = [_opening(c), _findings(c), _view(c), _figures(c), _tables(c)]
    return html_page.page(title, sections, c.files)


def _opening(c: Comparison) -> str:
    p, n, d = c.position_mm, c.noise, c.direction
    numbers = [
        ("error", f"{p.rms:.3g} mm", f"RMS error: {percent(c.percent_of_length.rms / 100)} of the deployed length"),
        ("error", f"{p.p95:.3g} mm", f"95 % are below; the largest is {p.maximum:.3g} mm"),
    ]
    if c.angle_deg:
        angle, most = c.angle_deg.rms, c.angle_deg.maximum
        numbers.append(("error", f"{angle:.3g}°", f"RMS {c.angle_kind} error, at most {most:.3g}°"))
    if np.isfinite(n.rms_mm):
        sources = {"revisits": f"{n.pairs} same-direction revisits", "rest": "at rest", "stated": "as stated"}
        numbers.append(("noise", f"{n.rms_mm:.2g} mm", f"scatter of a reading, RMS ({sources[n.source]})"))
    if d:
        numbers.append(("back", f"{d.rms_mm:.3g} mm", f"hysteresis, RMS over {counted(d.pairs, 'pair')} of visits"))
    wrong = [one.sentence for one in c.wrong]
    first = f"<h2>{c.WRONG}</h2>{bullets(wrong)}" if wrong else ""
    first += paragraph(c.unexplained, "lead") if c.unexplained else ""
    return first + paragraph(headline(c), "lead") + cards(numbers)


def _findings(c: Comparison) -> str:
    items = "".join(
        f'<li>{as_html(item.text)}<span class="bar"><i style="width:{100 * min(item.share, 1):.1f}%"></i></span></li>'
        for item in findings(c)
    )
    found = (
        f'<ol class="findings">{items}</ol><p class="soft">A bar is the fraction of the squared error that the finding '
        f"concerns; shares overlap.</p>"
        if items
        else f"<p>{'None before the conventions are right' if c.wrong else 'No finding beyond noise'}.</p>"
    )
    lists = "".join(f"<h2>{title}</h2>{bullets(lines)}" for title, lines in terminal.remarks(c) if lines)
    return f"<h2>Findings</h2>{found}{lists}"


def _view(c: Comparison) -> str:
    count = len(c.headline.row)
    factor = arrow_factor(c)
    length = "at their true length" if factor == 1 else f"{factor:g} times as long as they are"
    note = f" {MOST_ARROWS} of {count} readings are shown, evenly spread." if count > MOST_ARROWS else ""
    caption = f"Arrows lead from the predicted towards the measured tip, drawn {length}; tracker frame.{note}"
    return "<h2>Measured and predicted tips</h2>" + view(scene(c), caption)


def _figures(c: Comparison) -> str:
    wide = partial(figure, subject=c, width=10.4, wide=True)
    half = partial(figure, subject=c, width=5.2, height=3.4)
    sizes = half(figures.sizes, caption="Sizes of the errors against noise alone.")
    course = half(figures.course, caption="The error in the order measured.")
    hysteresis = wide(
        figures.hysteresis,
        height=3.6,
        caption="Visits of the same joints. The errors of two visits are compared, so that small differences of the "
        "joints do not count.",
    )
    bars = wide(
        figures.ranking,
        height=4.6,
        caption=f"Fraction of the squared error (its constant part removed) that each quantity predicts on "
        f"{held_out(c)}. Red: findings, each judged on the residual of the stronger ones. The best of all quantities "
        f"exceeds the dashed line by chance in 1 of 80 tables.",
    )
    panels = wide(
        figures.strongest,
        height=6.4,
        caption="The error against the strongest quantities, in the frame where each predicts best: readings (points) "
        "and means of equal groups (lines). An asterisk marks a finding.",
    )
    return (
        f'<h2>Size and course of the error</h2><div class="pair">{sizes}{course}</div>'
        + (f"<h2>Hysteresis</h2>{hysteresis}" if hysteresis else "")
        + (f"<h2>What the error depends on</h2>{bars}{panels}" if bars else "")
    )


def _tables(c: Comparison) -> str:
    shown = [
        terminal.errors,
        terminal.repeatability,
        terminal.by_run,
        *([terminal.dependences] * bool(c.ranking.alone)),
    ]
    lines = map(paragraph, terminal.left_out(c, 200))
    return "".join(["<h2>Numbers</h2>", *(table(*description(c)) for description in shown), *lines])


def arrow_factor(c: Comparison) -> float:
    """Factor, at least 1, that makes the errors visible."""
    return show.arrow_factor(1e3 * c.headline.measured, c.position_mm.p95, ARROW_SHARE)


def shown_rows(c: Comparison) -> Integers:
    """Rows of the sample that the view shows, evenly spread."""
    return evenly(len(c.headline.row), MOST_ARROWS)


def scene(c: Comparison) -> str:
    """JSON text for `html_page.view`; positions in mm, tracker frame."""
    rows, factor, sample = shown_rows(c), arrow_factor(c), c.headline
    predicted, measured = sample.predicted[rows] * 1e3, sample.measured[rows] * 1e3
    error, plate = measured - predicted, 1e3 * sample.robot.tracker.position[None]
    size = np.linalg.norm(error, axis=1)
    readings = {"row": sample.row[rows].tolist(), "run": sample.run[rows].tolist(), "error, mm": show.numbers(size)}
    arrows = {"to": predicted + factor * error, "value": show.numbers(size)}
    return show.view(
        [
            show.layer("points", "predicted", predicted, "noise", 1.8),
            show.layer("points", "measured", measured, "out", 2.2, hover=readings),
            show.layer("arrows", f"error × {factor:g}", predicted, size=1.6, **arrows),
            show.layer("points", "front plate (robot file)", plate, "ink", 5, hidden=True),
        ],
        most=show.most(size),
    )
