"""The pictures of the report, as SVG text. One colour means one thing in all of them."""

from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from ctcr.arrays import Array, evenly
from ctcr.compare.analysis import Comparison
from ctcr.compare.dependence import FRAME_NAMES, Dependence
from ctcr.compare.sample import Sample
from ctcr.compare.visits import OPPOSITE, SAME
from ctcr.show.palette import AXES, BACK, ERROR, FAINT, NOISE, OUT, TINT
from ctcr.show.style import noise_below, shares_below

Abscissa = tuple[Array, str, str]  # values, label, and the frame in which the error depends on them

MOST_POINTS = 4000
BARS = 12
PANELS = 6
BINS = 18


def sizes(figure: Figure, c: Comparison) -> None:
    """Error sizes against those of noise alone."""
    axes = figure.subplots()
    size = np.linalg.norm(c.headline.error, axis=1) * 1e3
    shares_below(axes, size, color=ERROR, lw=1.8, label=f"error, {c.position_mm.rms:.3g} mm RMS")
    noise_below(axes, c.noise.axis_mm, f"noise alone, {c.noise.rms_mm:.2g} mm RMS")
    axes.set(xlabel="distance between measured and predicted tip, mm", ylabel="% of readings below")
    axes.legend(loc="lower right", fontsize=9)


def course(figure: Figure, c: Comparison) -> None:
    """Error size in the order measured, runs set apart."""
    axes = figure.subplots()
    size = np.linalg.norm(c.headline.error, axis=1) * 1e3
    timed = len(c.runs) == 1 and np.isfinite(c.sample.t).any()
    x = c.headline.t if timed else np.arange(len(size))
    run = c.headline.run
    starts = np.flatnonzero(np.append(True, run[1:] != run[:-1]))
    stops = np.append(starts[1:], len(run))
    since = np.arange(len(run)) - np.repeat(starts, stops - starts)
    rows = np.flatnonzero(since % max(1, len(run) // MOST_POINTS) == 0)
    gaps = np.flatnonzero(since[rows] == 0)  # where the one line breaks: a line a run is slow where there are many
    line = (np.insert(values[rows], gaps, np.nan) for values in (x.astype(float), size))
    axes.plot(*line, color=ERROR, lw=0.9, marker="." if len(run) < 1000 else "", ms=3)
    tinted = [(x[start], x[stop - 1] - x[start]) for start, stop in zip(starts[1::2], stops[1::2], strict=True)]
    axes.broken_barh(tinted, (0, 1), transform=axes.get_xaxis_transform(), color=TINT, lw=0)
    if len(starts) > 1:
        above = {"transform": axes.get_xaxis_transform(), "ha": "center", "fontsize": 8, "color": NOISE}
        for number in range(0, len(starts), int(np.ceil(len(starts) / 16))):
            start, stop = starts[number], stops[number]
            axes.text((x[start] + x[stop - 1]) / 2, 1.01, str(run[start]), **above)
        axes.text(-0.01, 1.01, "run", transform=axes.transAxes, ha="right", fontsize=8, color=NOISE)
    if np.isfinite(c.noise.rms_mm):
        axes.axhline(c.noise.rms_mm, color=NOISE, lw=1, ls="--", label="noise, RMS")
        axes.legend(loc="upper right", fontsize=9)
    axes.set(xlabel="time, s" if timed else "reading", ylabel="error, mm", ylim=(0, 1.15 * size.max()))
    axes.margins(x=0.01)


def hysteresis(figure: Figure, c: Comparison) -> bool | None:
    """Left: how far apart visits of the same joints are. Right: the error out and on return along the path."""
    opposite, same = c.revisits.inside(OPPOSITE), c.revisits.inside(SAME)
    if len(opposite) == 0:
        return False
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.5))
    apart = {"opposite direction": 1e3 * np.sqrt(opposite.square), "same direction": 1e3 * np.sqrt(same.square)}
    for (name, values), colour in zip(apart.items(), (BACK, OUT), strict=True):
        if len(values):
            shares_below(left, values, color=colour, lw=1.8, label=f"{name} ({len(values)})")
    noise_below(left, c.noise.axis_mm * np.sqrt(2), "noise alone")
    left.set(xlabel="distance between two visits, mm", ylabel="% of pairs below", title="Same joints, visited twice")
    left.legend(fontsize=8, loc="lower right")
    _both_ways(right, c, opposite)


def _both_ways(axes, c: Comparison, pairs) -> None:
    """The error component that differs most, for the run with the largest difference."""
    runs, square = c.stops.run[pairs.later], pairs.square
    names, counts = np.unique(runs, return_counts=True)
    size = [np.median(square[runs == run]) for run in names]
    run = names[np.argmax(size * (counts >= 0.5 * counts.max()))]
    mine = pairs.select(runs == run)
    mine = mine.select(np.argsort(mine.earlier + mine.weight))
    component = int(np.argmax(np.median(mine.difference**2, axis=0)))
    later = c.stops.error[mine.later, component] * 1e3
    earlier = later - mine.difference[:, component] * 1e3
    path = np.arange(len(mine))
    axes.fill_between(path, earlier, later, color=FAINT, alpha=0.6, lw=0)
    axes.plot(path, earlier, color=OUT, lw=1.3, marker=".", ms=3, label="first pass")
    axes.plot(path, later, color=BACK, lw=1.3, marker=".", ms=3, label="opposite pass")
    axes.set(xlabel=f"position along the path of run {run}", title="The error out and on return")
    axes.set_ylabel(f"error along {'xyz'[component]} (tracker), mm")
    axes.legend(fontsize=8)


