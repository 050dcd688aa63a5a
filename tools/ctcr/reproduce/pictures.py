"""The pictures of the page, as SVG text through `html_page.figure`."""

import numpy as np
from matplotlib.figure import Figure

from ctcr.reproduce.control import Scenarios
from ctcr.show.style import AXES, ERROR, INK
from ctcr.track.result import errors_mm


def integration(figure: Figure, errors: dict[str, np.ndarray]) -> None:
    """Fig. 2: errors of one step a segment."""
    axes = figure.subplots()
    axes.boxplot(
        [100 * np.maximum(error, 1e-13) for error in errors.values()],
        tick_labels=list(errors),
        whis=(0, 100),
        patch_artist=True,
        boxprops={"facecolor": "#cfe3ee"},
        medianprops={"color": INK},
    )
    axes.set(yscale="log", ylabel="tip error, % of the length")


def forces(figure: Figure, s: Scenarios) -> None:
    """Fig. 3b and Fig. 6: errors by weight, up to 20 g."""
    axes = figure.subplots()
    groups = [("S2", 0.0), *((name, mass) for name in ("S3", "S4") for mass in (5.0, 10.0, 15.0, 20.0))]
    boxes = axes.boxplot(
        [errors_mm(s.runs[group]) for group in groups],
        tick_labels=[f"{name}\n{mass:g} g" for name, mass in groups],
        whis=(0, 100),
        showmeans=True,
        patch_artist=True,
        medianprops={"color": INK},
        meanprops={"marker": "D", "markersize": 4},
    )
    colour = {"S2": "#e3e7ea", "S3": "#f6dcc0", "S4": "#cfe3ee"}
    for box, (name, _) in zip(boxes["boxes"], groups, strict=True):
        box.set(facecolor=colour[name])
    axes.set(ylabel="tracking error, mm")


def beyond(figure: Figure, s: Scenarios) -> None:
    """The largest error by weight: the paper's scheme with unknown and known force, ours, and what is possible."""
    axes = figure.subplots()
    for scenario, colour, label in (
        ("S3", ERROR, "the paper's scheme, force unknown (S3)"),
        ("S4", AXES[1], "the paper's scheme, force known (S4)"),
        ("S5", AXES[0], "ours (S5)"),
    ):
        masses = sorted(mass for name, mass in s.runs if name == scenario)
        largest = [errors_mm(s.runs[scenario, mass]).max() for mass in masses]
        axes.plot(masses, largest, "o-", color=colour, label=label)
    least = {mass: 1e3 * away for mass, away in s.reach.items() if away > 0}
    axes.plot(list(least), list(least.values()), "k_", ms=16, mew=2, label="least of any posture within the limits")
    axes.axhline(1, color="#8794a0", lw=1, ls="--")
    axes.set(yscale="log", xlabel="weight at the tip, g", ylabel="largest error, mm")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.legend(fontsize=9)
