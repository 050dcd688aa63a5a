"""A joint fit on a terminal, and as one HTML page that needs nothing else: no network, no other file."""

from math import isfinite

import numpy as np

from ctcr import settings
from ctcr.calibrate import figures
from ctcr.calibrate.joint_fit import Calibration, Stage
from ctcr.show import html_page, output
from ctcr.show.html_page import bullets, cards, figure, paragraph, table
from ctcr.show.wording import deviation, mm, number

WIDE = 10.4  # [in] of a figure as wide as the page
ERROR_COLUMNS = {
    "": "",
    "RMS, mm": "root mean square of the distance between the measured and the predicted tip",
    "mean, mm": "mean of this distance",
    "max, mm": "largest of these distances",
    "RMS, deg": "root mean square of the angle between the orientations, or between tip directions",
    "readings": "how many count",
}
PARAMETER_COLUMNS = {
    "parameter": "",
    "unit": "",
    "robot file": "the value before, and its standard deviation by the uncertainty of the robot file",
    "fitted": "the value found, and its standard deviation after the fit",
    "moved": "fitted less robot file, in standard deviations of the robot file's value",
    "sd left": "standard deviation after the fit, of that before: near 100 % the data do not determine it",
    "note": "",
}
SHOWN = 12
NEEDED_WIDTH = 114  # of the table of parameters; a narrower terminal wraps its lines


def show(console, c: Calibration) -> None:
    """Prints a calibration on a rich console."""
    console.print(c.before.name, style="bold")
    console.print(headline(c))
    console.print(output.table("Error, measured minus predicted", ERROR_COLUMNS, error_rows(c)))
    made = output.table("Parameters", PARAMETER_COLUMNS, parameter_rows(c), text_columns=2)
    for column in made.columns:
        column.no_wrap = True
    made.columns[-1].justify = "left"
    console.width = max(console.width, NEEDED_WIDTH)
    console.print(made)
    console.bullets(c.doubts, "Doubts")
    console.bullets(undetermined(c), "Undetermined by the data")
    console.bullets(c.notices, "To know")


def headline(c: Calibration) -> str:
    """The result in one or two sentences."""
    before, after = c.stages[0].rms_mm, c.stages[-1].rms_mm
    way = "rises" if after > before else "falls"
    text = f"{len(c.fitted)} parameters fitted: the error {way} from {mm(before)} to {mm(after)} RMS"
    if c.held_out:
        text += f", {mm(c.held_out.error.rms_mm)} on held-out {c.held_out.kind}"
    text += f". Expected error of a right model: {mm(c.floors.expected_error_mm)}."
    return text + f" Reduced chi-square {c.fit.reduced_chi_square:.3g}."


def error_rows(c: Calibration) -> list[list[str]]:
    """The errors by stage, ending at the error to be expected of a right model."""
    rows = [[stage.name, *_sizes(stage), str(c.n_readings)] for stage in c.stages]
    if c.held_out:
        name = f"held out ({c.held_out.kind}, {c.held_out.fits} fits)"
        rows.append([name, *_sizes(c.held_out.error), str(c.held_out.readings)])
    return rows + [[name, *_sizes(Stage(name, size)), ""] for name, size in c.floors.rows()]


def parameter_rows(c: Calibration) -> list[list[str]]:
    """Each parameter before and after, in the unit of the robot file."""
    return [
        [
            item.name,
            item.unit,
            _with_deviation(item.nominal, item.prior_sd),
            _with_deviation(item.value, item.sd),
            f"{item.shift:+.1f} sd" if isfinite(item.shift) else "-",
            f"{100 * item.ratio:.0f} %" if isfinite(item.ratio) else "-",
            item.flag,
        ]
        for item in c.fitted
    ]


