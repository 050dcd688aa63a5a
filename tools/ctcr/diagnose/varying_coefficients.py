"""A varying-coefficient model: calibration parameters that change with a quantity, as unknown causes make them.

A tube that is twisted while it is pushed has a home rotation that changes with its deployed length; an alloy that gets
warm has a stiffness that changes with time. Which parameter would have to change with which quantity says where an
effect of one's own must act, and on what it depends. The model is linearised at a fit, so that it needs no further
prediction.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.compare.covariates import Covariate, covariates
from ctcr.compare.sample import Sample
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.held_out import unexplained_of
from ctcr.diagnose.linearised import Linear, laplace
from ctcr.fit.joint import Fit
from ctcr.model.parameters import field_of

ADVICE = "An effect of your own that acts there may be what is missing: see docs/effects.md."
MEASURE = {  # by how the id of a quantity begins: what shows it best
    ("time", "order"): "Come back to the same joints again and again, from the first reading to the last",
    ("speed", "tip_speed"): "Pass the same joints at several speeds, and rest there",
    ("direction",): "Come to the same joints from both sides",
    ("force",): "Come to the same joints with several loads",
}


def label_of(parameter: str) -> str:
    """A parameter of the calibration, for people."""
    first, middle, last = parameter.replace("_", " ").split(".")
    if first == "tracker":
        return f"{middle} {last} of the tracker frame"
    return f"{last} of tube {middle}" if first == "tubes" else f"{middle} of tube {last}"


@dataclass(frozen=True)
class Variation:
    """A parameter that changes with a quantity."""

    parameter: str
    covariate: Covariate
    change: Array  # (K,) of the parameter in the K readings, in `unit`; without a constant, which calibration takes up
    unit: str

    @property
    def label(self) -> str:
        return label_of(self.parameter)

    @property
    def measure(self) -> str:
        """The measurement that would show it best."""
        known = (text for starts, text in MEASURE.items() if self.covariate.name.startswith(starts))
        alone = f"Change the {self.covariate.label} alone, there and back, with everything else constant"
        return f"{next(known, alone)}: does the {self.label} follow?"

    @property
    def message(self) -> str:
        return f"{self.label}: by {np.ptp(self.change):.2g} {self.unit} in all, with the {self.covariate.label}"


@dataclass(frozen=True)
class VaryingModel:
    """Parameters that would have to vary, and the residual that they would leave."""

    variations: list[Variation]
    explained: float  # fraction of the unexplained chi-square of held-out runs
    residual: Array  # (M, 6) linearised

    @property
    def measure(self) -> list[str]:
        """Measurements to make next, each once."""
        return list(dict.fromkeys(v.measure for v in self.variations))

    @property
    def depends_on(self) -> list[str]:
        """Ids of the quantities."""
        return list(dict.fromkeys(v.covariate.name for v in self.variations))

    @property
    def lead(self) -> str:
        explained = "all" if self.explained > 0.995 else f"{self.explained:.0%}"
        return (
            f"It looks as if these were not constant, which explains {explained} of the unexplained chi-square of "
            "held-out readings (linearised)"
        )


@dataclass(frozen=True)
class _Trial:
    """Parameters, by their index in the fit, each with a quantity and the columns (M, k) by which it may vary."""

    pairs: tuple[tuple[int, Covariate, Array], ...]
    index: Integers  # of its columns among those of all trials

    @property
    def ids(self) -> set[tuple[int, str]]:
        return {(p, covariate.name) for p, covariate, _ in self.pairs}


class _Trials:
    """All trials with their whitened derivatives (columns, readings)."""

    def __init__(self, trials: list[_Trial], columns: Array) -> None:
        self.trials, self.columns = trials, columns
        # Batches of trials with equally many columns: which trials, the indices of their columns, their information.
        self._batches: list[tuple[Integers, Integers, Array]] = []
        sizes = np.array([len(trial.index) for trial in trials])
        for size in np.unique(sizes):
            which = np.flatnonzero(sizes == size)
            index = np.array([trials[k].index for k in which])
            parts = 1 + index.size * columns.shape[1] // settings.VARYING_AT_ONCE
            gathered = (columns[some] for some in np.array_split(index, parts))
            self._batches.append((which, index, np.concatenate([own @ own.transpose(0, 2, 1) for own in gathered])))

    def log_evidences(self, linear: Linear) -> Array:
        """Linear.gain() of each, in far less time."""
        found = np.empty(len(self.trials))
        overlap, gradient = self.columns @ linear.jacobian, self.columns @ linear.residual
        imitation = linear.imitation_by(overlap.T).T
        for which, index, alone in self._batches:
            beside = alone - overlap[index] @ imitation[index].transpose(0, 2, 1)
            found[which] = laplace(beside, gradient[index])[0]
        return found


def varying_model(engine: Engine, fit: Fit, sample: Sample) -> VaryingModel | None:
    """The model that explains most of the residual of a fit, by forward selection; None unless that holds on the
    held-out runs."""
    unexplained = unexplained_of(fit, ~engine.rows)
    thin, at = engine.thinned(fit, settings.VARYING_ROWS)
    if at is not fit:  # that is the optimum for all readings, not for these
        at = thin.linear_fit(at, **at.frozen)
    residual, jacobian = at.whitened()
    whitened = jacobian * at.prior_sd
    columns = derivatives = np.nan_to_num(at.jacobian_all).reshape(*at.residual.shape, -1) * at.prior_sd
    trials = _Trials(*_trials(engine, at, sample, derivatives))
    is_open = np.ones(len(trials.trials), bool)
    moved = np.zeros(len(at.names))
    chosen: list[_Trial] = []
    reached = [(unexplained(at.residual), moved)]
    while len(chosen) < settings.VARYING_MOST and is_open.any():
        gains = np.where(is_open, trials.log_evidences(Linear(residual + whitened @ moved, whitened)), -np.inf)
        best = int(np.argmax(gains))
        if gains[best] < settings.DECISIVE + np.log(np.sum(is_open)):
            break
        chosen.append(trials.trials[best])
        is_open &= [not trial.ids & chosen[-1].ids for trial in trials.trials]
        added = [derivatives[:, :, p, None] * basis[:, None, :] for p, _, basis in chosen[-1].pairs]
        whitened = np.hstack([whitened, trials.columns[chosen[-1].index].T])
        columns = np.concatenate([columns, *added], axis=2)
        gradient = whitened.T @ residual
        gradient[: len(at.names)] = 0.0  # at the optimum, where prior and readings balance
        moved = -np.linalg.solve(whitened.T @ whitened + np.eye(len(gradient)), gradient)
        reached.append((unexplained(at.residual + columns @ moved), moved))
    before, least = reached[0][0], min(left for left, _ in reached)
    count = next(k for k, (left, _) in enumerate(reached) if left - least <= settings.VARYING_NEGLIGIBLE * before)
    after, moved = reached[count]
    if after >= (1 - settings.VARYING_EXPLAINED) * before:
        return None
    pairs = [pair for trial in chosen[:count] for pair in trial.pairs]
    variations = _variations(engine, at, sample, pairs, moved[len(at.names) :])
    return VaryingModel(variations, 1 - after / before, at.residual + columns[:, :, : len(moved)] @ moved)


def _trials(engine: Engine, fit: Fit, sample: Sample, derivatives: Array) -> tuple[list[_Trial], Array]:
    """Each parameter with each quantity; parameters of one kind of all tubes with one quantity, or each with its own
    tube's. With the whitened derivatives by their columns (columns, readings)."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    quantities = covariates(sample)
    if any(quantity.name == "time" for quantity in quantities):  # the order of measuring is nearly the same
        quantities = [quantity for quantity in quantities if quantity.name != "order"]
    trials: list[_Trial] = []
    whitened: list[Array] = []
    count = 0
    kinds: dict[tuple, list[_Trial]] = defaultdict(list)
    for quantity in quantities:
        for richness, (covariate, basis, kind) in enumerate(_bases(quantity)):
            columns = np.zeros((len(engine.measurements), basis.shape[1]))
            columns[rows] = np.nan_to_num(basis)
            varied = [p for p, name in enumerate(fit.names) if name in engine.base and kind in name]
            numbers = len(varied) * 6 * columns.size
            for some in np.array_split(varied, 1 + numbers // settings.VARYING_AT_ONCE):
                each = derivatives[:, :, some, None] * columns[:, None, None, :]
                whitened.append(fit.whiten(each.reshape(*each.shape[:2], -1)).T)
            for p in varied:
                index = count + np.arange(columns.shape[1])
                count += len(index)
                trial = _Trial(((p, covariate, columns),), index)
                trials.append(trial)
                tube = next((part for part in fit.names[p].split(".") if part.isdigit()), "")
                if tube and covariate.tube in (0, int(tube)):
                    of = covariate.name.replace(tube, "*") if covariate.tube else covariate.name
                    kinds[fit.names[p].replace(tube, "*"), of, richness].append(trial)
    for alike in kinds.values():
        if len(alike) > 1:
            pairs = tuple(pair for trial in alike for pair in trial.pairs)
            trials.append(_Trial(pairs, np.concatenate([trial.index for trial in alike])))
    return trials, np.concatenate(whitened) if whitened else np.empty((0, 0))


def _bases(quantity: Covariate) -> Iterator[tuple[Covariate, Array, str]]:
    """Ways in which a parameter may change with a quantity, and the part of its name that those parameters have which
    may: smooth curves, and the errors of a toothed wheel, which turns a tube."""
    for basis in quantity.bases():
        yield quantity, basis, ""
    if quantity.kind == "angle" and quantity.tube:
        for teeth in range(settings.HARMONICS + 1, settings.MOST_TEETH + 1):
            label = f"{quantity.label}, {teeth} times a turn"
            angle = teeth * quantity.value[:, None]
            yield replace(quantity, label=label), np.hstack([np.cos(angle), np.sin(angle)]), "home_rotation"


def _variations(
    engine: Engine, fit: Fit, sample: Sample, pairs: list[tuple[int, Covariate, Array]], moved: Array
) -> list[Variation]:
    """How each parameter changes; `moved` are the coefficients of all columns of the pairs, in units of prior sd."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    found, begin = [], 0
    for p, covariate, columns in pairs:
        end = begin + columns.shape[1]
        field = field_of(fit.names[p])
        change = field.factor * fit.prior_sd[p] * columns[rows] @ moved[begin:end]
        found.append(Variation(fit.names[p], covariate, change, field.unit))
        begin = end
    return found
