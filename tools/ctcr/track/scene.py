"""The 3-D view of a scenario: the wanted path, the tip's, and the obstacle, as the JSON that plotly.js draws."""

import json

import numpy as np

from ctcr.compare.scene import MEASURED, PLATE
from ctcr.track.runs import Run
from ctcr.track.scenario import Scenario

MOST_POINTS = 3000
COLOURS = (MEASURED, "#d17a00", "#4b8b3b", "#7a4fa3", "#b3361e", "#6b7785", "#1c2733", "#c2699f")


def scene(runs: list[Run], scenario: Scenario, names: list[str] | None = None) -> str:
    """JSON text {"data", "layout"}; mm, base frame. `names` of the runs; None: one run a weight, named by it."""
    names = names or [f"{run.mass_g:g} g" for run in runs]
    data = [_line(1e3 * runs[0].wanted, "wanted", "#8794a0", 3, "dash")]
    for run, name, colour in zip(runs, names, COLOURS * 3, strict=False):
        if run.started:
            failed = " (failed)" if run.failed else ""
            data.append(_line(1e3 * run.tip, name + failed, colour, 4, "solid"))
    if scenario.obstacle:
        data.append(_ball(np.array(scenario.obstacle.centre_mm), scenario.obstacle.radius_mm))
    data.append(
        {
            "type": "scatter3d",
            "mode": "markers",
            "name": "front plate",
            "x": [0],
            "y": [0],
            "z": [0],
            "visible": "legendonly",
            "marker": {"size": 6, "symbol": "diamond", "color": PLATE},
        }
    )
    axis = {"backgroundcolor": "#ffffff", "gridcolor": "#e1e6ea", "zerolinecolor": "#c9d1d9"}
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "#ffffff",
        "font": {"family": "system-ui, sans-serif", "color": "#1c2733"},
        "legend": {"orientation": "h", "y": 0, "x": 0},
        "scene": {
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.4, "y": -1.62, "z": 0.86}},
            **{f"{name}axis": {**axis, "title": {"text": f"{name}, mm"}} for name in "xyz"},
        },
    }
    return json.dumps({"data": data, "layout": layout}, separators=(",", ":"), allow_nan=False)


def _line(points: np.ndarray, name: str, colour: str, width: int, dash: str) -> dict:
    shown = points[:: max(1, len(points) // MOST_POINTS)]
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": name,
        "hoverinfo": "name",
        **{axis: np.round(shown[:, k], 3).tolist() for k, axis in enumerate("xyz")},
        "line": {"color": colour, "width": width, "dash": dash},
    }


def _ball(centre: np.ndarray, radius: float) -> dict:
    around, down = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    unit = np.stack([np.cos(around) * np.sin(down), np.sin(around) * np.sin(down), np.cos(down)])
    ball = np.round(centre[:, None, None] + radius * unit, 3)
    return {
        "type": "surface",
        "name": "obstacle",
        "showscale": False,
        "showlegend": True,
        "hoverinfo": "name",
        "x": ball[0].tolist(),
        "y": ball[1].tolist(),
        "z": ball[2].tolist(),
        "colorscale": [[0, "#b3361e"], [1, "#b3361e"]],
        "opacity": 0.6,
    }
