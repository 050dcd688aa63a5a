"""How figures look: one colour means one thing in all of them."""

import io
from collections.abc import Callable
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

ERROR, NOISE, OUT, BACK, FAINT = "#b3361e", "#6b7785", "#0b6e99", "#d17a00", "#c9d1d9"
AXES = ("#0b6e99", "#d17a00", "#4b8b3b")
INK = "#1c2733"

STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
    "font.size": 10,
    "axes.edgecolor": "#8794a0",
    "axes.labelcolor": INK,
    "text.color": INK,
    "text.parse_math": False,  # a name with two dollar signs is no formula
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "savefig.dpi": 150,
    "axes.grid": True,
    "grid.color": "#e7ebef",
    "axes.axisbelow": True,
    "svg.hashsalt": "ctcr",
}


class Picture(Figure):
    """A figure in this style, which a notebook shows as it is."""

    def _repr_svg_(self) -> str:
        target = io.StringIO()
        with matplotlib.rc_context(STYLE):
            self.savefig(target, format="svg", metadata={"Date": None, "Creator": None})
        text = target.getvalue()
        return text[text.index("<svg") :]


def picture(plot: Callable[[Figure, Any], Any], subject: Any, width: float, height: float) -> Picture | None:
    """A picture of `subject`, `width` by `height` inches, or None when there is nothing to draw."""
    with matplotlib.rc_context(STYLE):
        figure = Picture(figsize=(width, height), layout="constrained")
        if plot(figure, subject) is False:
            return None
        _number_ticks(figure)
    return figure


def draw(plot: Callable[[Figure, Any], Any], subject: Any, width: float, height: float) -> str | None:
    """SVG text of a picture, or None when there is nothing to draw."""
    made = picture(plot, subject, width, height)
    return made and made._repr_svg_()


def _number_ticks(figure: Figure) -> None:
    """Logarithmic axes with plain numbers: the usual powers are formulas."""
    for axes in figure.axes:
        for axis, scale in ((axes.xaxis, axes.get_xscale()), (axes.yaxis, axes.get_yscale())):
            if scale == "linear":
                continue
            if scale == "log":
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
