"""The 3-D view: measured and predicted tips with error arrows, as the JSON that plotly.js draws."""

import json

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.analysis import Comparison

Array = NDArray[np.float64]
MOST_ARROWS = 1500
ARROW_SHARE = 0.12  # of the workspace that a large error (95 %) may fill on the page
MEASURED, PREDICTED, PLATE = "#0b6e99", "#8794a0", "#1c2733"
SCALE = [[0, "#f3c623"], [0.5, "#e0662b"], [1, "#8c1d18"]]


def arrow_factor(c: Comparison) -> float:
    """Factor, 1, 2 or 5 times a power of ten and at least 1, that makes the errors visible."""
    size = float(np.max(np.ptp(c.headline.measured, axis=0))) * 1e3
    wanted = ARROW_SHARE * size / max(c.position_mm.p95, 1e-9)
    if wanted <= 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted))


def shown_rows(c: Comparison) -> NDArray[np.int64]:
    """Rows of the sample that the view shows, evenly spread."""
    count = len(c.headline.row)
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ARROWS)).astype(np.int64))


def scene(c: Comparison) -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot; positions in mm, tracker frame."""
    rows, factor = shown_rows(c), arrow_factor(c)
    predicted, measured = c.headline.predicted[rows] * 1e3, c.headline.measured[rows] * 1e3
    error = measured - predicted
    size = np.linalg.norm(error, axis=1)
    top = float(max(np.percentile(size, 98), 1e-6))
    hover = [
        f"row {row}, run {run}: {value:.2f} mm"
        for row, run, value in zip(c.headline.row[rows], c.headline.run[rows], size, strict=True)
    ]
    head = predicted + factor * error
    shafts = np.full((3 * len(rows), 3), np.nan)
    shafts[0::3], shafts[1::3] = predicted, head
    paint = np.repeat(size, 3)
    data = [
        _points(predicted, "predicted", PREDICTED, 1.8, hover),
        _points(measured, "measured", MEASURED, 2.2, hover),
        {
            "type": "scatter3d",
            "mode": "lines",
            "name": f"error × {factor:g}",
            "hoverinfo": "skip",
            **_xyz(shafts),
            "connectgaps": False,
            "line": {"width": 4, "color": _numbers(paint), "colorscale": SCALE, "cmin": 0, "cmax": top},
        },
        {
            "type": "cone",
            "name": "arrow heads",
            "anchor": "tip",
            "sizemode": "absolute",
            "hoverinfo": "skip",
            "sizeref": _head_size(measured),
            **_xyz(head),
            **_unit(error),
            "showscale": False,
            "colorscale": [[0, "#b3361e"], [1, "#b3361e"]],
        },
        {
            "type": "scatter3d",
            "mode": "markers",
            "name": "front plate (robot file)",
            "hoverinfo": "name",
            **_xyz(c.plate_mm[None, :]),
            "marker": {"size": 6, "symbol": "diamond", "color": PLATE},
        },
        {
            "type": "scatter3d",
            "mode": "markers",
            "showlegend": False,
            "hoverinfo": "skip",
            **_xyz(predicted[:1]),
            "marker": {
                "size": 0.01,
                "color": [0],
                "colorscale": SCALE,
                "cmin": 0,
                "cmax": top,
                "showscale": True,
                "colorbar": {"title": {"text": "error, mm"}, "len": 0.6, "thickness": 12},
            },
        },
    ]
    axis = {"backgroundcolor": "#ffffff", "gridcolor": "#e1e6ea", "zerolinecolor": "#c9d1d9"}
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "#ffffff",
        "font": {"family": "system-ui, sans-serif", "color": "#1c2733"},
        "legend": {"orientation": "h", "y": 0, "x": 0, "itemsizing": "constant"},
        "scene": {
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.4, "y": 1.4, "z": 0.8}},
            **{f"{name}axis": {**axis, "title": {"text": f"{name}, mm"}} for name in "xyz"},
        },
    }
    return json.dumps({"data": data, "layout": layout}, separators=(",", ":"), allow_nan=False)


def _points(points: Array, name: str, colour: str, size: float, hover: list[str]) -> dict:
    return {
        "type": "scatter3d",
        "mode": "markers",
        "name": name,
        "text": hover,
        "hoverinfo": "text+name",
        **_xyz(points),
        "marker": {"size": size, "color": colour, "opacity": 0.85},
    }


def _xyz(points: Array) -> dict:
    return {name: _numbers(column) for name, column in zip("xyz", points.T, strict=True)}


def _unit(vectors: Array) -> dict:
    unit = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return {name: _numbers(column) for name, column in zip("uvw", unit.T, strict=True)}


def _numbers(values: Array) -> list:
    return [round(float(value), 3) if np.isfinite(value) else None for value in values]


def _head_size(points: Array) -> float:
    return float(np.max(np.ptp(points, axis=0))) * 0.015
