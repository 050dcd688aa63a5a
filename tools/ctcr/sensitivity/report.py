"""The study as one HTML page that needs nothing else."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ctcr.sensitivity.closed_loop import ClosedLoop
from ctcr.sensitivity.open_loop import OpenLoop
from ctcr.sensitivity.terminal import CLOSED_COLUMNS, OPEN_COLUMNS, closed_rows, closing, open_rows
from ctcr.show import html_page
from ctcr.show.html_page import bullets, figure, table
from ctcr.show.palette import AXES, ERROR, FAINT, INK


def page(found: dict[str, Any], files: Sequence[str], accuracy: float) -> str:
    """The whole HTML text; `files`: the input files; `accuracy` [mm]."""
    sections = [bullets(closing(found, accuracy))]
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
    return html_page.page("Which parameters matter", sections, files)


def bars(figure: Figure, study: OpenLoop) -> None:
    """Mean, 95 % and largest tip error of each parameter."""
    axes = figure.subplots()
    order = [study.together, *sorted(study.influences, key=lambda one: one.p95)]
    row = np.arange(len(order))
    axes.barh(row, [one.p95 for one in order], color=ERROR, alpha=0.8, height=0.65, label="95 % are below")
    axes.plot([one.mean for one in order], row, "D", color=INK, ms=3.5, label="mean")
    axes.plot([one.maximum for one in order], row, "|", color=INK, ms=8, label="largest")
    axes.set_yticks(row, [one.name for one in order])
    axes.set(xlabel="tip error, mm", xlim=(0, None))
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