def ranking(figure: Figure, c: Comparison) -> bool | None:
    """Shares of the squared error predicted on held-out blocks."""
    items = c.ranking.distinct()[:BARS][::-1]
    if not items:
        return False
    axes = figure.subplots()
    found = {item.name for item in c.ranking.chosen}
    colours = [ERROR if item.name in found else FAINT for item in items]
    shares = [100 * max(item.share, 0) for item in items]
    axes.barh(range(len(items)), shares, color=colours, height=0.72)
    for y, (item, share) in enumerate(zip(items, shares, strict=True)):
        axes.text(share + 0.4, y, f"{100 * item.share:.0f} %  ({item.size_mm:.2g} mm)", va="center", fontsize=8.5)
    axes.set_yticks(range(len(items)), [item.label for item in items], fontsize=9)
    level = 100 * c.ranking.chance_share
    if level > 0:
        axes.axvline(level, color=NOISE, ls="--", lw=1.2)
        axes.text(level, len(items) - 0.4, " chance rarely exceeds this line", fontsize=8, color=NOISE, va="bottom")
    axes.set(ylim=(-0.6, len(items) + 0.1), xlim=(0, max([*shares, level]) * 1.25 + 1))
    axes.set_xlabel("fraction of the squared error predicted on held-out data, %")
    axes.grid(axis="y", visible=False)


def strongest(figure: Figure, c: Comparison) -> bool | None:
    """The error components against the strongest quantities."""
    chosen = {item.name for item in c.ranking.chosen}
    items = sorted(c.ranking.distinct(), key=lambda item: item.name not in chosen)
    items = drawable(items, c.sample, c.ranking.rows)[:PANELS]
    if not items:
        return False
    columns = 3 if len(items) > 1 else 1
    grid = figure.subplots(int(np.ceil(len(items) / columns)), columns, squeeze=False).ravel()
    for axes in grid[len(items) :]:
        axes.set_visible(False)
    for axes, (item, against) in zip(grid[: len(items)], items, strict=True):
        _against(axes, item, against, c, item.name in chosen)


def drawable(items: Iterable[Dependence], sample: Sample, rows: Array) -> list[tuple[Dependence, Abscissa]]:
    """Dependences on one number each, with their abscissas; of several with the same one the first."""
    found: dict[str, tuple[Dependence, Abscissa]] = {}
    for item in items:
        against = _abscissa(item, sample, rows)
        if against is not None:
            found.setdefault(against[1], (item, against))
    return list(found.values())


def _abscissa(item: Dependence, sample: Sample, rows: Array) -> Abscissa | None:
    if item.name in ("lag", "motion_offset"):
        speed = np.linalg.norm(sample.tip_velocity[rows], axis=1) * 1e3
        return (speed, "speed of the tip, mm/s", "motion") if np.isfinite(speed).any() else None
    quantity = item.form.covariate
    if quantity is None:
        return None
    value = quantity.value[rows]
    if quantity.kind == "angle":
        value = np.angle(np.exp(1j * value))
    unit = f", {quantity.unit}" if quantity.unit else ""
    return value * quantity.scale, quantity.symbol + unit, item.form.frame


def _against(axes, item: Dependence, against: Abscissa, c: Comparison, found: bool) -> None:
    x, label, frame = against
    local = np.einsum("kji,kj->ki", c.ranking.frames[frame], c.ranking.error) * 1e3
    known = np.isfinite(x)
    x, local = x[known], local[known]
    shown = evenly(len(x), 1500)
    levels, cell = np.unique(x, return_inverse=True)
    if len(levels) > 6:
        edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
        cell = np.clip(np.searchsorted(edges, x) - 1, 0, len(edges) - 2)
    cells = [cell == k for k in np.unique(cell)]
    for axis, name in enumerate(FRAME_NAMES[frame]):
        axes.scatter(x[shown], local[shown, axis], s=3, color=AXES[axis], alpha=0.15, lw=0, rasterized=True)
        means = np.array([(x[rows].mean(), local[rows, axis].mean()) for rows in cells])
        axes.plot(*means.T, color=AXES[axis], lw=1.8, marker="o", ms=3, label=name)
    axes.axhline(0, color=NOISE, lw=0.7)
    limit = max(np.percentile(np.abs(local), 99) * 1.15, 1e-3)  # mm: less is rounding
    axes.set(xlabel=label, ylabel="error, mm", ylim=(-limit, limit))
    axes.set_title(f"{100 * item.share:.0f} % of the squared error{' *' if found else ''}")
    axes.legend(fontsize=7, handlelength=1, labelspacing=0.25, frameon=True, framealpha=0.8, edgecolor="none")
