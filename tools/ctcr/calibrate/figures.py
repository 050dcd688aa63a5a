"""The pictures of the calibration report and its 3-D view. Colours mean what they mean in the comparison's."""

import numpy as np

from ctcr import settings
from ctcr.arrays import evenly
from ctcr.calibrate.joint_fit import Calibration
from ctcr.show import scene as show
from ctcr.show.palette import ERROR, FAINT, GOOD, INK, LINE, NOISE, OUT, TINT
from ctcr.show.style import noise_below, shares_below
from ctcr.show.wording import mm

MOST_NAMES = 60
MOST_POINTS = 4000
MOST_ARROWS = 1200
ARROW_SHARE = 0.1  # of the workspace that a large error (95 %) may fill on the page


def waterfall(figure, c: Calibration) -> None:
    """The error from the robot file's values down to the error to be expected of a right model."""
    axes = figure.subplots()
    names = {"nominal": "robot file", "frame alone": "tracker frame\nalone"}
    steps = [(names.get(stage.name, stage.name), stage.rms_mm) for stage in c.stages]
    if c.held_out:
        steps.append((f"held out\n({c.held_out.kind})", c.held_out.error.rms_mm))
    last, floor = len(steps), c.floors.expected_error_mm

    def bar(x: int, size: float, colour: str, ink: str = INK) -> None:
        inside = ink == "white" and size > 0.12 * steps[0][1]
        axes.bar(x, size, width=0.62, color=colour, zorder=2)
        style = {"textcoords": "offset points", "ha": "center", "fontweight": "bold", "zorder": 3}
        axes.annotate(mm(size), (x, size), (0, -13 if inside else 3), color=ink if inside else INK, **style)

    for x, (_, size) in enumerate(steps):
        bar(x, size, ERROR if x == 0 else GOOD if x == last - 1 else OUT, "white")
        if x:
            before = steps[x - 1][1]
            axes.bar(x, before - size, bottom=size, width=0.62, color=FAINT, alpha=0.45, zorder=1)
            axes.plot([x - 1 + 0.31, x + 0.31], [before, before], color=NOISE, lw=0.8)
            style = {"textcoords": "offset points", "ha": "center", "fontsize": 9, "color": NOISE}
            axes.annotate(f"{100 * (size / before - 1):+.0f} %", (x, max(size, before)), (0, 4), **style)
    bar(last, floor, NOISE)
    axes.axhline(floor, color=NOISE, ls="--", lw=1)
    axes.set_xticks(range(last + 1), [*(name for name, _ in steps), "expected error"])
    axes.set(ylabel="error, mm RMS", ylim=(0, 1.12 * max(size for _, size in steps)))
    axes.grid(axis="x", visible=False)


def sizes(figure, c: Calibration) -> None:
    """Error sizes before and after, against what noise would give."""
    axes = figure.subplots()
    sizes = (1e3 * np.linalg.norm(r[:, :3], axis=1) for r in (c.fit.nominal_residual, c.fit.residual))
    before, after = (size[np.isfinite(size)] for size in sizes)
    shares_below(axes, before, color=ERROR, lw=1.8, label="robot file")
    shares_below(axes, after, color=GOOD, lw=1.8, label="calibrated")
    noise_below(axes, c.floors.expected_error_mm / np.sqrt(3), "expected error")
    axes.set(xlabel="distance between measured and predicted tip, mm", ylabel="% of readings below")
    axes.legend(fontsize=9, loc="lower right")


