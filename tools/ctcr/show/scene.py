"""3-D views of a report, as the JSON that html_page.js draws: layers of points, lines, arrows and balls in mm."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ctcr.arrays import Array

DIGITS = 3  # after the point: a micrometre


def layer(kind: str, name: str, points: Array, colour: str = "", size: float = 2, **more: Any) -> dict:
    """A layer that a click on its name hides.

    kind      points, line (through the points; NaN breaks it), arrows (from the points to `to`) or ball (of `radius`)
    points    (K, 3) [mm]
    colour    a name of the palette; without it `value` (K,) colours each point, by the scale of the view
    size      radius of a point or width of a line [px]
    more      to: heads (K, 3); radius [mm]; dashed; marked: radius of a mark on each point [px]; hidden at first;
              hover: {name: value of each point} to show under the pointer; choice: drawn with this choice alone
    """
    if "to" in more:
        more["to"] = _columns(more["to"])
    return {"kind": kind, "name": name, "colour": colour, "size": size, **_columns(points), **more}


def numbers(values: Array) -> list[float | None]:
    """Values (K,) as JSON, null where not finite."""
    return [round(float(v), DIGITS) if np.isfinite(v) else None for v in values]


def _columns(vectors: Array) -> dict[str, list[float | None]]:
    return {name: numbers(column) for name, column in zip("xyz", vectors.T, strict=True)}


def most(errors: Array) -> float:
    """The end of a scale of colours for errors (K,) [mm]: the largest, but for two in a hundred."""
    return max(float(f"{np.percentile(errors, 98):.2g}"), 10.0**-DIGITS)


def arrow_factor(points: Array, length: float, share: float) -> float:
    """1, 2 or 5 times a power of ten, at least 1: an arrow of this length then fills `share` of the points' extent."""
    wanted = share * float(np.max(np.ptp(points, axis=0))) / max(length, 1e-9)
    if wanted <= 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted))


def view(
    layers: list[dict], eye: tuple[float, float, float] = (1.4, 1.4, 0.8), most: float = 0, choices: Sequence[str] = ()
) -> str:
    """JSON text for `html_page.view`, seen from the direction `eye`.

    most       error at the end of the scale of colours [mm]; 0: no layer has values
    choices    names; one of them is chosen at a time, the last at first
    """
    scale = {"scale": {"title": "error, mm", "most": most}} if most else {}
    drawing = {"eye": eye, **scale, "choices": choices, "layers": layers}
    return json.dumps(drawing, separators=(",", ":"), allow_nan=False)
