"""The diagnosis as one HTML page that needs nothing else: verdict first."""

from collections.abc import Iterable

import numpy as np

from ctcr.arrays import evenly
from ctcr.diagnose import figures, next_commands
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.diagnose.varying_coefficients import ADVICE
from ctcr.effects import catalogue
from ctcr.fit.result import Fit
from ctcr.model import fields
from ctcr.robot.description import Robot
from ctcr.show import html_page
from ctcr.show import scene as show
from ctcr.show.html_page import as_html, cards, figure, paragraph, table
from ctcr.show.wording import deviation, number, sentence, short
from ctcr.table.sessions import Sessions

MOST_ARROWS = 800
ARROW_SHARE = 0.12  # of the workspace that a large error (95 %) may fill on the page


def page(d: Diagnosis) -> str:
    """The whole HTML text."""
    title = f"Diagnosis: {d.robot.name}"
    parts = [_found, _errors, _explanations, _varying, _view, _candidates, _next, _fitted, _limits]
    sections = [_opening(d), *(part(d) for part in parts)]
    return html_page.page(title, sections, d.files)


def _listed(lines: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{line}</li>' for line in lines)}</ul>"


def _opening(d: Diagnosis) -> str:
    rms = {name: f"{short(value)} mm" for name, value in d.rms_mm.items()}
    effects = [("good", rms["with_effects"], "with the effects found")] if d.accepted else []
    numbers = [
        ("error", rms["nominal"], "RMS error with the robot file"),
        ("error", rms["calibrated"], "after calibration"),
        *effects,
        ("noise", f"{short(d.floors.expected_error_mm)} mm", d.floors.NAMES[1]),
    ]
    verdict = d.verdict.word.replace("_", " ").capitalize()
    return (
        paragraph(" " + " ".join(d.verdict.sentences), "lead", bold=f"{verdict}.")
        + cards(numbers)
        + f'<p class="soft">Errors of {d.judged_on}. '
        f"{d.floors.MEANING.capitalize()}; sensor jitter alone: {short(d.floors.sensor_jitter_mm)} mm.</p>"
    )


def _found(d: Diagnosis) -> str:
    if not d.accepted:
        return ""
    effects = [catalogue.get(identity, d.robot.n_tubes) for a in d.accepted for identity in a.ids]
    heading = "Effects that imitate the cause" if d.verdict.names_no_cause else "What is missing"
    listed = _listed(as_html(f" ({e.id}). {e.physics}", bold=e.title) for e in effects)
    add = paragraph("To add to the robot file what was found:") + html_page.command(next_commands.to_add(d))
    return f"<h2>{heading}</h2>{listed}{'' if d.verdict.names_no_cause else add}"


def _explanations(d: Diagnosis) -> str:
    about = paragraph("Sets of effects that were fitted, noise alone and a cause outside the catalogue share it.")
    known = table("Posterior probability", ["what acts", "probability"], d.verdict.rows, 1)
    return f"<h2>How probable each explanation is</h2>{about}{known}"


def _errors(d: Diagnosis) -> str:
    left = figure(figures.waterfall, d, 5.2, 3.8, "RMS error on held-out readings.")
    right = figure(figures.course, d, 5.2, 3.8, "The error of every reading, in the order measured.")
    text = "The error after calibration against the quantities that predict it best; the part that the effects explain."
    more = figure(figures.before_after, d, 10.4, 3.6, text, True)
    heading = "The error falls" if d.accepted and not d.verdict.names_no_cause else "The errors"
    return f'<h2>{heading}</h2><div class="pair">{left}{right}</div>{more}'


def _varying(d: Diagnosis) -> str:
    """The varying-coefficient model: where an effect of one's own would have to act."""
    if not d.varying:
        return ""
    text = "How each parameter would have to change over the readings, beside its calibrated value."
    return (
        f"<h2>Parameters that vary</h2>{paragraph(d.varying.lead + ':')}"
        + _listed(as_html(v.message) for v in d.varying.variations)
        + figure(figures.varying, d, 10.4, 3.4, text, True)
        + paragraph(ADVICE)
    )


def _view(d: Diagnosis) -> str:
    heading = "Before and after" if d.accepted else "Where the errors are"
    return f"<h2>{heading}</h2>" + html_page.view(
        scene(d),
        "Arrows lead from the predicted towards the measured tip, all drawn with the same factor; tracker frame.",
    )


def _candidates(d: Diagnosis) -> str:
    text = (
        "Every candidate was judged together with the calibration; pale: linearised, too far behind to be fitted. "
        "Boxed: accepted, with all that these data cannot tell from it."
    )
    drawn = figure(figures.candidates, d, 10.4, 4.4 * -(-len(d.rounds) // figures.PANELS), text, True)
    text = (
        "Fraction of a candidate's signal that another one can imitate together with calibration: where it is near 1 "
        "both ways, these data can hardly tell the two apart."
    )
    apart = figure(figures.overlap, d, 5.2, 4.2, text)
    why = (f"Round {number}. {r.why_not}" for number, r in enumerate(d.rounds, start=1) if r.why_not)
    below = f'<div class="pair">{apart}<div>{"".join(map(paragraph, why))}</div></div>'
    return f"<h2>All candidates</h2>{drawn}{below}" if drawn else ""


def _next(d: Diagnosis) -> str:
    """Further measurements that would decide what is open: effects that some of the likely explanations hold."""
    ids = [] if d.verdict.names_no_cause else d.verdict.undecided
    advice = [as_html(f": {catalogue.get(i, d.robot.n_tubes).measure}", bold=i) for i in ids]
    advice += map(as_html, d.varying.measure if d.varying else [])
    if not advice:
        return ""
    runs = paragraph("Propose the runs that decide between rivals:") + html_page.command(next_commands.to_plan(d))
    return f"<h2>What to measure next</h2>{_listed(advice)}{runs if ids else ''}"


def _fitted(d: Diagnosis) -> str:
    return fitted_values(d.final, d.robot, d.measurements.sessions)


def fitted_values(fit: Fit, robot: Robot, sessions: Sessions | None) -> str:
    """The parameters of a fit, those of effects first, and what each run has of its own."""
    known, rows, said = catalogue.parameter_of(robot.n_tubes), [], ""
    for one in fields.fitted(fit):
        meaning = known[one.name].meaning if one.name in known else ""
        meaning, said = "the same" if meaning and meaning == said else meaning, meaning
        values = number(one.value, one.sd), deviation(one.sd)
        rows.append([one.name, meaning, *values, one.unit, f"{one.shift:+.1f}"])
    rows.sort(key=lambda row: not row[0].startswith("effects."))
    columns = {
        "parameter": "",
        "meaning": "",
        "value": "as fitted",
        "sd": "its standard deviation",
        "unit": "of both, as in the robot file",
        "shift, prior sd": "fitted less robot file, in standard deviations that the robot file gives the value",
    }
    fitted = "<h2>Fitted values</h2>" + table("Effects first, then calibration", columns, rows, 2)
    if sessions:
        fitted += table(sessions.TITLE, sessions.columns, sessions.rows(), 0)
    return fitted


def _limits(d: Diagnosis) -> str:
    not_tested = (f"{identity}: {reason}" for identity, reason in d.not_testable.items())
    lines = [*d.residual.messages, *map(sentence, d.notices), *not_tested]
    return "<h2>The residual, and limits of these data</h2>" + _listed(map(as_html, lines))


def scene(d: Diagnosis) -> str:
    """JSON text for `html_page.view`; positions in mm, tracker frame."""
    rows = np.flatnonzero(np.isfinite(d.calibrated.residual[:, :3]).all(axis=1))
    rows = rows[evenly(len(rows), MOST_ARROWS)]
    tips = 1e3 * d.measurements.position[rows]
    size = np.linalg.norm(1e3 * d.calibrated.residual[rows, :3], axis=1)
    factor = show.arrow_factor(tips, float(np.quantile(size, 0.95)), ARROW_SHARE)
    readings = {"row": d.measurements.row[rows].tolist(), "run": d.measurements.run[rows].tolist()}
    layers = [show.layer("points", "measured", tips, "noise", hover=readings)]
    for fit, colour, name in figures.fits_shown(d):
        error = 1e3 * fit.residual[rows, :3]
        readings[f"error, {name}, mm"] = show.numbers(np.linalg.norm(error, axis=1))
        tail = tips - error
        layers.append(show.layer("arrows", f"error, {name}, × {factor:g}", tail, colour, 1.4, to=tail + factor * error))
    return show.view(layers)
