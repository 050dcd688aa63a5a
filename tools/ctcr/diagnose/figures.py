"""The pictures of the diagnosis: error waterfall, candidates, the error before and after against what it depends on."""

import numpy as np

from ctcr.compare.figures import drawable
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.diagnose.round import CandidateFit
from ctcr.fit.result import Fit
from ctcr.show.palette import ERROR, FAINT, GOOD, INK, NOISE, PALETTE, TINT
from ctcr.show.wording import short

CANDIDATES = 10
PANELS = 3
PALE = 0.45  # opacity of bars of linearised gains


def waterfall(figure, d: Diagnosis) -> None:
    """RMS error on held-out readings, from the robot file to the expected error."""
    axes, rms = figure.subplots(), d.rms_mm
    bars = [("robot file", rms["nominal"], FAINT), ("calibrated", rms["calibrated"], ERROR)]
    for k, a in enumerate(d.accepted, start=1):
        reached = rms["with_effects"] if k == len(d.accepted) else d.rms_mm_after(a)
        bars.append((f"+ {' or '.join(a.ids[:2])}".replace("_", " "), reached, GOOD))
    _, (name, floor) = d.floors.rows()
    bars.append((name, floor, NOISE))
    for i, (_, value, colour) in enumerate(bars):
        axes.barh(i, value, color=colour, height=0.62)
        axes.annotate(f"{short(value)} mm", (value, i), (4, 0), textcoords="offset points", va="center", weight="bold")
    axes.axvline(floor, color=NOISE, linestyle="--", linewidth=1)
    axes.set_yticks(range(len(bars)), [name for name, _, _ in bars])
    axes.invert_yaxis()
    axes.set(xlabel="RMS error on held-out readings, mm", xlim=(0, 1.25 * max(value for _, value, _ in bars)))
    axes.grid(axis="y", visible=False)


