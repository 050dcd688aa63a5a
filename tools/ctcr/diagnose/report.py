"""The diagnosis as one HTML page that needs nothing else: verdict first."""

import html
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ctcr.diagnose import figures
from ctcr.effects import catalogue
from ctcr.model import parameters
from ctcr.show import html_page
from ctcr.show import scene as show
from ctcr.show.html_page import cards, figure, table
from ctcr.show.output import atomic_writer
from ctcr.show.wording import short

if TYPE_CHECKING:
    from ctcr.diagnose.pipeline import Diagnosis

MOST_ARROWS = 800


def write(d: "Diagnosis", target: str | Path, source: str) -> None:
    """Write the report; source says what was diagnosed. Raises InputError when the file cannot be written."""
    with atomic_writer(target) as file:
        file.write(page(d, source))


def page(d: "Diagnosis", source: str) -> str:
    """The whole HTML text."""
    title = f"Diagnosis: {d.robot.name}"
    sections = [
        _opening(d, title),
        _found(d),
        _errors(d),
        _varying(d),
        _view(d),
        _candidates(d),
        _next(d),
        _parameters(d),
        _limits(d),
    ]
    return html_page.page(title, sections, source, "ctcr diagnose", scene(d))


def _opening(d: "Diagnosis", title: str) -> str:
    rms = d.rms_mm
    numbers = [
        ("error", f"{short(rms['nominal'])} mm", "RMS error with the robot file"),
        ("error", f"{short(rms['calibrated'])} mm", "after calibration"),
    ]
    if d.accepted:
        numbers.append(("good", f"{short(rms['with_effects'])} mm", "with the effects found"))
    numbers.append(("noise", f"{short(rms['noise_floor'])} mm", "noise floor"))
    verdict = d.verdict.word.replace("_", " ")
    lead = " ".join(d.verdict.sentences)
    return (
        f"<h1>{html.escape(title)}</h1>"
        f'<p class="lead"><b>{html.escape(verdict.capitalize())}.</b> {html.escape(lead)}</p>'
        f"{cards(numbers)}"
        f'<p class="soft">Errors of {int(d.judged.sum())} readings of held-out runs; of a right model noise '
        f"and uncertain parameters let expect {short(d.expected_mm)} mm there.</p>"
    )


def _found(d: "Diagnosis") -> str:
    if not d.accepted:
        return ""
    items = []
    for a in d.accepted:
        for identity in a.ids:
            e = catalogue.get(identity, d.robot.n_tubes)
            items.append(f"<li><b>{html.escape(e.title)}</b> ({identity}). {html.escape(e.physics)}</li>")
    heading = "Effects that imitate the cause" if d.verdict.names_no_cause else "What is missing"
    return f"<h2>{heading}</h2><ul>{''.join(items)}</ul>"


def _errors(d: "Diagnosis") -> str:
    left = figure(figures.waterfall, d, 5.2, 3.8, "RMS error on held-out runs (logarithmic axis).")
    right = figure(figures.directions, d, 5.2, 3.8, "The error of every reading, in the order measured.")
    more = figure(
        figures.before_after,
        d,
        10.4,
        3.6,
        "The error after calibration against the quantities that predict it best, and what the effects found explain.",
        True,
    )
    heading = "The error falls" if d.accepted and not d.verdict.names_no_cause else "The errors"
    return f'<h2>{heading}</h2><div class="pair">{left}{right}</div>{more}'


def _varying(d: "Diagnosis") -> str:
    """The varying-coefficient model: where an effect of one's own would have to act."""
    if not d.varying:
        return ""
    items = "".join(f"<li>{html.escape(v.message)}</li>" for v in d.varying.variations)
    drawn = figure(
        figures.varying,
        d,
        10.4,
        3.4,
        "How each parameter would have to change over the readings, beside its calibrated value.",
        True,
    )
    return (
        f"<h2>Parameters that vary</h2><p>{html.escape(d.varying.lead)}:</p><ul>{items}</ul>{drawn}"
        f"<p>{html.escape(d.varying.advice)}</p>"
    )