def undetermined(c: Calibration) -> list[str]:
    """Undetermined directions and correlated pairs, in words."""
    lines = [f"{d.text}: sd {100 * d.ratio:.0f} % of the prior's" for d in c.fit.directions]
    lines += [
        f"{first} and {second} are correlated ({r:+.2f})"
        for first, second, r in c.fit.correlations
        if not any(first in d.text and second in d.text for d in c.fit.directions)
    ]
    return lines[:SHOWN] + ([f"and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else [])


def _with_deviation(value: float, sd: float) -> str:
    return f"{number(value, sd)} ± {deviation(sd)}" if isfinite(sd) else number(value)


def _sizes(stage: Stage) -> list[str]:
    values = (stage.rms_mm, stage.mean_mm, stage.max_mm, stage.rms_deg)
    return [f"{value:.3f}" if isfinite(value) else "-" for value in values]


def page(c: Calibration) -> str:
    """The whole HTML text."""
    title = f"Calibration: {c.before.name}"
    lists = ("Doubts", c.doubts), ("To know", c.notices)
    known = [f"<h2>{heading}</h2>" + bullets(lines) for heading, lines in lists if lines]
    sections = [_opening(c), *known, *_fit(c), _halves(c), _residuals(c), _numbers(c)]
    return html_page.page(title, sections, c.files)


def _opening(c: Calibration) -> str:
    numbers = [
        ("error", f"{c.stages[0].rms_mm:.3g} mm", "RMS error with the values of the robot file"),
        ("good", f"{c.stages[-1].rms_mm:.3g} mm", f"RMS error with {len(c.fitted)} parameters fitted"),
    ]
    if c.held_out:
        numbers.append(("good", f"{c.held_out.error.rms_mm:.3g} mm", f"RMS error on held-out {c.held_out.kind}"))
    numbers += [
        ("noise", f"{c.floors.expected_error_mm:.2g} mm", c.floors.MEANING),
        ("noise", f"{c.fit.reduced_chi_square:.3g}", "reduced chi-square: 1 where noise explains all"),
    ]
    return paragraph(headline(c), "lead") + cards(numbers)


def _fit(c: Calibration) -> list[str]:
    """How far the fit reduces the error, the parameters, and how well the data determine them."""
    shown, lines = min(len(c.fitted), figures.MOST_NAMES), undetermined(c)
    gain = "From the robot file's values to the expected error. The error that counts is the one of held-out readings."
    values = (
        "Fitted values and their standard deviations, in standard deviations of the robot file's values (grey: one and "
        "two of them). Red: further than two, implausible or at a bound. Pale: not determined."
    )
    together = "Dark red and dark blue: the data determine only the sum or the difference of the two."
    return [
        "<h2>What calibration brings</h2>" + figure(figures.waterfall, c, WIDE, 4.2, gain, wide=True),
        "<h2>The parameters</h2>" + figure(figures.shifts, c, WIDE, 1.0 + 0.24 * shown, values, wide=True),
        table("Values ± one standard deviation", PARAMETER_COLUMNS, parameter_rows(c), 2),
        "<h2>What the data cannot tell apart</h2>" + (bullets(lines) if lines else ""),
        figure(figures.correlations, c, WIDE, 2.8 + 0.2 * shown, together, wide=True),
    ]


def _halves(c: Calibration) -> str:
    if c.halves is None:
        return ""
    h = c.halves
    beyond = mm(float(np.sqrt(max(h.rms_mm**2 - h.noise_mm**2, 0.0))))
    verdict = (
        "so noise explains it: more readings of the same kind would help"
        if h.rms_mm <= settings.HALVES_AGREE * h.noise_mm
        else f"so {beyond} of it is error of the model: it fits one part of the data at the cost of another"
    )
    text = (
        f"Two models, each fitted to half of the {h.kind}, differ by {mm(h.rms_mm)} RMS over the joints visited. "
        f"Noise alone would make it {mm(h.noise_mm)}, {verdict}."
    )
    caption = (
        "Left, middle: where the two disagree. Right: by how much, against what noise explains (line; dashed: twice)."
    )
    picture = figure(figures.half_difference, c, WIDE, 4.6, caption, wide=True)
    return f"<h2>Two halves of the data</h2>{paragraph(text)}{picture}"


def _residuals(c: Calibration) -> str:
    left = figure(figures.sizes, c, 5.2, 3.5, "How large the errors are.")
    right = figure(figures.course, c, 5.2, 3.5, "The error in the order measured.")
    caption = (
        "Arrows lead from the predicted towards the measured tip, tracker frame. The buttons choose between the robot "
        "file's values and the calibrated ones, drawn to one scale."
    )
    return (
        f'<h2>The error before and after</h2><div class="pair">{left}{right}</div>'
        f"{html_page.view(figures.scene(c), caption)}"
    )


def _numbers(c: Calibration) -> str:
    fit = c.fit
    rows = [
        ["readings", str(c.n_readings)],
        ["numbers measured", str(fit.observations)],
        ["effective parameters", f"{fit.effective_parameters:.1f} of {len(c.fitted)}"],
        ["chi-square", f"{fit.chi_square:.5g}"],
        ["reduced chi-square", f"{fit.reduced_chi_square:.3g}"],
        ["seconds of the last fit", f"{fit.seconds:.2g}"],
    ]
    tables = [
        table("Error, measured minus predicted", ERROR_COLUMNS, error_rows(c), 1),
        table("The fit", ["", ""], rows, 1),
    ]
    if sessions := c.readings.sessions:
        tables.append(table(sessions.TITLE, sessions.columns, sessions.rows(), 0))
    return "<h2>Numbers</h2>" + "".join(tables)
