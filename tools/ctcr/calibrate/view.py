"""The 3-D view: the error of every reading as an arrow, before and after, as the JSON that plotly.js draws."""

import json

import numpy as np
from numpy.typing import NDArray

from ctcr.calibrate.joint_fit import Calibration

Array = NDArray[np.float64]
MOST_ARROWS = 1200
ARROW_SHARE = 0.1  # of the workspace that a large error (95 %) may fill on the page
MEASURED = "#0b6e99"
SCALE = [[0, "#f3c623"], [0.5, "#e0662b"], [1, "#8c1d18"]]


def view(c: Calibration) -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot, in mm, tracker frame. Buttons choose before or after."""
    measured = 1e3 * c.readings.position
    states = [("robot file", 1e3 * c.fit.nominal_residual[:, :3]), ("calibrated", 1e3 * c.fit.residual[:, :3])]
    known = np.flatnonzero(np.isfinite(np.hstack([measured, *(error for _, error in states)])).all(axis=1))
    rows = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), MOST_ARROWS)).astype(np.int64))]
    data, labels = [], []
    for number, (name, error) in enumerate(states):
        error = error[rows]
        size = np.linalg.norm(error, axis=1)
        factor = _factor(measured[rows], size)
        tail, shafts = measured[rows] - error, np.full((3 * len(rows), 3), np.nan)
        shafts[0::3], shafts[1::3] = tail, tail + factor * error
        top = max(float(np.percentile(size, 98)), 1e-6)
        data.append(
            {
                "type": "scatter3d",
                "mode": "lines",
                "name": "error",
                "hoverinfo": "skip",
                "connectgaps": False,
                **_xyz(shafts),
                "visible": number == 1,
                "showlegend": False,
                "line": {
                    "width": 4,
                    "color": _numbers(np.repeat(size, 3)),
                    "colorscale": SCALE,
                    "cmin": 0,
                    "cmax": top,
                    "showscale": True,
                    "colorbar": {"title": {"text": "error, mm"}, "len": 0.6, "thickness": 12},
                },
            }
        )
        hover = [
            f"row {row}, run {run}: {value:.2f} mm"
            for row, run, value in zip(c.readings.row[rows], c.readings.run[rows], size, strict=True)
        ]
        data.append(
            {
                "type": "scatter3d",
                "mode": "markers",
                "name": "measured",
                "text": hover,
                "hoverinfo": "text",
                "visible": number == 1,
                "showlegend": False,
                **_xyz(measured[rows]),
                "marker": {"size": 2, "color": MEASURED, "opacity": 0.8},
            }
        )
        labels.append(f"{name} (arrows × {factor:g})")
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": [i // 2 == number for i in range(len(data))]}]}
        for number, label in enumerate(labels)
    ]
    axis = {"backgroundcolor": "#ffffff", "gridcolor": "#e1e6ea", "zerolinecolor": "#c9d1d9"}
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "#ffffff",
        "font": {"family": "system-ui, sans-serif", "color": "#1c2733"},
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "right",
                "buttons": buttons,
                "active": 1,
                "x": 0.01,
                "y": 0.99,
                "xanchor": "left",
                "yanchor": "top",
                "bgcolor": "#f6f8fa",
            }
        ],
        "scene": {
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.3, "y": 1.3, "z": 0.7}},
            **{f"{name}axis": {**axis, "title": {"text": f"{name}, mm"}} for name in "xyz"},
        },
    }
    return json.dumps({"data": data, "layout": layout}, separators=(",", ":"), allow_nan=False)


def _factor(points: Array, size: Array) -> float:
    """1, 2 or 5 times a power of ten, at least 1, that makes the errors visible."""
    wanted = ARROW_SHARE * float(np.max(np.ptp(points, axis=0))) / max(float(np.percentile(size, 95)), 1e-9)
    if wanted <= 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted))


def _xyz(points: Array) -> dict:
    return {name: _numbers(column) for name, column in zip("xyz", points.T, strict=True)}


def _numbers(values: Array) -> list:
    return [round(float(value), 3) if np.isfinite(value) else None for value in values]
