"""Which quantities predict the error on held-out runs or regions of joint space.

Each form gives the error vector as a smooth function of one quantity, in the frame where that works best. A form's
share is the part of the squared error that it predicts on blocks it was not fitted to. Its p-value is the fraction of
sign-flip trials in which the BEST of all forms does as well (Westfall and Young 1993, max-T), so it already accounts
for the number of forms tried.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.compare.covariates import Covariate, covariates, has_speed
from ctcr.compare.crossvalidation import Folds, Regression, chance, make_folds, split
from ctcr.compare.sample import Sample

FRAME_NAMES = {
    "base": ("x", "y", "z"),
    "tip": ("tip x", "tip y", "along the tip"),
    "axis": ("outwards", "around the axis", "along the axis"),
    "motion": ("along the motion", "across, in the bend", "across, sideways"),
}


@dataclass(frozen=True)
class Form:
    """One way in which the error may depend on something: a linear model of its components in a frame."""

    name: str
    label: str
    frame: str  # key of FRAME_NAMES
    axes: Array  # (K, 3, 3) of the frame as columns, base frame; zero where it is not defined
    regression: Regression  # of a design (K, P), or (3K, P) when it couples the three components
    covariate: Covariate | None = None  # judged beyond a constant vector in the same frame, the first column

    @property
    def coupled(self) -> bool:
        """Whether one coefficient acts on all three components."""
        return len(self.regression.design) > len(self.axes)

    def local(self, error: Array) -> Array:
        """Error (K, 3), base frame, as the target of the design."""
        return error.reshape(-1, 1) if self.coupled else np.einsum("kji,kj->ki", self.axes, error)

    def in_base(self, target: Array) -> Array:
        """The inverse of `local`."""
        return target.reshape(-1, 3) if self.coupled else np.einsum("kij,kj->ki", self.axes, target)

    def fitted(self, error: Array) -> Array:
        """Least-squares fit of `local(error)`, slightly damped, without its constant part."""
        design = self.regression.design
        if self.covariate:
            design = design[:, 1:] - design[:, 1:].mean(axis=0)
        gram = design.T @ design
        damping = 1e-3 * np.diag(np.diagonal(gram)) + 1e-300 * np.eye(len(gram))
        return design @ np.linalg.lstsq(gram + damping, design.T @ self.local(error), rcond=None)[0]

    def size(self, error: Array) -> tuple[float, str]:
        """RMS [mm] of the fit to an error (K, 3) [m], base frame, and the axis that holds most of its square; "" if
        none does."""
        square = np.sum(self.fitted(error) ** 2, axis=0)
        main = int(np.argmax(square))
        named = not self.coupled and square[main] > settings.MAIN_AXIS * square.sum()
        return float(np.sqrt(square.sum() / len(error))) * 1e3, FRAME_NAMES[self.frame][main] if named else ""


@dataclass(frozen=True)
class Dependence:
    """How one quantity is related to the error."""

    form: Form  # the best one for this quantity
    share: float  # fraction of the squared error beyond a constant, held out; may be negative
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

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON."""
        names = "name label share p_value size_mm indistinct".split()
        return {name: getattr(self, name) for name in names} | {"frame": self.form.frame}


@dataclass(frozen=True)
class Ranking:
    """All dependences, strongest first, and those found one after another in the residual of the stronger ones."""

    alone: list[Dependence]
    chosen: list[Dependence]  # share: gained on top of the ones before
    chance_share: float  # the best of all forms reaches this by chance with the probability of the level
    explained: float  # fraction of the squared error that the chosen ones predict together
    error: Array  # (K, 3) that was explained, base frame [m], the offset removed
    rows: Integers  # indices of the sample's rows that were used, block by block
    blocks: int
    block_kind: str  # "runs" or "places"
    frames: dict[str, Array]  # frame -> axes (K, 3, 3) as columns, base frame

    def distinct(self) -> list[Dependence]:
        """The ranking with one entry for quantities that give the same curve in these data."""
        shown: list[Dependence] = []
        for item in self.alone:
            twins = [other for other in shown if item.label in other.indistinct]
            if not any(abs(other.share - item.share) < settings.LEAST_DEPENDENCE for other in twins):
                shown.append(item)
        return shown


def rank(sample: Sample, base_error: Array, alpha: float) -> Ranking:
    """Rank all forms on the error (sample rows, 3) in the base frame, its offset already removed [m].

    alpha: level at which a form counts as found.
    """
    rows, label, kind = split(sample.run, sample.motion.scaled)
    error = base_error[rows]
    folds = make_folds(label, settings.SIGN_TRIALS)
    frames = local_frames(sample, rows)
    enough = folds.count >= settings.FEWEST_BLOCKS
    total = float(Regression(np.ones((len(error), 1)), folds).unexplained(error)[0]) if enough else 0.0
    if total == 0:
        return Ranking([], [], np.nan, 0.0, error, rows, folds.count, kind, frames)
    forms = all_forms(sample, rows, covariates(sample), frames, folds)
    alone, by_chance = _judge(forms, error, folds, total)
    chosen, left, best = [], error, alone
    while len(chosen) < settings.MOST_DEPENDENCES and best:
        if best[0].p_value > alpha or best[0].share < settings.LEAST_DEPENDENCE:
            break
        chosen += _with_rivals(best[:1], best, left)
        form = best[0].form
        left = left - form.in_base(form.regression.predicted(form.local(left)))
        names = {item.name for item in chosen}
        best = [item for item in _judge(forms, left, folds, total)[0] if item.name not in names]
    explained = 1 - float(np.sum(left**2)) / total
    chance_share = float(np.quantile(by_chance, 1 - alpha)) / total
    alone = _with_rivals(alone, alone, error)
    return Ranking(alone, chosen, chance_share, explained, error, rows, folds.count, kind, frames)


