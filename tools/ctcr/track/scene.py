"""The 3-D view of a scenario: the wanted path, the tip's, and the obstacle."""

import numpy as np

from ctcr.show import scene as show
from ctcr.show.style import INK, OUT
from ctcr.track.result import Run
from ctcr.track.scenario import Scenario

MOST_POINTS = 3000
COLOURS = (OUT, "#d17a00", "#4b8b3b", "#7a4fa3", "#b3361e", "#6b7785", "#1c2733", "#c2699f")


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
    plate = {"mode": "markers", "visible": "legendonly", "marker": {"size": 6, "symbol": "diamond", "color": INK}}
    data.append(show.trace(np.zeros((1, 3)), "front plate", **plate))
    return show.view(data, eye=(1.4, -1.62, 0.86), legend={"orientation": "h", "y": 0, "x": 0})


def _line(points: np.ndarray, name: str, colour: str, width: int, dash: str) -> dict:
    shown = points[:: max(1, len(points) // MOST_POINTS)]
    return show.trace(shown, name, mode="lines", hoverinfo="name", line={"color": colour, "width": width, "dash": dash})


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
