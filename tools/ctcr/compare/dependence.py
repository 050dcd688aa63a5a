"""Where the error comes from: which quantities predict it on runs (or places) that were left out.

Each form gives the error vector as a smooth function of one quantity, in the frame where that works best. A form's
share is the part of the squared error that it predicts on blocks it was not fitted to. Its p-value is the share of
sign-flip trials in which the BEST of all forms does as well (Westfall and Young 1993, max-T), so it already accounts
for the number of forms tried.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.blocks import FEWEST_RUNS, split
from ctcr.compare.covariates import covariates
from ctcr.compare.crossvalidation import Folds, chance, held_out_prediction, make_folds, unexplained
from ctcr.compare.forms import FRAME_NAMES, Form, all_forms, local_frames
from ctcr.compare.sample import Sample

Array = NDArray[np.float64]
TRIALS = 1999
MOST_FINDINGS = 5
SMALLEST_SHARE = 0.01
SAME_FIELD = 0.95  # correlation of two fitted errors above which the data do not tell them apart
MAIN_SHARE = 0.7  # of the squared fit, for one axis to be named


@dataclass(frozen=True)
class Dependence:
    """How one quantity is related to the error."""

    form: Form  # the best one for this quantity
    share: float  # of the squared error, held out, beyond a constant; may be negative
    p_value: float  # for the family of all forms
    size_mm: float  # RMS of the fitted dependence
    component: str  # axis of the frame that holds most of it, "" if none does
    indistinct: tuple[str, ...] = ()  # labels of quantities that predict the same error in these data

    @property
    def name(self) -> str:
        """Stable id."""
        return self.form.name

    @property
    def label(self) -> str:
        """Name for people."""
        return self.form.label


@dataclass(frozen=True)
class Ranking:
    """All dependences, strongest first, and those found one after another in what the stronger ones left."""

    alone: list[Dependence]
    chosen: list[Dependence]  # share: gained on top of the ones before
    chance_share: float  # the best of all forms reaches this by chance with the probability of the level
    explained: float  # share of the squared error that the chosen ones predict together
    error: Array  # (K, 3) base frame [m], the offset removed: what was explained
    rows: NDArray[np.int64]  # indices of the sample's rows that were used, block by block
    blocks: int
    block_kind: str  # "runs" or "places"
    frames: dict[str, Array]  # frame -> (K, 3, 3), columns are the axes in the base frame

    def distinct(self) -> list[Dependence]:
        """The ranking with one entry for quantities that are the same curve in these data."""
        shown: list[Dependence] = []
        for item in self.alone:
            twins = [other for other in shown if item.label in other.indistinct]
            if not any(abs(other.share - item.share) < SMALLEST_SHARE for other in twins):
                shown.append(item)
        return shown


def rank(sample: Sample, base_error: Array, pitch_m: float | None, alpha: float) -> Ranking:
    """Rank all forms on the error (sample rows, 3) in the base frame, its offset already removed [m].

    pitch_m: travel of a drive screw per revolution, None if unknown; alpha: level at which a form counts as found.
    """
    rows, label, kind = split(sample)
    error = base_error[rows]
    folds = make_folds(label, TRIALS)
    frames = local_frames(sample, rows)
    items = covariates(sample, pitch_m)
    forms = all_forms(sample, rows, items)
    total = float(unexplained(np.ones((len(error), 1)), error, folds)[0]) if folds.count >= FEWEST_RUNS else 0.0
    if total == 0:
        return Ranking([], [], np.nan, 0.0, error, rows, folds.count, kind, frames)
    alone, by_chance = _judge(forms, error, frames, folds, total)
    chosen, left, best = [], error, alone
    while len(chosen) < MOST_FINDINGS and best and best[0].p_value <= alpha and best[0].share >= SMALLEST_SHARE:
        chosen.append(_with_rivals(best[:1], best, left, frames)[0])
        left = left - _predicted(best[0].form, left, frames, folds)
        names = {item.name for item in chosen}
        best = [item for item in _judge(forms, left, frames, folds, total)[0] if item.name not in names]
    explained = 1 - float(np.sum(left**2)) / total
    alone = _with_rivals(alone, alone, error, frames)
    chance_share = float(np.quantile(by_chance, 1 - alpha)) / total
    return Ranking(alone, chosen, chance_share, explained, error, rows, folds.count, kind, frames)


def _judge(forms: list[Form], error: Array, frames: dict[str, Array], folds: Folds, total: float):
    """Dependences, strongest first, each in its best frame, and the best gains (T,) by chance."""
    ones = np.ones((len(error), 1))
    local = {name: np.einsum("kji,kj->ki", axes, error) for name, axes in frames.items()}
    constant = {name: unexplained(ones, values, folds) for name, values in local.items()}
    stacked = replace(folds, label=np.repeat(folds.label, 3))
    energy = float(np.sum(error**2))
    gains, best = {}, np.full(folds.signs.shape[0] - 1, -np.inf)
    for form in forms:
        if form.coupled:
            left = unexplained(form.design, error.reshape(-1, 1), stacked)
            gain = energy - left
        elif form.constant:
            left = unexplained(np.hstack([ones, form.design]), local[form.frame], folds)
            gain = constant[form.frame] - left
        else:
            gain = float(np.sum(local[form.frame] ** 2)) - unexplained(form.design, local[form.frame], folds)
        best = np.maximum(best, gain[1:])
        if form.name not in gains or gain[0] > gains[form.name][1]:
            gains[form.name] = (form, gain[0])
    found = [
        Dependence(form, gain / total, chance(gain, best), *_size(form, error, local)) for form, gain in gains.values()
    ]
    return sorted(found, key=lambda item: -item.share), best


def fitted(form_design: Array, target: Array) -> Array:
    """Least-squares fit (K, C) of target by the columns, slightly damped."""
    gram = form_design.T @ form_design
    damping = 1e-3 * np.diag(np.diagonal(gram)) + 1e-300 * np.eye(len(gram))
    return form_design @ np.linalg.lstsq(gram + damping, form_design.T @ target, rcond=None)[0]


def _size(form: Form, error: Array, local: dict[str, Array]) -> tuple[float, str]:
    """RMS [mm] of the fitted dependence and the axis that holds most of its square."""
    design = form.design - form.design.mean(axis=0) if form.constant else form.design
    if form.coupled:
        return float(np.sqrt(np.sum(fitted(design, error.reshape(-1, 1)) ** 2) / len(error))) * 1e3, ""
    square = np.sum(fitted(design, local[form.frame]) ** 2, axis=0)
    main = int(np.argmax(square))
    component = FRAME_NAMES[form.frame][main] if square[main] > MAIN_SHARE * square.sum() else ""
    return float(np.sqrt(square.sum() / len(error))) * 1e3, component


def _predicted(form: Form, error: Array, frames: dict[str, Array], folds: Folds) -> Array:
    """What a form predicts of the error in blocks left out (K, 3), base frame."""
    if form.coupled:
        stacked = replace(folds, label=np.repeat(folds.label, 3))
        return held_out_prediction(form.design, error.reshape(-1, 1), stacked).reshape(-1, 3)
    axes = frames[form.frame]
    local = np.einsum("kji,kj->ki", axes, error)
    ones = np.ones((len(error), 1))
    design = np.hstack([ones, form.design]) if form.constant else form.design
    return np.einsum("kij,kj->ki", axes, held_out_prediction(design, local, folds))


def _with_rivals(items: list[Dependence], others: list[Dependence], error: Array, frames: dict[str, Array]):
    """The items with the labels of those others that predict nearly the same error at every reading."""

    def directions(found: list[Dependence]) -> Array:
        fields = np.stack([_field(item.form, error, frames).ravel() for item in found])
        return fields / np.maximum(np.linalg.norm(fields, axis=1, keepdims=True), 1e-300)

    alike = directions(items) @ directions(others).T
    return [
        replace(
            item,
            indistinct=tuple(
                other.label
                for other, cosine in zip(others, row, strict=True)
                if cosine >= SAME_FIELD and other.name != item.name
            ),
        )
        for item, row in zip(items, alike, strict=True)
    ]


def _field(form: Form, error: Array, frames: dict[str, Array]) -> Array:
    """The error (K, 3) that a form explains in sample, base frame."""
    if form.coupled:
        return fitted(form.design, error.reshape(-1, 1)).reshape(-1, 3)
    local = np.einsum("kji,kj->ki", frames[form.frame], error)
    design = form.design - form.design.mean(axis=0) if form.constant else form.design
    return np.einsum("kij,kj->ki", frames[form.frame], fitted(design, local))