def all_forms(
    sample: Sample, rows: Integers, items: list[Covariate], frames: dict[str, Array], folds: Folds
) -> list[Form]:
    """Every form tried: each quantity in three frames, and the few that are not functions of one quantity."""
    position = sample.base_position[rows]
    lever = position - position.mean(axis=0)
    turn = np.cross(np.eye(3), lever[:, None, :])  # error = omega x lever; row: by a turn about one axis
    turn = np.swapaxes(turn, 1, 2).reshape(-1, 3)
    velocity = np.nan_to_num(sample.tip_velocity[rows])
    ones = np.ones((len(rows), 1))
    special = [
        ("frame_turn", "a turn of the tracker frame", "base", turn),
        ("tip_offset", "a constant offset in the frame of the tip", "tip", ones),
        ("motion_offset", "direction of the tip's motion", "motion", ones),
    ]
    if has_speed(sample) and np.any(velocity):
        special.append(("lag", "velocity of the tip (a delay)", "base", velocity.reshape(-1, 1)))
    forms = [
        Form(name, label, frame, frames[frame], Regression(design, folds.of(design)))
        for name, label, frame, design in special
    ]
    for item in items:
        for design in replace(item, value=item.value[rows]).bases():
            regression = Regression(np.hstack([ones, np.nan_to_num(design)]), folds)
            forms += [Form(item.name, item.label, f, frames[f], regression, item) for f in ("base", "tip", "axis")]
    return forms


def local_frames(sample: Sample, rows: Integers) -> dict[str, Array]:
    """Axes of each frame as columns (K, 3, 3) in the base frame; zero where a frame is not defined."""
    tip = sample.tip_rotation[rows]
    away = sample.base_position[rows] * [1.0, 1.0, 0.0]
    up = np.broadcast_to([0.0, 0.0, 1.0], away.shape)
    return {
        "base": np.broadcast_to(np.eye(3), tip.shape),
        "tip": np.nan_to_num(tip),
        "axis": _frame(away, up)[:, :, [0, 2, 1]] * np.array([1.0, -1.0, 1.0]),
        "motion": _frame(np.nan_to_num(sample.tip_step[rows]), np.nan_to_num(tip[:, :, 2])),
    }


def _frame(first: Array, second: Array) -> Array:
    """Right-handed axes: along first, along second made square to it, and their cross product."""
    a = _unit(first)
    b = _unit(second - np.sum(second * a, axis=1, keepdims=True) * a)
    known = (a.any(axis=1) & b.any(axis=1))[:, None, None]
    return np.where(known, np.stack([a, b, np.cross(a, b)], axis=2), 0.0)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), 0.0)


def _judge(forms: list[Form], error: Array, folds: Folds, total: float) -> tuple[list[Dependence], Array]:
    """Dependences, strongest first, each in its best frame, and the best gains (T,) by chance."""
    one, constant = Regression(np.ones((len(error), 1)), folds), {}  # frame -> squared error that a constant leaves
    gains: dict[str, tuple[Form, float]] = {}
    best = np.full(folds.signs.shape[0] - 1, -np.inf)
    for form in forms:
        target = form.local(error)
        without = np.sum(target**2)
        if form.covariate:
            if form.frame not in constant:
                constant[form.frame] = one.unexplained(target)
            without = constant[form.frame]
        gain = without - form.regression.unexplained(target)
        best = np.maximum(best, gain[1:])
        if form.name not in gains or gain[0] > gains[form.name][1]:
            gains[form.name] = (form, gain[0])
    found = [Dependence(form, gain / total, chance(gain, best), *form.size(error)) for form, gain in gains.values()]
    return sorted(found, key=lambda item: -item.share), best


def _with_rivals(items: list[Dependence], others: list[Dependence], error: Array) -> list[Dependence]:
    """The items with the labels of those others that predict nearly the same error at every reading."""

    def directions(found: list[Dependence]) -> Array:
        fields = np.stack([item.form.in_base(item.form.fitted(error)).ravel() for item in found])
        return fields / np.maximum(np.linalg.norm(fields, axis=1, keepdims=True), 1e-300)

    alike = directions(items) @ directions(others).T >= settings.SAME_ERROR
    found = []
    for item, row in zip(items, alike, strict=True):
        rivals = (other.label for other, same in zip(others, row, strict=True) if same and other.label != item.label)
        found.append(replace(item, indistinct=tuple(rivals)))
    return found
