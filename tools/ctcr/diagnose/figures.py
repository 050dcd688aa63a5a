"""The pictures of the diagnosis: error waterfall, candidates, the error before and after against what it depends on."""

from typing import TYPE_CHECKING

import numpy as np

from ctcr.compare.figures import ERROR, FAINT, INK, NOISE
from ctcr.diagnose.race import Entry, imitated
from ctcr.html_page import short

if TYPE_CHECKING:
    from ctcr.diagnose.analysis import Diagnosis
    from ctcr.fit import Fit

GOOD = "#4b8b3b"
CANDIDATES = 10


def waterfall(figure, d: "Diagnosis") -> None:
    """RMS error on locked runs, from the robot file to the noise floor."""
    axes = figure.subplots()
    rms = d.rms_mm
    bars = [("robot file", rms["nominal"], FAINT), ("calibrated", rms["calibrated"], ERROR)]
    if d.accepted:
        names = "\n+ ".join(" or ".join(a.ids[:2]) for a in d.accepted)
        bars.append((f"+ {names}", rms["with_effects"], GOOD))
    for i, (_, value, colour) in enumerate(bars):
        axes.bar(i, value, color=colour, width=0.62)
        axes.text(
            i, 1.04 * value, f"{short(value)} mm", ha="center", va="bottom", weight="bold",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
        )  # fmt: skip
    axes.axhline(rms["noise_floor"], color=NOISE, linestyle="--")
    last = len(bars) - 0.6
    axes.text(
        last, rms["noise_floor"], f"noise floor\n{short(rms['noise_floor'])} mm", color=NOISE, va="bottom"
    )
    axes.set_xlim(right=last + 0.75)
    axes.set_xticks(range(len(bars)), [name.replace("_", " ") for name, _, _ in bars])
    axes.set_ylabel("RMS error on locked runs, mm")
    axes.set_yscale("log")
    axes.set_ylim(0.5 * min([rms["noise_floor"], *[v for _, v, _ in bars]]), 2 * max(v for _, v, _ in bars))


def candidates(figure, d: "Diagnosis") -> bool | None:
    """Log evidence of every candidate in each round; what the data cannot tell apart is boxed."""
    rounds = [r for r in d.rounds if r.entries]
    if not rounds:
        return False
    panels = figure.subplots(1, len(rounds), squeeze=False)[0]
    for number, (axes, round_) in enumerate(zip(panels, rounds, strict=True), start=1):
        best: dict[str, float] = {}
        for entry in round_.entries:
            value = entry.refit if entry.refit is not None else entry.linear
            best[entry.id] = max(value, best.get(entry.id, -np.inf))
        shown = sorted(best.items(), key=lambda item: -item[1])[:CANDIDATES]
        for i, (identity, value) in enumerate(shown):
            accepted = identity in round_.ids
            axes.barh(
                i, max(value, 0.3), color=GOOD if accepted else FAINT, edgecolor=INK if accepted else "none",
                linewidth=1.5,
            )  # fmt: skip
            axes.text(max(value, 0.3), i, f" {value:.1f}", va="center", fontsize=9)
        axes.set_yticks(range(len(shown)), [identity.replace("_", " ") for identity, _ in shown])
        axes.invert_yaxis()
        axes.set_xscale("symlog", linthresh=10)
        axes.set_xlim(0, 8 * max(10.0, *(value for _, value in shown)))
        axes.set_xlabel("log evidence over none")
        axes.set_title(f"round {number}")
    return None


def before_after(figure, d: "Diagnosis") -> bool | None:
    """The error after calibration against what predicts it best, and the part of it that the effects found explain.

    Both along the direction in which the effects act most.
    """
    ranking, sample = d.leftover.before, d.leftover.sample
    quantities = [item.form.covariate for item in ranking.chosen if item.form.covariate][:3]
    if not quantities or not d.accepted:
        return False
    rows = np.searchsorted(d.measurements.row, sample.row)
    error = 1e3 * d.calibrated.residual[rows, :3]
    explained = error - 1e3 * d.with_effects.residual[rows, :3]
    known = np.isfinite(explained).all(axis=1)
    _, _, axes_of_effect = np.linalg.svd(
        explained[known] - explained[known].mean(axis=0), full_matrices=False
    )
    panels = figure.subplots(1, len(quantities), sharey=True, squeeze=False)[0]
    for axes, quantity in zip(panels, quantities, strict=True):
        x = quantity.scale * quantity.value
        for vectors, colour, label in (
            (error, ERROR, "error after calibration"),
            (explained, GOOD, "explained by the effects found"),
        ):
            axes.plot(x, vectors @ axes_of_effect[0], ".", color=colour, markersize=4, alpha=0.6, label=label)
        axes.axhline(0, color=INK, linewidth=0.6)
        axes.set_xlabel(f"{quantity.label}, {quantity.unit}" if quantity.unit else quantity.label)
    panels[0].set_ylabel("along the main direction, mm")
    panels[0].legend(markerscale=3)
    return None


def overlap(figure, d: "Diagnosis") -> bool | None:
    """How much of the signal of each candidate of the first round another one can imitate together with calibration."""
    best: dict[str, Entry] = {}
    for entry in d.rounds[0].entries:
        if entry.fit is not None:
            best.setdefault(entry.id, entry)
    if len(best) < 2:
        return False
    share = np.array([[imitated(of, by) for by in best.values()] for of in best.values()])
    axes = figure.subplots()
    axes.grid(False)
    picture = axes.imshow(share, vmin=0, vmax=1, cmap="Blues")
    for i, j in np.ndindex(share.shape):
        axes.text(
            j, i, f"{share[i, j]:.2f}", ha="center", va="center", color="w" if share[i, j] > 0.6 else INK
        )
    names = [identity.replace("_", " ") for identity in best]
    axes.set_xticks(range(len(best)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(best)), names)
    axes.set_xlabel("imitated by")
    figure.colorbar(picture, ax=axes, label="share of the signal")
    return None


def fits_shown(d: "Diagnosis") -> list[tuple["Fit", str, str]]:
    """Fits whose errors are drawn one beside the other, each with its colour and name."""
    shown = [(d.calibrated, ERROR, "calibrated"), (d.with_effects, GOOD, "with the effects found")]
    return shown if d.accepted else shown[:1]


def directions(figure, d: "Diagnosis") -> None:
    """The course of the error over the session, before and after effects were found."""
    axes = figure.subplots()
    for fit, colour, label in fits_shown(d):
        size = 1e3 * np.linalg.norm(fit.residual[:, :3], axis=1)
        axes.plot(np.arange(len(size)) + 1, size, ".", color=colour, markersize=3, alpha=0.7, label=label)
    first = np.flatnonzero(np.diff(d.locked.astype(int)) != 0) + 1
    edges = np.concatenate([[0], first, [len(d.locked)]])
    for start, end in zip(edges, edges[1:], strict=False):
        if end > start and d.locked[start]:
            axes.axvspan(start + 0.5, end + 0.5, color="#eef2f5", zorder=0)
    axes.set_yscale("log")
    axes.set_xlabel("reading (grey: runs that no fit saw)")
    axes.set_ylabel("error, mm")
    axes.legend(markerscale=3)
