"""The pictures of the procedures that measure one quantity each: readings, fit and residuals."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ctcr.arrays import Array, Mask, evenly
from ctcr.show import scene
from ctcr.show.palette import BACK, ERROR, FAINT, INK, NOISE, OUT, TINT
from ctcr.table.measurements import Measurements

WIDTH, ROW_HEIGHT = 10.4, 3.6
LONGEST_ARROW = 0.15  # of the size of the picture
MOST_ARROWS = 800


@dataclass(frozen=True)
class Circle:
    """Readings of one tube on the circle that was fitted to them."""

    name: str
    position: Array  # (K, 3) [m], in the frame of the circle
    angle: Array  # (K,) of the tube, without its offset [rad]
    forward: Mask  # (K,)
    fit: Any  # of the core: its centre (3,) [m], normal (3,), radius [m] and outliers

    @property
    def used(self) -> Mask:
        return ~np.isin(np.arange(len(self.angle)), self.fit.outliers)

    def in_plane(self) -> Array:
        """The readings from the centre (K, 2) [mm]."""
        normal = self.fit.normal
        first = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
        first /= np.linalg.norm(first)
        return 1e3 * (self.position - self.fit.centre) @ np.column_stack([first, np.cross(normal, first)])

    def behind(self) -> Array:
        """Angle of the tip less a constant offset from its motor (K,) [deg]."""
        x, y = self.in_plane().T
        seen = np.arctan2(y, x)
        off = [np.angle(np.exp(1j * (sign * seen - self.angle))) for sign in (1, -1)]
        off = max(off, key=lambda o: abs(np.mean(np.exp(1j * o[self.used]))))
        return np.degrees(np.angle(np.exp(1j * off) / np.mean(np.exp(1j * off[self.used]))))


def circles(figure, found: list[Circle]) -> None:
    """The readings of each tube on its circle, and the lag of its tip behind its motor."""
    panels = figure.subplots(len(found), 2, width_ratios=(1, 1.6), squeeze=False)
    turn = np.linspace(0, 2 * np.pi, 200)
    for (left, right), circle in zip(panels, found, strict=True):
        around, off = circle.in_plane(), circle.behind()
        radius = 1e3 * circle.fit.radius
        left.plot(radius * np.cos(turn), radius * np.sin(turn), color=NOISE, lw=1)
        left.plot(0, 0, "+", color=NOISE)
        for way, colour, label in ((True, OUT, "forward"), (False, BACK, "backward")):
            mine = (circle.forward == way) & circle.used
            left.plot(*around[mine].T, ".", color=colour, ms=4)
            right.plot(np.degrees(circle.angle[mine]), off[mine], ".", color=colour, ms=4, label=label)
            if mine.any():
                right.axhline(off[mine].mean(), color=colour, lw=1)
        left.plot(*around[~circle.used].T, "x", color=ERROR)
        left.set(aspect="equal", xlabel="in the plane of the circle, mm", ylabel="mm", title=circle.name)
        right.set(xlabel="angle of the tube by its motor, deg", ylabel="the tip's angle against it, deg")
        right.legend(fontsize=9)


def points(figure, found: tuple[Array, Any]) -> None:
    """The residual at each point of a registration: CAD points (K, 3) [mm], base frame, and the fit."""
    cad, fit = found
    names, residual = list(fit.names), 1e3 * fit.residuals @ fit.T_ref[:3, :3]
    outlier = np.isin(names, fit.outliers)
    left, right = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    size, kept = np.linalg.norm(residual, axis=1), ~outlier
    scale = LONGEST_ARROW * np.ptp(cad, axis=0).max() / max(size[kept].max(), 1e-9)
    colours = np.where(outlier, ERROR, OUT)
    left.scatter(*cad.T, c=colours, s=18, depthshade=False)
    left.quiver(*cad[kept].T, *(scale * residual[kept]).T, color=INK, lw=1)
    for name, at in zip(names, cad, strict=True):
        left.text(*at, f"  {name}", fontsize=8, color=NOISE)
    left.set(aspect="equal", xlabel="x (base), mm", ylabel="y (base), mm", zlabel="z (base), mm")
    left.set_title(f"residuals, {scale:.0f} times as long")
    left.tick_params(labelsize=7)
    right.barh(range(len(names)), size, color=colours, height=0.6)
    right.set_yticks(range(len(names)), names, fontsize=8)
    right.invert_yaxis()
    right.set(xlabel="distance between CAD and reading, mm", title="residual (red: excluded)")
    right.grid(axis="y", visible=False)


def frame_scene(readings: Measurements, predicted: Array, frames: dict[str, Any]) -> tuple[str, str]:
    """Base frames by name, the last of them found, with the tips that they predict: the JSON of a view, its caption.

    `predicted` (M, 3) [m], base frame; `frames` as the `tracker` of robots.
    """
    known = np.flatnonzero(np.isfinite(predicted + readings.positions).all(axis=1))
    rows = known[evenly(len(known), MOST_ARROWS)]
    measured = 1e3 * readings.positions[rows]
    tips = {name: 1e3 * (predicted[rows] @ f.rotation.T + f.position) for name, f in frames.items()}
    sizes = {name: np.linalg.norm(measured - tip, axis=1) for name, tip in tips.items()}
    found = list(frames)[-1]
    hover = {"row": readings.row[rows].tolist(), "run": readings.run[rows].tolist()}
    hover |= {f"error, {name}, mm": scene.numbers(size) for name, size in sizes.items()}
    factor = scene.arrow_factor(measured, float(np.percentile(sizes[found], 95)), LONGEST_ARROW)
    layers = [scene.layer("points", "measured", measured, "out", hover=hover)]
    for (name, f), colour in zip(frames.items(), ("error", "good"), strict=True):
        origin = np.tile(1e3 * f.position, (3, 1))
        axes = origin + 2 * LONGEST_ARROW * np.ptp(measured, axis=0).max() * f.rotation.T
        layers.append(scene.layer("arrows", f"base frame, {name}", origin, colour, 2.5, to=axes))
    to = tips[found] + factor * (measured - tips[found])
    layers.append(scene.layer("arrows", f"error, {found}, × {factor:g}", tips[found], "back", 1.4, to=to))
    layers.append(scene.layer("points", "predicted, robot file", tips["robot file"], "error", hidden=True))
    caption = (
        "The base frame, x, y and z, by the robot file and as found, with the tips; tracker frame. Arrows at the tips "
        f"lead from the predicted towards the measured one, drawn {factor:g} times as long as they are."
    )
    return scene.view(layers, (1.3, 1.3, 0.7)), caption


def homes(figure, found: tuple[list[int], Array, Array, Array, Array]) -> None:
    """The tubes at home: grasped points and tips (N,) [mm], standard deviations and old values (N, 2), NaN: none."""
    tubes, grasped, tip, sd, old = found
    axes = figure.subplots()
    axes.axvspan(0, max(5.0, 1.25 * tip.max()), color=TINT, lw=0)
    axes.axvline(0, color=INK, lw=1.5)
    for row in range(len(tubes)):
        ends = (grasped[row], tip[row])
        axes.plot(ends, [row, row], color=OUT, lw=5, solid_capstyle="butt")
        axes.errorbar(ends, [row, row], xerr=2 * sd[row], color=INK, capsize=4, lw=0, elinewidth=1)
        axes.plot(old[row], [row + 0.25] * 2, "|-", color=NOISE, lw=1, ms=9)
        axes.annotate(f"{tip[row]:.1f} mm", (tip[row], row), (7, -3), textcoords="offset points", fontsize=9)
    axes.set_yticks(range(len(tubes)), [f"tube {tube}" for tube in tubes])
    axes.invert_yaxis()
    axes.set(xlabel="from the front plate, mm (shaded: outside)", ylim=(len(tubes) - 0.5, -0.6))
    axes.grid(axis="y", visible=False)


def deflections(figure, found: tuple[Array, Array, Array]) -> None:
    """A cantilever: load [N], deflection read and fitted [mm] of each row (K,)."""
    load, read, fitted = found
    left, right = figure.subplots(1, 2)
    order = np.argsort(load)
    left.plot(load[order], fitted[order], color=NOISE, lw=1.2, label="fitted")
    left.plot(load, read, "o", color=OUT, ms=4.5, label="read")
    left.set(xlabel="load, N", ylabel="deflection of the free end, mm")
    left.legend(fontsize=9)
    right.axhline(0, color=NOISE, lw=1)
    right.plot(load, read - fitted, "o", color=OUT, ms=4.5)
    right.set(xlabel="load, N", ylabel="read minus fitted, mm")


def outline(figure, found: tuple[Array, Array, Array, float, list[int]]) -> None:
    """The picture of a tube: points (K, 2), where the curve starts and ends (2,), its angle [rad], and outliers."""
    clicked, junction, tip, bend, outliers = found
    axes = figure.subplots()
    chord = tip - junction
    half, length = 0.5 * chord, float(np.linalg.norm(chord))
    radius = 0.5 * length / abs(np.sin(0.5 * bend))
    across = np.array([-chord[1], chord[0]]) / length
    height = np.sqrt(max(radius**2 - (0.5 * length) ** 2, 0.0))
    # Of the four arcs of that radius through both ends, the one that the points follow.
    arcs = [_arc(junction, tip, junction + half + side * height * across, long) for side in (1, -1) for long in (0, 1)]
    arc = min(arcs, key=lambda a: np.sum(np.min(np.linalg.norm(a[:, None] - clicked, axis=2), axis=1) ** 2))
    straight = junction - arc[1]
    back = max(0.0, float(((junction - clicked) @ -straight / np.linalg.norm(straight)).max()))
    start = junction + back * straight / np.linalg.norm(straight)
    used = np.setdiff1d(np.arange(len(clicked)), outliers)
    axes.plot(*clicked[used].T, "o", color=FAINT, ms=6, label="points")
    if outliers:
        axes.plot(*clicked[outliers].T, "x", color=ERROR, label="excluded")
    axes.plot(*np.stack([start, junction]).T, color=NOISE, lw=1.6, label="straight part")
    axes.plot(*arc.T, color=OUT, lw=1.6, label="curved part")
    axes.plot(*junction, "|", color=INK, ms=14)
    axes.set(aspect="equal", xlabel="x of the picture", ylabel="y of the picture")
    axes.invert_yaxis()
    axes.legend(fontsize=9)


def _arc(start: Array, end: Array, centre: Array, long: int) -> Array:
    """The shorter or longer arc (200, 2) from start to end about a centre."""
    first, last = (np.arctan2(*(point - centre)[::-1]) for point in (start, end))
    turn = np.angle(np.exp(1j * (last - first)))
    if long:
        turn -= 2 * np.pi * np.sign(turn)
    angle = first + np.linspace(0, 1, 200) * turn
    return centre + np.linalg.norm(start - centre) * np.column_stack([np.cos(angle), np.sin(angle)])
