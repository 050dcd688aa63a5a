"""The pictures of the story at the bench, as SVG text through `html_page.figure`."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from ctcr.arrays import Array
from ctcr.model import simulation
from ctcr.robot.description import Robot
from ctcr.show import scene as show
from ctcr.show.palette import BACK, ERROR, FAINT, GOOD, INK, NOISE, OUT, PALE_BACK, PALE_OUT
from ctcr.table.measurements import Measurements

OURS, SIMULATED = PALE_OUT, PALE_BACK
BOXES = {  # name: x, y, width, colour, text
    "commands": (0.0, 0.5, 2.6, OURS, "ctcr record, ctcr track\nwhat a person types"),
    "reader": (3.6, 1.2, 2.3, OURS, "tracker reader\n40 frames a second"),
    "owner": (3.6, -0.2, 2.3, OURS, "bus owner\na cycle every 4 ms"),
    "aurora": (7.4, 1.2, 2.3, SIMULATED, "Aurora\nsimulated"),
    "terminals": (7.4, -0.2, 2.3, SIMULATED, "EK1100, 6 EL7041\nsimulated"),
    "robot": (10.6, 0.5, 2.0, SIMULATED, "robot\nwith hidden friction"),
}
WIRES = (
    ("commands", "reader", ""),
    ("commands", "owner", ""),
    ("reader", "aurora", "serial line\nBX, CRC"),
    ("owner", "terminals", "EtherCAT\nframes"),
    ("aurora", "robot", ""),
    ("terminals", "robot", ""),
)
HEIGHT = 0.9


def bench(figure: Figure, _) -> None:
    """The processes, and what goes over the wires between them."""
    axes = figure.subplots()
    axes.set(xlim=(-0.1, 12.7), ylim=(-0.75, 2.2))
    axes.axis("off")
    for start, end, text in WIRES:
        (x, y, width, *_), (to_x, to_y, *_) = BOXES[start], BOXES[end]
        axes.plot([x + width, to_x], [y + HEIGHT / 2 - 0.2, to_y + HEIGHT / 2 - 0.2], color=INK, lw=1.2, zorder=0)
        axes.text((x + width + to_x) / 2, y + 0.3, text, ha="center", va="bottom", fontsize=8.5, color=OUT)
    for x, y, width, colour, text in BOXES.values():
        style = {"boxstyle": "round,pad=0,rounding_size=0.12", "facecolor": colour, "edgecolor": INK, "lw": 0.8}
        axes.add_patch(FancyBboxPatch((x, y - 0.2), width, HEIGHT, **style))
        title, below = text.split("\n")
        axes.text(x + width / 2, y + HEIGHT / 2 - 0.04, title, ha="center", weight="bold", fontsize=9)
        axes.text(x + width / 2, y + HEIGHT / 2 - 0.38, below, ha="center", fontsize=8.5)


def out_and_return(figure: Figure, loop: tuple[Measurements, dict[str, Robot]]) -> None:
    """The error of each model along the runs, both ways, in the direction in which the first model errs most.

    `loop`: readings of runs that go out and come back through the same joints, and the models that predict them.
    """
    (table, models), predict = loop, simulation.simulate
    errors = {name: 1e3 * (table.position - predict(robot, table, "none").position) for name, robot in models.items()}
    first = next(iter(errors.values()))
    axis = np.linalg.svd(first - first.mean(axis=0), full_matrices=False)[2][0]
    runs = [run for run in np.unique(table.run) if np.sum(table.run == run) > 2]
    panels = figure.subplots(1, len(errors), sharey=True)
    for axes, (name, error) in zip(panels, errors.items(), strict=True):
        for number, run in enumerate(runs):
            along = error[table.run == run] @ axis
            half = (len(along) + 1) // 2
            stops, out, back = np.arange(half) + number * (half + 1), along[:half], along[-half:][::-1]
            axes.fill_between(stops, out, back, color=FAINT, alpha=0.6, lw=0)
            for values, colour, label in ((out, OUT, "out"), (back, BACK, "back")):
                axes.plot(stops, values, color=colour, marker="o", ms=3.5, label=None if number else label)
        axes.axhline(0, color=NOISE, lw=0.8)
        axes.set(title=name, xlabel="stops of the runs, one after the other", xticks=[])
    panels[0].set_ylabel("error, mm")
    panels[0].legend()


@dataclass(frozen=True)
class Driven:
    """Along the cube with one model, blindly and controlled."""

    corners: Array  # (P, 3) [mm]
    tips: Array  # (P, 3) [mm], of the blind drive
    time: Array  # (R,) [s], of the controlled one
    controlled: Array  # (R,) [mm], its errors

    @property
    def blind(self) -> Array:
        """Errors at the corners (P,) [mm]."""
        return np.linalg.norm(self.tips - self.corners, axis=1)


def tracking(figure: Figure, drives: dict[str, Driven]) -> None:
    """Distance of the tip from the cube: by the model alone, and with the tracker's help."""
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.4))
    for (name, driven), colour in zip(drives.items(), (ERROR, GOOD), strict=True):
        corner = np.arange(len(driven.blind)) + 1
        left.plot(corner, driven.blind, color=colour, marker="o", ms=4, label=f"{name}: {driven.blind.mean():.2f} mm")
        label = f"{name}: {driven.controlled.mean():.2f} mm"
        right.plot(driven.time, driven.controlled, color=colour, lw=1.1, label=label)
    left.set(title="blind: the model alone", xlabel="corners of the tour", ylabel="distance from the cube, mm")
    right.set(title="controlled: the tracker corrects at 40 Hz", xlabel="time along the tour, s")
    for axes in (left, right):
        axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
        axes.legend(title="mean", loc="upper right", fontsize=9, title_fontsize=9)


def scene(drives: dict[str, Driven]) -> str:
    """JSON text for `html_page.view`: the cube and the tips of the blind drives, mm, base frame."""
    layers = [show.layer("line", "cube", next(iter(drives.values())).corners, "noise", 1.6, dashed=True, marked=2)]
    for (name, driven), colour in zip(drives.items(), ("error", "good"), strict=True):
        layers.append(show.layer("line", name, driven.tips, colour, 2.2, marked=3))
    return show.view(layers, (1.3, -1.4, 0.9))