def candidates(figure, d: Diagnosis) -> bool | None:
    """Log evidence of every candidate in each round; what the data cannot tell apart is boxed."""
    rounds = [(number, r) for number, r in enumerate(d.rounds, start=1) if r.tried]
    if not rounds:
        return False
    panels = figure.subplots(-(-len(rounds) // PANELS), min(len(rounds), PANELS), squeeze=False).ravel()
    for axes in panels[len(rounds) :]:
        axes.set_visible(False)
    for axes, (number, round_) in zip(panels, rounds, strict=False):
        shown = round_.best[:CANDIDATES]
        for i, one in enumerate(shown):
            value = one.linear if one.refit is None else one.refit
            accepted = one.id in round_.ids
            colours = {"color": GOOD, "edgecolor": INK} if accepted else {"color": FAINT, "edgecolor": "none"}
            axes.barh(i, max(value, 0.3), linewidth=1.5, alpha=PALE if one.refit is None else 1, **colours)
            axes.text(max(value, 0.3), i, f" {value:.1f}", va="center", fontsize=9)
        axes.set_yticks(range(len(shown)), [one.id.replace("_", " ") for one in shown])
        axes.invert_yaxis()
        axes.set_xscale("symlog", linthresh=10)
        largest = max(10.0, *(max(one.linear, one.score) for one in shown))
        axes.set(
            xlim=(0, 8 * largest),
            xticks=[],
            xlabel="log evidence over none",
            title=f"round {number}\n{round_.place.replace('_', ' ')}",
        )


def before_after(figure, d: Diagnosis) -> bool | None:
    """The error after calibration against what predicts it best, and the part of it that the effects found explain.

    Both along the tip's motion where it is that, else along the direction in which the effects act most.
    """
    ranking, sample = d.residual.before, d.residual.sample
    drawn = drawable([*ranking.chosen, *ranking.distinct()], sample, ranking.rows)
    drawn = drawn[: max(1, min(len(ranking.chosen), PANELS))]
    if not drawn or not d.accepted:
        return False
    rows = np.searchsorted(d.measurements.row, sample.row[ranking.rows])
    before, after = (1e3 * fit.residual[rows, :3] @ sample.rotation for fit in (d.calibrated, d.with_effects))
    explained = before - after
    finite = np.isfinite(explained).all(axis=1)
    _, _, main = np.linalg.svd(explained[finite] - explained[finite].mean(axis=0), full_matrices=False)
    panels = figure.subplots(1, len(drawn), squeeze=False)[0]
    for axes, (_, (x, label, frame)) in zip(panels, drawn, strict=True):
        along = ranking.frames["motion"][:, :, 0] if frame == "motion" else np.tile(main[0], (len(rows), 1))
        for vectors, colour, name in (
            (before, ERROR, "error after calibration"),
            (explained, GOOD, "explained by the effects found"),
        ):
            axes.plot(x, np.sum(vectors * along, axis=1), ".", color=colour, markersize=4, alpha=0.6, label=name)
        axes.axhline(0, color=INK, linewidth=0.6)
        axes.set(xlabel=label, ylabel=f"along the {'motion' if frame == 'motion' else 'main direction'}, mm")
    panels[0].legend(markerscale=3)


def varying(figure, d: Diagnosis) -> None:
    """How each parameter that is not constant would have to change with its quantity."""
    panels = figure.subplots(1, len(d.varying.variations), squeeze=False)[0]
    for axes, v in zip(panels, d.varying.variations, strict=True):
        axes.plot(v.covariate.scale * v.covariate.value, v.change, ".", color=GOOD, markersize=4)
        axes.axhline(0, color=INK, linewidth=0.6)
        unit = f", {v.covariate.unit}" if v.covariate.unit else ""
        axes.set(xlabel=f"{v.covariate.symbol}{unit}", ylabel=f"change, {v.unit}", title=v.label)


def overlap(figure, d: Diagnosis) -> bool | None:
    """How much of the signal of each candidate of the first round another one can imitate together with calibration."""
    best = [one for one in d.rounds[0].best if one.fit is not None]
    if len(best) < 2:
        return False
    fraction = np.array([[_imitated(of, by) for by in best] for of in best])
    axes = figure.subplots()
    axes.grid(False)
    picture = axes.imshow(fraction, vmin=0, vmax=1, cmap="Blues")
    for i, j in np.ndindex(fraction.shape):
        axes.text(j, i, f"{fraction[i, j]:.2f}", ha="center", va="center", color="w" if fraction[i, j] > 0.6 else INK)
    names = [one.id.replace("_", " ") for one in best]
    axes.set_xticks(range(len(best)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(best)), names)
    axes.set_xlabel("imitated by")
    figure.colorbar(picture, ax=axes, label="fraction of the signal")


def fits_shown(d: Diagnosis) -> list[tuple[Fit, str, str]]:
    """Fits whose errors are drawn one beside the other, each with its colour of the palette and its name."""
    shown = [(d.calibrated, "error", "calibrated"), (d.with_effects, "good", "with the effects found")]
    return shown if d.accepted else shown[:1]


def course(figure, d: Diagnosis) -> None:
    """The course of the error over the session, before and after effects were found."""
    axes = figure.subplots()
    for fit, colour, label in fits_shown(d):
        size = 1e3 * np.linalg.norm(fit.residual[:, :3], axis=1)
        axes.plot(np.arange(len(size)) + 1, size, ".", color=PALETTE[colour][0], markersize=3, alpha=0.7, label=label)
    first = np.flatnonzero(np.diff(d.held_out.astype(int)) != 0) + 1
    edges = np.concatenate([[0], first, [len(d.held_out)]])
    for start, end in zip(edges, edges[1:], strict=False):
        if end > start and d.held_out[start]:
            axes.axvspan(start + 0.5, end + 0.5, color=TINT, zorder=0)
    axes.set(xlabel="reading (grey: held out)", ylabel="error, mm", ylim=(0, None))
    axes.legend(markerscale=3)


def _imitated(one: CandidateFit, by: CandidateFit) -> float:
    """Fraction of a candidate's signal that another one can imitate together with the calibration."""
    signal = one.gain.signal
    q, r = np.linalg.qr(by.gain.columns)
    keep = np.abs(np.diag(r)) > 1e-9 * np.abs(np.diag(r)).max(initial=1e-300)
    return float(np.sum((q[:, keep].T @ signal) ** 2) / max(signal @ signal, 1e-300))
