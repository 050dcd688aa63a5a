"""A joint fit on a terminal."""

from math import isfinite

from ctcr.calibrate.joint_fit import Calibration, Stage
from ctcr.model.fields import doubts
from ctcr.show.output import table
from ctcr.show.wording import deviation, mm, number

ERROR_COLUMNS = ["", "RMS, mm", "mean, mm", "max, mm", "RMS, deg", "readings"]
PARAMETER_COLUMNS = ["", "unit", "robot file", "fitted", "moved", "sd left", ""]
SHOWN = 12
NEEDED_WIDTH = 108  # of the table of parameters; a narrower terminal wraps its lines


def show(console, c: Calibration) -> None:
    """Prints a calibration on a rich console."""
    console.print(f"[bold]{c.before.name}[/bold]", highlight=False)
    console.print(headline(c), markup=False)
    console.print(table("Error, measured minus predicted", ERROR_COLUMNS, error_rows(c)))
    made = table("Parameters", PARAMETER_COLUMNS, parameter_rows(c), text_columns=2)
    for column in made.columns:
        column.no_wrap = True
    made.columns[-1].justify = "left"
    console.width = max(console.width, NEEDED_WIDTH)
    console.print(made)
    lists = ("Doubts", doubts(c.fitted)), ("Undetermined by the data", undetermined(c)), ("To know", c.notices)
    for title, lines in lists:
        if lines:
            console.print(f"[bold]{title}[/bold]")
        for line in lines:
            console.print(f"  • {line}", markup=False)


def headline(c: Calibration) -> str:
    """The result in one or two sentences."""
    before, after = c.stages[0].rms_mm, c.stages[-1].rms_mm
    text = f"{len(c.fitted)} parameters fitted: the error falls from {mm(before)} to {mm(after)} RMS"
    if c.held_out:
        error, floor = mm(c.held_out.error.rms_mm), mm(c.held_out.floor.rms_mm)
        text += f", {error} on held-out {c.held_out.kind}, where a right model would leave {floor}."
    else:
        text += f". A right model would leave {mm(c.floor.rms_mm)}."
    return text + f" Reduced chi-square {c.fit.reduced_chi_square:.3g}."


def error_rows(c: Calibration) -> list[list[str]]:
    """The errors by stage, ending at the error to be expected of a right model."""
    rows = [[stage.name, *_sizes(stage), str(c.n_readings)] for stage in c.stages]
    if c.held_out:
        name = f"held out ({c.held_out.kind}, {c.held_out.fits} fits)"
        rows.append([name, *_sizes(c.held_out.error), str(c.held_out.readings)])
        rows.append(["expected there", *_sizes(c.held_out.floor), ""])
    smooth = " and field" if c.fit.noise.position_field > 0 else ""
    return [*rows, [f"expected (jitter{smooth})", *_sizes(c.floor), ""]]


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
