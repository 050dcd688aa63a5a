"""3-D views of a report, as the JSON that plotly.js draws."""

import json

import numpy as np

from ctcr.arrays import Array
from ctcr.show.style import INK

SCALE = [[0, "#f3c623"], [0.5, "#e0662b"], [1, "#8c1d18"]]  # of an error, from small to large
COLOUR_BAR = {"title": {"text": "error, mm"}, "len": 0.6, "thickness": 12}


def trace(points: Array, name: str = "", kind: str = "scatter3d", **style) -> dict:
    """A trace of points (K, 3); NaN breaks a line. `style` as plotly.js takes it."""
    return {"type": kind, **columns(points), **({"name": name} if name else {}), **style}


def columns(vectors: Array, names: str = "xyz") -> dict[str, list[float | None]]:
    """Vectors (K, 3) as lists of three digits after the point, null where not finite."""
    rounded = [[round(float(v), 3) if np.isfinite(v) else None for v in column] for column in vectors.T]
    return dict(zip(names, rounded, strict=True))


def shafts(tail: Array, head: Array) -> Array:
    """Lines (3 K, 3) from each tail to its head (K, 3), with a break after each."""
    lines = np.full((3 * len(tail), 3), np.nan)
    lines[0::3], lines[1::3] = tail, head
    return lines


def arrow_factor(points: Array, length: float, share: float) -> float:
    """1, 2 or 5 times a power of ten, at least 1: an arrow of this length then fills `share` of the points' extent."""
    wanted = share * float(np.max(np.ptp(points, axis=0))) / max(length, 1e-9)
    if wanted <= 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted))


def view(data: list[dict], eye: tuple[float, float, float] = (1.4, 1.4, 0.8), **layout) -> str:
    """JSON text {"data", "layout"} for Plotly.newPlot with equal axes in mm, seen from `eye`."""
    axis = {"backgroundcolor": "#ffffff", "gridcolor": "#e1e6ea", "zerolinecolor": "#c9d1d9"}
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "#ffffff",
        "font": {"family": "system-ui, sans-serif", "color": INK},
        "legend": {"orientation": "h", "y": 0, "x": 0, "itemsizing": "constant"},
        "scene": {
            "aspectmode": "data",
            "camera": {"eye": dict(zip("xyz", eye, strict=True))},
            **{f"{name}axis": {**axis, "title": {"text": f"{name}, mm"}} for name in "xyz"},
        },
        **layout,
    }
    return json.dumps({"data": data, "layout": layout}, separators=(",", ":"), allow_nan=False)
