"""The 3-D view: the error of every reading as an arrow, before and after the fit."""

import numpy as np

from ctcr.calibrate.joint_fit import Calibration
from ctcr.show import scene
from ctcr.show.style import OUT

MOST_ARROWS = 1200
ARROW_SHARE = 0.1  # of the workspace that a large error (95 %) may fill on the page


def view(c: Calibration) -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot, in mm, tracker frame. Buttons choose before or after."""
    measured = 1e3 * c.readings.position
    states = {"robot file": 1e3 * c.fit.nominal_residual[:, :3], "calibrated": 1e3 * c.fit.residual[:, :3]}
    known = np.flatnonzero(np.isfinite(np.hstack([measured, *states.values()])).all(axis=1))
    rows = known[scene.evenly(len(known), MOST_ARROWS)]
    data, labels = [], []
    for name, error in states.items():
        error = error[rows]
        size = np.linalg.norm(error, axis=1)
        factor = scene.arrow_factor(measured[rows], float(np.percentile(size, 95)), ARROW_SHARE)
        tail = measured[rows] - error
        hover = [
            f"row {row}, run {run}: {value:.2f} mm"
            for row, run, value in zip(c.readings.row[rows], c.readings.run[rows], size, strict=True)
        ]
        shown = {"visible": name == "calibrated", "showlegend": False}
        shaft = {
            "width": 4,
            "color": np.repeat(size, 3).round(3).tolist(),
            "colorscale": scene.SCALE,
            "cmin": 0,
            "cmax": max(float(np.percentile(size, 98)), 1e-6),
            "showscale": True,
            "colorbar": scene.COLOUR_BAR,
        }
        line = {"mode": "lines", "hoverinfo": "skip", "connectgaps": False, "line": shaft}
        marker = {"size": 2, "color": OUT, "opacity": 0.8}
        data += [
            scene.trace(scene.shafts(tail, tail + factor * error), "error", **line, **shown),
            scene.trace(
                measured[rows], "measured", mode="markers", text=hover, hoverinfo="text", marker=marker, **shown
            ),
        ]
        labels.append(f"{name} (arrows × {factor:g})")
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": [i // 2 == number for i in range(len(data))]}]}
        for number, label in enumerate(labels)
    ]
    menu = {"type": "buttons", "direction": "right", "buttons": buttons, "active": 1, "bgcolor": "#f6f8fa"}
    menu |= {"x": 0.01, "y": 0.99, "xanchor": "left", "yanchor": "top"}
    return scene.view(data, eye=(1.3, 1.3, 0.7), updatemenus=[menu])
