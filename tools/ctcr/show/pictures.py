"""A picture of the robot: the tubes as they lie in space, true to scale."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ctcr.arrays import Array
from ctcr.show.output import atomic_writer
from ctcr.show.wording import visible

TUBE_COLOURS = ("#e8871e", "#3f8fc4", "#6b7a8f", "#3d4757")  # innermost first; apart for colour-blind eyes too
AXIS_COLOURS = ("#c0392b", "#27934b", "#2255aa")
FORCE_COLOUR = "#a3127a"
OTHER_COLOUR = "#27313d"
_SIDES = 20  # facets around a tube


def draw_robot(
    path: str | Path,
    robot,
    arc_length: Array,
    position: Array,
    rotation: Array,
    tube_ends: Array,
    force: Array | None = None,
    title: str = "",
    others: Sequence[Array] = (),
) -> None:
    """Writes a picture in the format of the ending of `path`: .png (or none), .svg or .pdf.

    The backbone in the base frame: `arc_length` (P,) from the front plate [m], `position` (P, 3) [m], `rotation`
    (P, 3, 3), z along the tangent. `tube_ends` (N,): arc length of the tips [m], innermost first. `force` (3,) at the
    tip [N], base frame. `others`, each (P, 3) [m]: backbones of other equilibria, as dashed lines numbered from 2 on.
    """
    figure = Figure(figsize=(8, 8), dpi=200, facecolor="white")
    axes = figure.add_axes((0.10, 0.02, 0.88, 0.94), projection="3d", computed_zorder=False)
    centre = 1e3 * position
    frames = np.tile(np.eye(4), (len(centre), 1, 1))
    frames[:, :3, :3], frames[:, :3, 3] = rotation, centre
    reach = max(np.ptp(centre, axis=0).max(), 20.0)
    dashed = [1e3 * other for other in others]
    lamp = _stage(axes, np.concatenate([centre, *dashed]), 0.24 * reach)
    _draw_plate(axes, 0.09 * reach)
    _draw_shadow(axes, centre)
    _draw_triad(axes, np.eye(4), 0.16 * reach, labels=True)
    _draw_tubes(axes, robot, 1e3 * arc_length, frames, 1e3 * tube_ends, lamp)
    _draw_triad(axes, frames[-1], 0.09 * reach)
    for number, line in enumerate(dashed, start=2):
        _draw_shadow(axes, line)
        axes.plot(*line.T, color=OTHER_COLOUR, linestyle=(0, (4, 2)), linewidth=1.6, zorder=6)
        axes.text(*line[-1], f" {number}", color=OTHER_COLOUR, fontsize=11, fontweight="bold", zorder=6)
    if force is not None and np.linalg.norm(force) > 0:
        _draw_force(axes, centre[-1], force, 0.22 * reach)
    _explain(figure, robot, 1e3 * tube_ends, title)
    FigureCanvasAgg(figure)
    with atomic_writer(path, binary=True) as file:
        figure.savefig(file, format=Path(path).suffix[1:] or "png")


def _stage(axes, centre: Array, margin: float) -> Array:
    """Equal axes around the robot, seen nearly square to the plane in which it bends most; returns the lamp."""
    lateral = centre[:, :2] - centre[0, :2]
    across = np.linalg.svd(lateral, full_matrices=False)[2][0]
    across *= 1 if across @ lateral[-1] >= 0 else -1  # the tip lies to the right
    azimuth, elevation = np.arctan2(across[1], across[0]) - np.radians(65), np.radians(14)
    axes.view_init(elev=np.degrees(elevation), azim=np.degrees(azimuth))
    low, high = centre.min(axis=0) - margin, centre.max(axis=0) + margin
    low[2] = min(0.0, centre[:, 2].min())
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=0.98)
    axes.set_proj_type("persp", focal_length=1.6)
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y"), (axes.zaxis, "z")):
        axis.set_pane_color((0.965, 0.970, 0.978, 1.0))
        axis.line.set_color("#b8c0cc")
        axis._axinfo["grid"].update(color="#dde2ea", linewidth=0.6)
        axis.set_major_locator(MultipleLocator(20 if max(high - low) < 250 else 50))
        axis.set_label_text(f"{name} [mm]", color="#55606e", fontsize=9)
        axis.set_tick_params(labelsize=7.5, labelcolor="#55606e", color="#b8c0cc")
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    lamp = 0.75 * towards - 0.55 * right + 0.35 * np.cross(towards, right)
    return lamp / np.linalg.norm(lamp)


def _draw_tubes(axes, robot, arc_length: Array, frames: Array, ends: Array, lamp: Array) -> None:
    """The visible part of each tube: from the end of the next outer tube to its own tip."""
    faces, colours = [], []
    for tube, colour, start, end in zip(robot.tubes, TUBE_COLOURS, [*ends[1:], 0.0], ends, strict=False):
        s = np.unique([start, *arc_length[(arc_length > start) & (arc_length < end)], end])
        if s[-1] - s[0] < 1e-6:
            continue
        # where the file gives no diameters, the radius tells the tubes apart
        radius = 500 * tube.outer_diameter or 0.6 + 0.3 * TUBE_COLOURS.index(colour)
        quads, normals = _surface(_at(arc_length, frames, s), radius)
        faces.append(quads)
        colours.append(_lit(colour, normals @ lamp))
    if faces:
        colour = np.concatenate(colours)  # edges of the same colour close the seams between the facets
        style = {"facecolors": colour, "edgecolors": colour, "linewidths": 0.3, "zorder": 4}
        axes.add_collection3d(Poly3DCollection(np.concatenate(faces), **style))


def _at(arc_length: Array, frames: Array, s: Array) -> Array:
    """Frames at arc lengths s: the points interpolated, the axes of the nearest sample."""
    nearest = np.abs(arc_length[:, None] - s).argmin(axis=0)
    at = frames[nearest].copy()
    for k in range(3):
        at[:, k, 3] = np.interp(s, arc_length, frames[:, k, 3])
    return at


def _surface(frames: Array, radius: float) -> tuple[Array, Array]:
    """Quadrilaterals (Q, 4, 3) of a tube and their outward normals (Q, 3); the far end is closed."""
    angle = np.linspace(0, 2 * np.pi, _SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    outward = np.moveaxis(frames[:, :3, :3] @ ring, 1, 2)  # (P, sides + 1, 3)
    points = frames[:, None, :3, 3] + radius * outward
    quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    normals = (outward[:-1, :-1] + outward[:-1, 1:]) / 2
    tip = np.broadcast_to(frames[-1, :3, 3], (_SIDES, 3))
    cap = np.stack([tip, points[-1, :-1], points[-1, 1:], tip], axis=1)
    cap_normals = np.broadcast_to(frames[-1, :3, 2], (_SIDES, 3))
    return (np.concatenate([quads.reshape(-1, 4, 3), cap]), np.concatenate([normals.reshape(-1, 3), cap_normals]))


def _lit(colour: str, facing: Array) -> Array:
    """Colours (Q, 4) of brushed metal; `facing` (Q,) is the cosine between normal and lamp."""
    diffuse = 0.72 + 0.33 * facing[:, None]
    gloss = 0.6 * np.clip(facing[:, None], 0, None) ** 10
    rgb = np.clip(np.array(to_rgb(colour)) * diffuse, 0, 1)
    return np.hstack([rgb + (1 - rgb) * gloss, np.ones((len(rgb), 1))])


def _draw_shadow(axes, centre: Array) -> None:
    """The projection on the plane of the plate, and the line of a straight robot."""
    axes.plot(centre[:, 0], centre[:, 1], np.zeros(len(centre)), color="#9aa5b5", linewidth=3, alpha=0.55)
    top = max(centre[-1, 2], 0.0)
    axes.plot([0, 0], [0, 0], [0, top], color="#8792a2", linewidth=0.9, linestyle=(0, (5, 4)))
    axes.text(0, 0, 1.02 * top, "z", color=AXIS_COLOURS[2], fontsize=10, fontweight="bold", ha="center")
    axes.plot([centre[-1, 0]] * 2, [centre[-1, 1]] * 2, [0, top], color="#b8c0cc", linewidth=0.8, linestyle=(0, (1, 2)))


def _draw_plate(axes, radius: float) -> None:
    """The front plate, where the tubes leave."""
    angle = np.linspace(0, 2 * np.pi, 60)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros_like(angle)], axis=1)
    axes.add_collection3d(Poly3DCollection([rim], facecolors="#aab4c255", edgecolors="#8792a2", linewidths=0.8))


def _draw_triad(axes, frame: Array, size: float, labels: bool = False) -> None:
    for k, (name, colour) in enumerate(zip("xyz", AXIS_COLOURS, strict=True)):
        tip = frame[:3, 3] + size * frame[:3, k]
        axes.quiver(*frame[:3, 3], *(size * frame[:3, k]), color=colour, linewidth=1.6, arrow_length_ratio=0.16)
        if labels and name != "z":  # the tubes hide the z arrow; its line is labelled at its end
            axes.text(*(tip + 0.12 * size * frame[:3, k]), name, color=colour, fontsize=10, fontweight="bold")


def _draw_force(axes, tip: Array, force: Array, size: float) -> None:
    arrow = size * force / np.linalg.norm(force)
    axes.quiver(*tip, *arrow, color=FORCE_COLOUR, linewidth=2.4, arrow_length_ratio=0.18, zorder=6)
    text = f"{np.linalg.norm(force):.3g} N"
    axes.text(*(tip + 1.12 * arrow), text, color=FORCE_COLOUR, fontsize=10, fontweight="bold")


def _explain(figure, robot, ends: Array, title: str) -> None:
    handles = []
    for i, tube in enumerate(robot.tubes):
        width = f", {tube.outer_diameter_mm:g} mm wide" if tube.outer_diameter_mm else ""
        label = f"tube {i + 1}: {ends[i]:.1f} mm out{width}"
        handles.append(Line2D([], [], color=TUBE_COLOURS[i], linewidth=3 + 1.2 * i, label=label))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.025, 0.865), frameon=False, fontsize=10)
    figure.text(
        0.035, 0.955, visible(robot.name), parse_math=False, fontsize=15, fontweight="bold", color="#2b3440", va="top"
    )
    figure.text(0.035, 0.915, title, fontsize=9.5, color="#55606e", va="top", linespacing=1.4)
