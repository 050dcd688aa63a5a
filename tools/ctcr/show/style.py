"""How figures look."""

import io
import re
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from scipy.special import chdtr

from ctcr.arrays import Array
from ctcr.show.palette import INK, LINE, NOISE, PALETTE

MOST_MARKS = 1000  # of a line; where there are more, they become an image, which is smaller
STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
    "font.size": 10,
    "axes.edgecolor": NOISE,
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
    "savefig.dpi": 110,
    "path.simplify_threshold": 0.3,  # px
    "axes.grid": True,
    "grid.color": LINE,
    "axes.axisbelow": True,
    "svg.hashsalt": "ctcr",
    "svg.fonttype": "none",
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
        for line in (line for axes in figure.axes for line in axes.lines):
            marks = line.get_marker() not in ("None", None, "", " ")
            line.set_rasterized(marks and len(line.get_xdata()) > MOST_MARKS)
    return figure


def shares_below(axes, sizes: Array, **style: Any) -> None:
    """The percentage of `sizes` [mm] below each size; lengths stand on one linear scale."""
    share = np.linspace(0, 100, 201)
    before = axes.get_xlim()[1] if axes.lines else 0.0
    axes.plot(np.percentile(sizes, share), share, **style)
    axes.set(xlim=(0, max(before, 1.1 * float(np.percentile(sizes, 99)), 1e-3)), ylim=(0, 102))


def noise_below(axes, sd: float, label: str) -> None:
    """The percentage of noise alone below each size, beside the curves drawn; `sd` is that of each axis [mm]."""
    if sd > 0:
        reach = axes.get_xlim()[1]
        size = np.append(np.linspace(0, min(5 * sd, reach), 60), reach)
        axes.plot(size, 100 * chdtr(3, (size / sd) ** 2), color=NOISE, lw=1.4, label=label)


def draw(plot: Callable[[Figure, Any], Any], subject: Any, width: float, height: float) -> str | None:
    """SVG text of a picture for a page, whose colours it takes, or None when there is nothing to draw."""
    made = picture(plot, subject, width, height)
    return made and _for_page(made._repr_svg_())


def _for_page(svg: str) -> str:
    """The picture with the colours of the page, a tenth of a point exact, without what a browser does not need."""

    def in_group(group: re.Match) -> str:  # marks of one style, which then stands once
        styles = set(re.findall(r' style="[^"]*"', group[2]))
        shared = styles.pop() if len(styles) == 1 else ""
        return f"{group[1]}{shared}>{group[2].replace(shared, '')}</g>" if shared else group[0]

    def in_tag(tag: re.Match) -> str:
        text = re.sub(r"\s+", " ", tag[0])
        if "data:image" in text:
            return text
        digits = 2 if " id=" in text else 1  # a mark is small
        text = re.sub(r"(?<!: )-?\d+\.\d+", lambda number: f"{round(float(number[0]), digits):g}", text)
        text = re.sub("#[0-9a-f]{6}", lambda hexes: named.get(hexes[0], hexes[0]), text)
        return text if "<path" not in text else re.sub(r" ?([MLCQzZ]) ?", r"\1", text)

    named = {light: f"var(--{name})" for name, (light, _) in PALETTE.items()}
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r"<[^>]*>", in_tag, svg)
    svg = re.sub(r">\s+<", "><", svg).replace("xlink:href", "href")
    return re.sub(r'(<g(?: clip-path="[^"]*")?)>((?:<use [^>]*>)+)</g>', in_group, svg)


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
