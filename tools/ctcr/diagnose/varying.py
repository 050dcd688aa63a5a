"""Calibration parameters that are not constant: what a cause outside the catalogue looks like.

A tube that is twisted while it is pushed has a home rotation that changes with its deployed length; an alloy that gets
warm has a stiffness that changes with time. Which parameter would have to change with which quantity says where an
effect of one's own must act, and on what it depends. Everything is linear in the parameters at a fit, so that no
further prediction is needed.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.covariates import HARMONICS, Covariate, covariates
from ctcr.compare.sample import Sample
from ctcr.diagnose import other_runs
from ctcr.diagnose.engine import Engine, Linear, laplace
from ctcr.fit.joint import Fit
from ctcr.model import parameters

Array = NDArray[np.float64]

ROWS = 400  # that are looked at where there are twice as many or more
MOST = 4  # variations, one found after the other
EVIDENCE = 5.0  # of a variation, beyond the price of having looked at many
SHARE = 0.3  # of what noise does not explain of the runs that no fit saw, that they must explain together
LITTLE = 0.05  # ... and for which no further one is named
MUCH = 0.15  # of what noise does not explain there: effects that leave less are not outdone by anything
FAR_LESS = 0.25  # part of what effects leave there, that parameters leave which vary, where the effects are stand-ins
AT_ONCE = 2_000_000  # numbers that are made or gathered at a time
MOST_TEETH = 24  # of a wheel whose errors are looked for
SHOWN_UNITS = {"rad": ("deg", 180 / np.pi), "m": ("mm", 1e3), "Pa": ("GPa", 1e-9)}  # others are shown in SI

MEASURE = {  # by how the id of a quantity begins: what shows it best
    "time": "Come back to the same joints again and again, from the first reading to the last",
    "order": "Come back to the same joints again and again, from the first reading to the last",
    "speed": "Pass the same joints at several speeds, and rest there",
    "tip_speed": "Pass the same joints at several speeds, and rest there",
    "direction": "Come to the same joints from both sides",
    "force": "Come to the same joints with several loads",
}


@dataclass(frozen=True)
class Variation:
    """A parameter that changes with a quantity, over the readings (K,)."""

    parameter: str
    covariate: Covariate
    change: Array  # (K,) of the parameter, in `unit`; without a constant, which calibration takes up
    unit: str

    @property
    def label(self) -> str:
        """Of the parameter, for people."""
        first, middle, last = self.parameter.replace("_", " ").split(".")
        if first == "tracker":
            return f"{middle} {last} of the tracker frame"
        return f"{last} of tube {middle}" if first == "tubes" else f"{middle} of tube {last}"

    @property
    def measure(self) -> str:
        """What would show it best."""
        of = self.covariate.name
        known = (text for start, text in MEASURE.items() if of.startswith(start))
        alone = f"Change the {self.covariate.label} alone, there and back, all else held"
        return f"{next(known, alone)}: does the {self.label} follow?"

    @property
    def in_words(self) -> str:
        return f"{self.label}: by {np.ptp(self.change):.2g} {self.unit} in all, with the {self.covariate.label}"


@dataclass(frozen=True)
class Varying:
    """What would have to vary, and what that would do."""

    variations: list[Variation]
    share: float  # of what noise does not explain of the runs that no fit saw, that they explain
    residual: Array  # (M, 6) that they leave, by slopes

    @property
    def measure(self) -> list[str]:
        """What to measure next, each once."""
        return list(dict.fromkeys(v.measure for v in self.variations))

    def outdoes(self, engine: Engine, calibrated: Fit, with_effects: Fit) -> bool:
        """Whether effects leave far more of the runs that were not fitted than what was found to vary without them."""
        excess = other_runs.excess_of(engine, calibrated, ~engine.rows)
        return excess(self.residual) < FAR_LESS * excess(with_effects.residual)

    @property
    def depends_on(self) -> list[str]:
        """Ids of the quantities."""
        return list(dict.fromkeys(v.covariate.name for v in self.variations))

    @property
    def lead(self) -> str:
        share = "all" if self.share > 0.995 else f"{self.share:.0%}"
        return (
            f"It looks as if these were not constant, which by slopes explains {share} of what noise does not explain "
            "of the runs that no fit saw"
        )

    @property
    def advice(self) -> str:
        return "An effect of your own that acts there may be what is missing: see docs/effects.md."


@dataclass(frozen=True)
class _Trial:
    """Parameters, by their places in the fit, each with a quantity and the columns (M, k) by which it may vary."""

    pairs: tuple[tuple[int, Covariate, Array], ...]
    places: NDArray[np.int64]  # of its columns among those of all trials

    @property
    def ids(self) -> set[tuple[int, str]]:
        return {(p, covariate.name) for p, covariate, _ in self.pairs}


class _Trials:
    """All that is tried, with its whitened slopes (columns, readings)."""

    def __init__(self, trials: list[_Trial], columns: Array) -> None:
        self.trials, self.columns = trials, columns
        # Of trials with as many columns: which, the places of these, and what readings tell of them alone.
        self._alike: list[tuple[NDArray[np.int64], NDArray[np.int64], Array]] = []
        sizes = np.array([len(trial.places) for trial in trials])
        for size in np.unique(sizes):
            which = np.flatnonzero(sizes == size)
            places = np.array([trials[k].places for k in which])
            parts = 1 + places.size * columns.shape[1] // AT_ONCE
            gathered = (columns[some] for some in np.array_split(places, parts))
            self._alike.append((which, places, np.concatenate([own @ own.transpose(0, 2, 1) for own in gathered])))

    def log_evidences(self, linear: Linear) -> Array:
        """Linear.gain() of each, in far less time."""
        found = np.empty(len(self.trials))
        overlap, gradient = self.columns @ linear.jacobian, self.columns @ linear.residual
        imitation = linear.imitation_by(overlap.T).T
        for which, places, alone in self._alike:
            beside = alone - overlap[places] @ imitation[places].transpose(0, 2, 1)
            found[which] = laplace(beside, gradient[places])[0]
        return found


def may_outdo(engine: Engine, calibrated: Fit, with_effects: Fit) -> bool:
    """Whether effects leave enough of the runs that were not fitted for something else to explain far more."""
    excess = other_runs.excess_of(engine, calibrated, ~engine.rows)
    return excess(with_effects.residual) > MUCH * excess(calibrated.residual)


def found(engine: Engine, fit: Fit, sample: Sample) -> Varying | None:
    """What explains most of the rest of a fit, if that holds on the runs that it did not see."""
    excess = other_runs.excess_of(engine, fit, ~engine.rows)
    thin, at = engine.thinned(fit, ROWS)
    if at is not fit:  # that is in balance with all readings, not with these
        at = thin.linear_fit(at, weights=at.weights, inflation=at.inflation)
    residual, jacobian = at.whitened()
    jacobian = jacobian * at.prior_sd
    slopes = np.nan_to_num(at.jacobian_all).reshape(*at.residual.shape, -1) * at.prior_sd
    trials = _Trials(*_trials(engine, at, sample, slopes))
    is_open = np.ones(len(trials.trials), bool)
    whitened, columns, moved = jacobian, slopes, np.zeros(len(at.names))
    chosen: list[_Trial] = []
    reached = [(excess(at.residual), moved)]
    while len(chosen) < MOST and is_open.any():
        gains = np.where(is_open, trials.log_evidences(Linear(residual + whitened @ moved, whitened)), -np.inf)
        best = int(np.argmax(gains))
        if gains[best] < EVIDENCE + np.log(np.sum(is_open)):
            break
        chosen.append(trials.trials[best])
        is_open &= [not trial.ids & chosen[-1].ids for trial in trials.trials]
        added = [slopes[:, :, p, None] * basis[:, None, :] for p, _, basis in chosen[-1].pairs]
        whitened = np.hstack([whitened, trials.columns[chosen[-1].places].T])
        columns = np.concatenate([columns, *added], axis=2)
        gradient = whitened.T @ residual
        gradient[: len(at.names)] = 0.0  # the fit is where prior and readings are in balance
        moved = -np.linalg.solve(whitened.T @ whitened + np.eye(len(gradient)), gradient)
        reached.append((excess(at.residual + columns @ moved), moved))
    before, least = reached[0][0], min(left for left, _ in reached)
    count = next(k for k, (left, _) in enumerate(reached) if left - least <= LITTLE * before)
    after, moved = reached[count]
    if after >= (1 - SHARE) * before:
        return None
    pairs = [pair for trial in chosen[:count] for pair in trial.pairs]
    variations = _variations(engine, at, sample, pairs, moved[len(at.names) :])
    return Varying(variations, 1 - after / before, at.residual + columns[:, :, : len(moved)] @ moved)


def _trials(engine: Engine, fit: Fit, sample: Sample, slopes: Array) -> tuple[list[_Trial], Array]:
    """Each parameter with each quantity; all tubes' parameters of a kind with one, or each with its own tube's. And the
    whitened slopes by their columns (columns, readings)."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    pitch = engine.robot.actuation.translation_mm_per_rev
    quantities = covariates(sample, 1e-3 * pitch if pitch else None)
    if any(quantity.name == "time" for quantity in quantities):  # the order of measuring is nearly the same
        quantities = [quantity for quantity in quantities if quantity.name != "order"]
    trials: list[_Trial] = []
    whitened: list[Array] = []
    count = 0
    kinds: dict[tuple, list[_Trial]] = defaultdict(list)
    for quantity in quantities:
        for richness, (covariate, basis, kind) in enumerate(_shapes(quantity)):
            columns = np.zeros((len(engine.measurements), basis.shape[1]))
            columns[rows] = np.nan_to_num(basis)
            varied = [p for p, name in enumerate(fit.names) if name in engine.base and kind in name]
            numbers = len(varied) * 6 * columns.size
            for some in np.array_split(varied, 1 + numbers // AT_ONCE):
                each = slopes[:, :, some, None] * columns[:, None, None, :]
                whitened.append(fit.whiten(each.reshape(*each.shape[:2], -1)).T)
            for p in varied:
                places = count + np.arange(columns.shape[1])
                count += len(places)
                trial = _Trial(((p, covariate, columns),), places)
                trials.append(trial)
                parts = fit.names[p].split(".")
                tube = next((part for part in parts if part.isdigit()), "")
                if tube and covariate.tube in (0, int(tube)):
                    of = covariate.name.replace(tube, "*") if covariate.tube else covariate.name
                    kinds[fit.names[p].replace(tube, "*"), of, richness].append(trial)
    for alike in kinds.values():
        if len(alike) > 1:
            pairs = tuple(pair for trial in alike for pair in trial.pairs)
            trials.append(_Trial(pairs, np.concatenate([trial.places for trial in alike])))
    return trials, np.concatenate(whitened) if whitened else np.empty((0, 0))


def _shapes(quantity: Covariate) -> Iterator[tuple[Covariate, Array, str]]:
    """Ways in which a parameter may change with a quantity, and what is in the names of those that may: its smooth
    curves, and the errors of a wheel with teeth, which turns a tube."""
    for basis in quantity.bases():
        yield quantity, basis, ""
    if quantity.kind == "angle" and quantity.tube:
        for teeth in range(HARMONICS + 1, MOST_TEETH + 1):
            label = f"{quantity.label}, {teeth} times a turn"
            angle = teeth * quantity.value[:, None]
            yield replace(quantity, label=label), np.hstack([np.cos(angle), np.sin(angle)]), "home_rotation"


def _variations(
    engine: Engine, fit: Fit, sample: Sample, pairs: list[tuple[int, Covariate, Array]], moved: Array
) -> list[Variation]:
    """What `moved`, of all columns of the pairs in units of prior sd, says of each parameter."""
    rows = np.searchsorted(engine.measurements.row, sample.row)
    units, found, begin = parameters.units_with_effects(engine.robot), [], 0
    for p, covariate, columns in pairs:
        end = begin + columns.shape[1]
        unit, scale = SHOWN_UNITS.get(units[fit.names[p]], (units[fit.names[p]], 1.0))
        change = scale * fit.prior_sd[p] * columns[rows] @ moved[begin:end]
        found.append(Variation(fit.names[p], covariate, change, unit))
        begin = end
    return found
