"""The pictures of a scenario: SVG text through `html_page.figure`, and the 3-D view as JSON."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from ctcr.arrays import Array
from ctcr.robot.description import Robot
from ctcr.show import scene as show
from ctcr.show.palette import AXES, ERROR, FAINT, GOOD, INK, PALE_ERROR, PALE_OUT
from ctcr.track.result import Run, by_mass, errors_mm
from ctcr.track.scenario import TASKS, Scenario

MOST_POINTS = 1000  # of a line of the 3-D view
COLOURS = ("out", "back", "third", "violet", "error", "noise", "ink", "pink")


def box_plot(axes, groups: Mapping[str, Array], colours: Sequence[str], means: bool = True) -> None:
    """Boxes at the quartiles of each group of errors, whiskers to all values, a diamond at the mean."""
    drawn = axes.boxplot(
        list(groups.values()),
        tick_labels=list(groups),
        whis=(0, 100),
        showmeans=means,
        patch_artist=True,
        **{f"{part}props": {"color": INK} for part in ("median", "whisker", "cap", "box")},
        meanprops={"marker": "D", "markersize": 4, "color": GOOD, "markeredgecolor": GOOD, "markerfacecolor": GOOD},
    )
    for box, colour in zip(drawn["boxes"], colours, strict=True):
        box.set(facecolor=colour)


def boxes(figure: Figure, runs: list[Run]) -> bool | None:
    """Errors by weight as box plots (paper, Fig. 3b and Fig. 6); red where a run failed."""
    groups = {mass: group for mass, group in by_mass(runs).items() if len(errors_mm(group))}
    if not groups:
        return False
    axes = figure.subplots()
    errors = {f"{mass:g} g": errors_mm(group) for mass, group in groups.items()}
    failed = [any(run.failed for run in group) for group in groups.values()]
    box_plot(axes, errors, [PALE_ERROR if bad else PALE_OUT for bad in failed])
    largest = [error.max() for error in errors.values()]
    top = max((value for value, bad in zip(largest, failed, strict=True) if not bad), default=max(largest))
    axes.set(ylabel="tracking error, mm", xlabel="weight at the tip", ylim=(0, 1.3 * top))
    if max(largest) > 1.3 * top:
        axes.set_title(f"red: failed; the largest error, beyond the axis, is {max(largest):.1f} mm")


def actuators(figure: Figure, subject: tuple[Run, Robot, Scenario]) -> None:
    """Positions and angles of the bases over time, with the limits (paper, Fig. 5)."""
    run, robot, scenario = subject
    left, right = figure.subplots(1, 2)
    n, beta, limits = robot.n_tubes, 1e3 * run.joints[:, : robot.n_tubes], scenario.limits
    lengths = np.array([tube.length_mm for tube in robot.tubes])
    for i in range(n):
        left.plot(run.time, beta[:, i], color=AXES[i % 3], label=f"tube {i + 1}")
        right.plot(run.time, np.degrees(run.joints[:, n + i]), color=AXES[i % 3], label=f"tube {i + 1}")
        outer = beta[:, i + 1] if i + 1 < n else np.zeros(len(beta))
        outer_tip = lengths[i + 1] + outer if i + 1 < n else outer
        high, low = outer - limits.base_gap_mm, outer_tip + limits.tip_gap_mm - lengths[i]
        left.plot(run.time, high, color=AXES[i % 3], lw=0.8, ls="--")
        left.plot(run.time, low, color=AXES[i % 3], lw=0.8, ls=":")
        held = (run.held[:, :3] >> i & 1).any(axis=1)
        left.plot(run.time[held], beta[held, i], ".", color=ERROR, ms=2)
    left.set(xlabel="time, s", ylabel="beta, mm")
    right.set(xlabel="time, s", ylabel="alpha, deg")
    left.set_title("limits: dashed, base of the next tube; dotted, its tip", fontweight="normal", fontsize=9)
    right.legend(fontsize=9)


def tasks(figure: Figure, subject: tuple[Run, Scenario]) -> None:
    """When each task gave way, and the error."""
    run, scenario = subject
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1.2))
    top.plot(run.time, 1e3 * run.error, color=FAINT, lw=1, label="near the obstacle")
    top.plot(run.time, np.where(run.far, 1e3 * run.error, np.nan), color=ERROR, lw=1, label="counted")
    most = 1e3 * run.counted.max(initial=0)
    top.set(ylabel="error, mm", ylim=(0, 1.15 * most) if most > 0 else None)
    top.legend(fontsize=9)
    rows = np.flatnonzero(scenario.tasks.weights.any(axis=1))
    for line, k in enumerate(rows):
        gave = np.where(run.shortfall[:, k] > 1, line, np.nan)
        bottom.plot(run.time, gave, color=ERROR, lw=6, solid_capstyle="butt")
    bottom.plot(run.time, np.where(run.at_limit, len(rows), np.nan), color=INK, lw=6, solid_capstyle="butt")
    bottom.set(xlabel="time, s", ylim=(-0.6, len(rows) + 0.6))
    bottom.set_yticks(range(len(rows) + 1), [*(TASKS[k] for k in rows), "held at a limit"])


def scene(runs: list[Run], scenario: Scenario, names: list[str] | None = None) -> str:
    """JSON text for `html_page.view`; mm, base frame. `names` of the runs; None: one run a weight, named by it."""
    names = names or [f"{run.mass_g:g} g" for run in runs]
    layers = [show.layer("line", "wanted", _thinned(runs[0].wanted), "noise", 1.6, dashed=True)]
    for run, name, colour in zip(runs, names, COLOURS * 3, strict=False):
        if run.started:
            failed = " (failed)" if run.failed else ""
            layers.append(show.layer("line", name + failed, _thinned(run.tip), colour, 1.8))
    if obstacle := scenario.obstacle:
        centre = np.array([obstacle.centre_mm], float)
        layers.append(show.layer("ball", "obstacle", centre, "error", radius=obstacle.radius_mm))
    layers.append(show.layer("points", "front plate", np.zeros((1, 3)), "ink", 5, hidden=True))
    return show.view(layers, (1.4, -1.62, 0.86))


def _thinned(points: Array) -> Array:
    """At most about MOST_POINTS of the points [m], in mm."""
    return 1e3 * points[:: max(1, len(points) // MOST_POINTS)]