def course(figure, c: Calibration) -> None:
    """The error in the order measured, before and after."""
    axes = figure.subplots()
    size = [1e3 * np.linalg.norm(r[:, :3], axis=1) for r in (c.fit.nominal_residual, c.fit.residual)]
    rows = np.arange(len(size[0]))[:: max(1, len(size[0]) // MOST_POINTS)]
    run = c.readings.run
    edges = np.flatnonzero(np.concatenate([[True], run[1:] != run[:-1], [True]]))
    for number, (start, stop) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        if number % 2:
            axes.axvspan(start, stop - 1, color=TINT, lw=0)
    for values, colour, label in zip(size, (ERROR, GOOD), ("robot file", "calibrated"), strict=True):
        axes.plot(rows, values[rows], color=colour, lw=0.9, label=label)
    axes.axhline(c.floors.expected_error_mm, color=NOISE, ls="--", lw=1, label="expected error")
    axes.set(xlabel="reading (runs shaded in turn)", ylabel="error, mm", ylim=(0, None))
    axes.margins(x=0.01)
    axes.legend(fontsize=9)


def shifts(figure, c: Calibration) -> None:
    """How far each parameter moved and its posterior standard deviation, in prior standard deviations."""
    items = c.fitted[:MOST_NAMES][::-1]
    axes = figure.subplots()
    for y, item in enumerate(items):
        colour = ERROR if item.implausible or item.at_bound or item.moved_far else FAINT if item.undetermined else OUT
        axes.hlines(y, item.shift - item.sd_left, item.shift + item.sd_left, color=colour, lw=2.2)
        axes.plot(item.shift, y, "o", color=colour, ms=4.5)
    reach = max(3.0, 1.1 * max(abs(item.shift) + item.sd_left for item in items))
    axes.axvspan(-2, 2, color=TINT, lw=0, zorder=0)
    axes.axvspan(-1, 1, color=LINE, lw=0, zorder=0)
    axes.axvline(0, color=NOISE, lw=0.8)
    axes.set_yticks(range(len(items)), [item.name for item in items], fontsize=8)
    axes.set(
        xlim=(-reach, reach),
        ylim=(-0.7, len(items) - 0.3),
        xlabel="shift from the robot file, in standard deviations of what it says",
    )
    axes.grid(axis="y", visible=False)


def correlations(figure, c: Calibration) -> None:
    """Posterior correlations; right, posterior over prior standard deviation."""
    count = min(len(c.fitted), MOST_NAMES)
    names = [item.name for item in c.fitted[:count]]
    sd = np.sqrt(np.diag(c.fit.covariance))[:count]
    matrix = c.fit.covariance[:count, :count] / np.outer(sd, sd)
    left, right = figure.subplots(1, 2, width_ratios=(1, 0.22), sharey=True)
    image = left.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto", interpolation="nearest")
    left.set_xticks(range(count), names, rotation=90, fontsize=7)
    left.set_yticks(range(count), names, fontsize=7.5)
    left.grid(visible=False)
    kinds = [name.split(".")[0] + name.split(".")[-1 if name.startswith("tubes") else 1] for name in names]
    for edge in (i - 0.5 for i in range(1, count) if kinds[i] != kinds[i - 1]):
        left.axhline(edge, color="white", lw=1.5)
        left.axvline(edge, color="white", lw=1.5)
        right.axhline(edge, color=LINE, lw=1.5)
    figure.colorbar(image, ax=left, location="left", shrink=0.5, pad=0.02, label="correlation")
    ratio = np.array([item.ratio for item in c.fitted[:count]])
    colours = [FAINT if value > settings.UNDETERMINED else OUT for value in ratio]
    right.barh(range(count), 100 * ratio, color=colours, height=0.7)
    right.axvline(100 * settings.UNDETERMINED, color=NOISE, ls="--", lw=1)
    right.set(xlim=(0, 105), xlabel="sd left, %")
    right.set_title("sd after / before", fontsize=9)


def half_difference(figure, c: Calibration) -> bool | None:
    """Where the models of two halves of the data disagree, and whether noise would drive them that far apart."""
    if c.halves is None:
        return False
    tip, size, noise = (1e3 * c.halves.tip, 1e3 * np.linalg.norm(c.halves.difference, axis=1), 1e3 * c.halves.noise)
    views = figure.subplots(1, 3, width_ratios=(1, 1, 1.1))
    top = max(np.percentile(size, 98), 1e-6)
    for axes, (x, y) in zip(views[:2], ((2, 0), (2, 1)), strict=True):
        order = np.argsort(size)
        drawn = axes.scatter(tip[order, x], tip[order, y], c=size[order], cmap="YlOrRd", vmin=0, vmax=top, s=16, lw=0)
        axes.set(xlabel=f"{'xyz'[x]} (base), mm", ylabel=f"{'xyz'[y]} (base), mm", aspect="equal")
        axes.set_adjustable("datalim")
    label = "difference of the two models, mm"
    figure.colorbar(drawn, ax=views[:2], location="bottom", shrink=0.6, pad=0.02, label=label)
    axes = views[2]
    beyond = size > 2 * noise
    for mask, colour, label in ((~beyond, NOISE, "what noise can do"), (beyond, ERROR, "beyond twice the noise")):
        if mask.any():
            axes.plot(noise[mask], size[mask], ".", color=colour, ms=5, alpha=0.6, label=f"{label} ({mask.mean():.0%})")
    line = np.array([0, noise.max()])
    axes.plot(line, line, color=INK, lw=1)
    axes.plot(line, 2 * line, color=INK, lw=0.8, ls="--")
    axes.set(xlabel="expected from noise, mm RMS", ylabel="difference, mm", xlim=(0, None), ylim=(0, 1.1 * size.max()))
    axes.legend(fontsize=8, loc="upper right")


def scene(c: Calibration) -> str:
    """JSON text for `html_page.view`, in mm, tracker frame, before or after; one scale for both."""
    measured = 1e3 * c.readings.position
    states = {"robot file": 1e3 * c.fit.nominal_residual[:, :3], "calibrated": 1e3 * c.fit.residual[:, :3]}
    known = np.flatnonzero(np.isfinite(np.hstack([measured, *states.values()])).all(axis=1))
    rows = known[evenly(len(known), MOST_ARROWS)]
    tips = measured[rows]
    sizes = {name: np.linalg.norm(error[rows], axis=1) for name, error in states.items()}
    factor = show.arrow_factor(tips, float(np.percentile(sizes["robot file"], 95)), ARROW_SHARE)
    readings = {"row": c.readings.row[rows].tolist(), "run": c.readings.run[rows].tolist()}
    readings |= {f"error, {name}, mm": show.numbers(size) for name, size in sizes.items()}
    layers = [show.layer("points", "measured", tips, "out", hover=readings)]
    for choice, (name, error) in enumerate(states.items()):
        tail = tips - error[rows]
        arrows = {"to": tail + factor * error[rows], "value": show.numbers(sizes[name]), "choice": choice}
        layers.append(show.layer("arrows", name, tail, size=1.6, **arrows))
    choices = [f"{name} (arrows × {factor:g})" for name in states]
    return show.view(layers, (1.3, 1.3, 0.7), show.most(sizes["robot file"]), choices)
