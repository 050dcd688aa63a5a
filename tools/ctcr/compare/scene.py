"""The 3-D view: measured and predicted tips with error arrows."""

import numpy as np

from ctcr.arrays import Integers
from ctcr.compare.analysis import Comparison
from ctcr.show import scene as show
from ctcr.show.style import INK, OUT

MOST_ARROWS = 1500
ARROW_SHARE = 0.12  # of the workspace that a large error (95 %) may fill on the page
HEAD_SHARE = 0.015  # of the workspace that an arrow head is long


def arrow_factor(c: Comparison) -> float:
    """Factor, at least 1, that makes the errors visible."""
    return show.arrow_factor(1e3 * c.headline.measured, c.position_mm.p95, ARROW_SHARE)


def shown_rows(c: Comparison) -> Integers:
    """Rows of the sample that the view shows, evenly spread."""
    return show.evenly(len(c.headline.row), MOST_ARROWS)


def scene(c: Comparison) -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot; positions in mm, tracker frame."""
    rows, factor, sample = shown_rows(c), arrow_factor(c), c.headline
    predicted, measured = sample.predicted[rows] * 1e3, sample.measured[rows] * 1e3
    error = measured - predicted
    size = np.linalg.norm(error, axis=1)
    unit = error / np.maximum(size, 1e-12)[:, None]
    head = predicted + factor * error
    colour = {"colorscale": show.SCALE, "cmin": 0, "cmax": float(max(np.percentile(size, 98), 1e-6))}
    lines = {"mode": "lines", "hoverinfo": "skip", "connectgaps": False}
    lines["line"] = {"width": 4, "color": np.repeat(size, 3).round(3).tolist(), **colour}
    extent = float(np.max(np.ptp(measured, axis=0)))
    cones = {"anchor": "tip", "sizemode": "absolute", "sizeref": HEAD_SHARE * extent, "hoverinfo": "skip"}
    cones |= {"showscale": False, "colorscale": [[0, "#b3361e"], [1, "#b3361e"]]}
    plate = {"mode": "markers", "hoverinfo": "name", "marker": {"size": 6, "symbol": "diamond", "color": INK}}
    bar = {"size": 0.01, "color": [0], **colour, "showscale": True, "colorbar": show.COLOUR_BAR}
    hover = [
        f"row {row}, run {run}: {value:.2f} mm"
        for row, run, value in zip(sample.row[rows], sample.run[rows], size, strict=True)
    ]

    def points(where, name, colour, size):
        marker = {"size": size, "color": colour, "opacity": 0.85}
        return show.trace(where, name, mode="markers", text=hover, hoverinfo="text+name", marker=marker)

    return show.view(
        [
            points(predicted, "predicted", "#8794a0", 1.8),
            points(measured, "measured", OUT, 2.2),
            show.trace(show.shafts(predicted, head), f"error × {factor:g}", **lines),
            show.trace(head, "arrow heads", "cone", **show.columns(unit, "uvw"), **cones),
            show.trace(c.plate_mm[None, :], "front plate (robot file)", **plate),
            # an invisible point carries the colour bar
            show.trace(predicted[:1], mode="markers", showlegend=False, hoverinfo="skip", marker=bar),
        ]
    )