def _view(d: "Diagnosis") -> str:
    heading = "Before and after" if d.accepted else "Where the errors are"
    return (
        f'<h2>{heading}</h2><div id="view"></div><p class="soft">Errors as lines from the predicted towards the '
        "measured tip, all drawn with the same factor; tracker frame. Click a name to hide it.</p>"
    )


def _candidates(d: "Diagnosis") -> str:
    drawn = figure(
        figures.candidates,
        d,
        10.4,
        4.4,
        "Every candidate was judged together with the calibration; pale: linearised, too far behind to be fitted. "
        "Boxed: accepted, with all that these data cannot tell from it.",
        True,
    )
    apart = figure(
        figures.overlap,
        d,
        5.2,
        4.2,
        "Fraction of a candidate's signal that another one can imitate together with calibration: where it is near 1 "
        "both ways, these data cannot tell the two apart.",
    )
    why = next((r.why_not for r in reversed(d.rounds) if r.why_not), "")
    below = f'<div class="pair">{apart}<div><p>{html.escape(why)}</p></div></div>'
    return f"<h2>All candidates</h2>{drawn}{below}" if drawn else ""


def _next(d: "Diagnosis") -> str:
    """What to measure to be surer."""
    named = [] if d.verdict.names_no_cause else d.accepted
    ids = list(dict.fromkeys(identity for a in named for identity in a.ids))
    advice = [f"<li><b>{i}</b>: {html.escape(catalogue.get(i, d.robot.n_tubes).measure)}</li>" for i in ids]
    advice += [f"<li>{html.escape(text)}</li>" for text in (d.varying.measure if d.varying else [])]
    if not advice:
        return ""
    runs = "<p><code>ctcr next ROBOT MEASUREMENTS</code> proposes the runs that decide between rivals.</p>"
    return f"<h2>What to measure next</h2><ul>{''.join(advice)}</ul>{runs if ids else ''}"


def _parameters(d: "Diagnosis") -> str:
    known, rows = catalogue.parameter_of(d.robot.n_tubes), []
    units = parameters.units_with_effects(d.robot)
    for name, value, sd, shift in zip(d.final.names, d.final.values, d.final.sd, d.final.shift, strict=True):
        p = known.get(name)
        unit, meaning = (p.unit, p.meaning) if p else (units[name], "")
        rows.append([name, meaning, f"{value:.5g}", f"{sd:.2g}", unit, f"{shift:+.1f}"])
    rows.sort(key=lambda row: not row[0].startswith("effects."))
    columns = ["parameter", "meaning", "value", "sd", "unit", "shift, prior sd"]
    return "<h2>Fitted values</h2>" + table("Effects first, then calibration", columns, rows, 2)


def _limits(d: "Diagnosis") -> str:
    unseen = (f"{identity}: {reason}" for identity, reason in d.not_testable.items())
    lines = [*d.residual.messages, *d.notices, *unseen]
    return (
        "<h2>The residual, and limits of these data</h2><ul>"
        + "".join(f"<li>{html.escape(line)}</li>" for line in lines)
        + "</ul>"
    )


def scene(d: "Diagnosis") -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot; positions in mm, tracker frame."""
    measured = d.measurements.position
    rows = np.flatnonzero(np.isfinite(d.calibrated.residual[:, :3]).all(axis=1))
    rows = rows[show.evenly(len(rows), MOST_ARROWS)]
    tips = 1e3 * measured[rows]
    size = np.quantile(np.linalg.norm(1e3 * d.calibrated.residual[rows, :3], axis=1), 0.95)
    factor = max(1.0, float(f"{0.12 * np.ptp(tips, axis=0).max() / max(size, 1e-9):.0e}"))
    marker = {"size": 2, "color": "#6b7785"}
    data = [show.trace(tips, "measured", hoverinfo="name", mode="markers", marker=marker)]
    for fit, colour, name in figures.fits_shown(d):
        lines = show.shafts(tips, tips - factor * 1e3 * fit.residual[rows, :3])
        style = {"mode": "lines", "hoverinfo": "name", "line": {"width": 4, "color": colour}, "connectgaps": False}
        data.append(show.trace(lines, f"error, {name}, × {factor:g}", **style))
    return show.view(data)
