"""The study as tables, in sentences, as JSON, and as one HTML page that needs nothing else."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ctcr.sensitivity.advice import advices
from ctcr.sensitivity.closed_loop import ClosedLoop
from ctcr.sensitivity.open_loop import OpenLoop
from ctcr.show import html_page, output
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.style import AXES, ERROR, FAINT

OPEN_COLUMNS = ["parameter", "mean, mm", "95 %, mm", "max, mm"]
CLOSED_COLUMNS = ["parameter", "range", "mean +um", "max +um"]


def open_rows(study: OpenLoop) -> list[list[str]]:
    """Largest influence first; the last row is of all together."""
    order = [*sorted(study.influences, key=lambda one: -one.p95), study.together]
    return [[one.name, f"{one.mean:.3f}", f"{one.p95:.3f}", f"{one.maximum:.3f}"] for one in order]


def closed_rows(study: ClosedLoop) -> list[list[str]]:
    """Largest influence first; the last row is the worst case of all."""

    def row(name: str, change: str, mean: float, largest: float) -> list[str]:
        return [name, change, f"{1e3 * mean:.1f}", f"{1e3 * largest:.1f}"]

    rows = []
    for curve in sorted(study.curves, key=lambda curve: -curve.worst_maximum):
        one = curve.varied
        change = f"{one.low:+g} to {one.high:+g} {one.unit}".strip()
        rows.append(row(one.name, change, curve.worst_mean, curve.worst_maximum))
    return [*rows, row("all of them, worst case", "", study.cumulated_mean, study.cumulated_maximum)]


def closing(found: dict[str, Any], accuracy: float) -> list[str]:
    """The speed and the advice, in sentences."""
    lines = []
    if (study := found.get("open_loop")) and study.seconds > 0:
        lines.append(
            f"{study.solved:.3g} tips predicted by {study.evaluations:.3g} evaluations of the model in "
            f"{study.seconds:.1f} s of processor time: {study.solved / study.seconds:.3g} tips and "
            f"{study.evaluations / study.seconds:.3g} evaluations a second and core."
        )
    names = {"open_loop": "Open loop, 95 % of configurations", "closed_loop": "Closed loop, largest error"}
    return lines + [f"{names[kind]}. {advice.text()}" for kind, advice in advices(found, accuracy).items()]


def show(console, found: dict[str, Any], accuracy: float) -> None:
    """Prints the tables and the advice on a rich console."""
    if study := found.get("open_loop"):
        title = f"Open loop: tip errors at {study.configurations} random configurations"
        console.print(output.table(title, OPEN_COLUMNS, open_rows(study)))
    if study := found.get("closed_loop"):
        nominal = f"mean {study.nominal_mean:.3f}, max {study.nominal_maximum:.3f} mm"
        title = f"Closed loop: increase of the error; with true parameters: {nominal}"
        console.print(output.table(title, CLOSED_COLUMNS, closed_rows(study), 2))
    for line in closing(found, accuracy):
        console.print(line, markup=False)


def as_data(robot: str, found: dict[str, Any], accuracy: float) -> dict[str, Any]:
    """The JSON of the command."""
    data: dict[str, Any] = {"robot": robot, "accuracy_mm": accuracy}
    if study := found.get("open_loop"):
        data["open_loop"] = {
            "configurations": study.configurations,
            "tips": study.solved,
            "evaluations": study.evaluations,
            "processor_s": study.seconds,
            "influence": {
                one.name: {"mean_mm": one.mean, "p95_mm": one.p95, "max_mm": one.maximum, "unsolved": one.unsolved}
                for one in (*study.influences, study.together)
            },
        }
    if study := found.get("closed_loop"):
        data["closed_loop"] = {
            "nominal_mean_mm": study.nominal_mean,
            "nominal_max_mm": study.nominal_maximum,
            "cumulated_mean_mm": study.cumulated_mean,
            "cumulated_max_mm": study.cumulated_maximum,
            "influence": {
                curve.varied.name: {
                    "unit": curve.varied.unit,
                    "change": [curve.varied.change(f) for f in curve.fraction],
                    "mean_increase_mm": curve.mean,
                    "max_increase_mm": curve.maximum,
                }
                for curve in study.curves
            },
        }
    for kind, advice in advices(found, accuracy).items():
        data[kind] |= {"calibrate": advice.calibrate, "error_mm": advice.error}
    return data


def page(found: dict[str, Any], source: str, accuracy: float) -> str:
    """The whole HTML text; `accuracy` [mm]."""
    sections = ["<h1>Which parameters matter</h1>", bullets(closing(found, accuracy))]
    if study := found.get("open_loop"):
        text = (
            f"Distance between the tips that the nominal robot and a wrong one predict, at {study.configurations} "
            "random configurations, at both ends of each range; the lowest bar is all parameters at once, drawn within "
            "their ranges."
        )
        drawn = figure(bars, study, 10.4, 0.22 * len(study.influences) + 1.6, text, wide=True)
        rows = table("Tip errors", OPEN_COLUMNS, open_rows(study), 1)
        sections.append(f"<h2>Open loop</h2>{drawn}{rows}")
    if study := found.get("closed_loop"):
        text = (
            "The controller's parameters are wrong, the robot is the nominal one. Increase of the largest tracking "
            f"error over {1e3 * study.nominal_maximum:.0f} µm with true parameters."
        )
        drawn = figure(curves, study, 10.4, 5.4, text, wide=True)
        rows = table("Increase of the error, worst of the range", CLOSED_COLUMNS, closed_rows(study), 2)
        sections.append(f"<h2>Closed loop</h2>{drawn}{rows}")
    return html_page.page("Which parameters matter", sections, source, "ctcr sensitivity")


def bars(figure: Figure, study: OpenLoop) -> None:
    """Mean, 95 % and largest tip error of each parameter, logarithmic."""
    axes = figure.subplots()
    order = [study.together, *sorted(study.influences, key=lambda one: one.p95)]
    row = np.arange(len(order))
    axes.barh(row, [max(one.p95, 1e-4) for one in order], color=ERROR, alpha=0.8, height=0.65, label="95 % are below")
    axes.plot([max(one.mean, 1e-4) for one in order], row, "D", color="#1c2733", ms=3.5, label="mean")
    axes.plot([max(one.maximum, 1e-4) for one in order], row, "|", color="#1c2733", ms=8, label="largest")
    axes.set_yticks(row, [one.name for one in order])
    axes.set(xscale="log", xlabel="tip error, mm")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 2 / len(order)), fontsize=9)  # above the last bar


def curves(figure: Figure, study: ClosedLoop) -> None:
    """Increase of the largest error along the range of each kind of parameter, a line a tube (paper, Fig. 4)."""
    kinds = list(dict.fromkeys(curve.varied.kind for curve in study.curves if curve.varied.tube))
    panels = figure.subplots(-(-len(kinds) // 4), 4, squeeze=False, sharey=True).ravel()
    for panel, kind in zip(panels, kinds, strict=False):
        for curve in (one for one in study.curves if one.varied.kind == kind):
            varied, colour = curve.varied, AXES[(curve.varied.tube - 1) % 3]
            change = [varied.change(fraction) for fraction in curve.fraction]
            panel.plot(change, 1e3 * curve.maximum, "o-", ms=3, color=colour, label=f"tube {varied.tube}")
        panel.axhline(0, color=FAINT, lw=1)
        panel.set_title(kind, fontsize=9.5)
        panel.set(xlabel=varied.unit or "change")
    for panel in panels[len(kinds) :]:
        panel.set_visible(False)
    panels[0].legend(fontsize=8)
    figure.supylabel("increase of the largest error, µm", fontsize=10)
