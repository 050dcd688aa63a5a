"""The pictures of a scenario, as SVG text through `html_page.figure`."""

import numpy as np
from matplotlib.figure import Figure

from ctcr.robot.description import Robot
from ctcr.show.style import AXES, ERROR, FAINT
from ctcr.track.result import Run, by_mass, errors_mm
from ctcr.track.scenario import TASKS, Scenario


def boxes(figure: Figure, runs: list[Run]) -> bool | None:
    """Errors by weight as box plots (paper, Fig. 3b and Fig. 6)."""
    groups = {mass: errors_mm(group) for mass, group in by_mass(runs).items()}
    groups = {mass: error for mass, error in groups.items() if len(error)}
    if not groups:
        return False
    axes = figure.subplots()
    failed = [any(run.failed for run in group) for mass, group in by_mass(runs).items() if mass in groups]
    drawn = axes.boxplot(
        list(groups.values()),
        tick_labels=[f"{mass:g} g" for mass in groups],
        whis=(0, 100),
        showmeans=True,
        patch_artist=True,
        medianprops={"color": "#1c2733"},
        meanprops={"marker": "D", "markersize": 4},
    )
    for box, bad in zip(drawn["boxes"], failed, strict=True):
        box.set(facecolor="#f2cdc6" if bad else "#cfe3ee")
    largest = [error.max() for error in groups.values()]
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
    weights = [getattr(scenario.tasks, name.replace(" ", "_")) for name in TASKS]
    rows = [k for k in range(len(TASKS)) if any(weights[k])]
    for place, k in enumerate(rows):
        gave = np.where(run.shortfall[:, k] > 1, place, np.nan)
        bottom.plot(run.time, gave, color=ERROR, lw=6, solid_capstyle="butt")
    bottom.plot(run.time, np.where(run.at_limit, len(rows), np.nan), color="#1c2733", lw=6, solid_capstyle="butt")
    bottom.set(xlabel="time, s", ylim=(-0.6, len(rows) + 0.6))
    bottom.set_yticks(range(len(rows) + 1), [*(TASKS[k] for k in rows), "held at a limit"])
