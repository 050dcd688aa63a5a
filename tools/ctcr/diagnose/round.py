"""One round of stepwise selection: all candidates screened, the best ones fitted with the calibration, one accepted."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.diagnose import lags, starts
from ctcr.diagnose.candidates import Candidate
from ctcr.diagnose.engine import Engine, effects_in, values_of
from ctcr.diagnose.form_errors import log_odds_of_cause
from ctcr.diagnose.linearised import Gain
from ctcr.effects import catalogue
from ctcr.fit import folds, joint


@dataclass(frozen=True)
class CandidateFit:
    """A candidate in one round."""

    candidate: Candidate
    gain: Gain  # over none, linearised at the fit before
    refit: float | None = None  # log evidence over none after a joint refit; None: not refitted
    explained: float = 0.0  # fraction of the unexplained chi-square that it explains
    explained_sd: float = np.inf
    fit: joint.Fit | None = None
    implausible: tuple[str, ...] = ()  # values beyond the soft bounds of their effect

    @property
    def linear(self) -> float:
        """Log evidence by linearisation."""
        return self.gain.log_evidence - self.candidate.penalty

    @property
    def score(self) -> float:
        return -np.inf if self.refit is None else self.refit

    @property
    def surely_explained(self) -> float:
        """The fraction that it explains, less one standard deviation."""
        return self.explained - self.explained_sd

    @property
    def id(self) -> str:
        return self.candidate.id


@dataclass
class Round:
    before: joint.Fit
    tried: list[CandidateFit]  # the best first
    accepted: CandidateFit | None = None
    ids: list[str] = field(default_factory=list)  # the accepted effect and those that the data cannot tell from it
    margin: float = np.inf  # log evidence over the best candidate outside these
    reason: str = ""  # why nothing was accepted
    anew: str = ""  # id of the effect accepted earlier whose place was open in this round
    needed: float = np.inf  # log evidence below which nothing is accepted in any case
    is_spurious: bool = False  # whether the best candidate surely explains too little

    @property
    def place(self) -> str:
        """Whose place was open, for titles."""
        return f"in the place of {self.anew}" if self.anew else "a further effect"

    @property
    def why_not(self) -> str:
        """A sentence; empty where an effect was accepted."""
        what = f"Dropped {self.anew}" if self.anew else "Nothing accepted"
        return f"{what}: {self.reason}." if self.reason else ""

    @property
    def best(self) -> list[CandidateFit]:
        """Of each effect the accepted form, or the best one; those that were refitted come first."""
        found = {one.id: one for one in reversed(self.tried)}
        if self.accepted:
            found[self.accepted.id] = self.accepted
        return sorted(found.values(), key=lambda one: (-one.score, -one.linear))

    @property
    def rejected_variants(self) -> dict[str, float]:
        """Values of those variants of the accepted effect whose shape was fitted, but which were not accepted."""
        found = {}
        for one in reversed(self.tried):
            if one.id == self.accepted.id and one.fit is not None and one is not self.accepted:
                own = one.candidate.names
                if any(name in own for name, _ in one.candidate.shape):  # a shape of amplitude 0 has no derivatives
                    found |= {name: value for name, value in values_of(one.fit).items() if name in own}
        return found

    def reject(self, reason: str) -> None:
        """Accepts nothing after all."""
        self.accepted, self.ids, self.reason = None, [], reason

    def refute(self, gain: float) -> None:
        """Accepts nothing after all: in a converged fit the effect gains only so much log evidence."""
        self.tried = [replace(one, refit=gain) if one is self.accepted else one for one in self.tried]
        self.reject(f"in a converged fit {self.accepted.id} gains only {gain:.1f} in log evidence")

    def release_memory(self) -> None:
        """Drops the readings of its fits: with many rows, a round would need as much memory as everything else."""
        self.before = self.before.without_readings()
        for i, one in enumerate(self.tried):
            if one.fit is not None:
                self.tried[i] = replace(one, fit=one.fit.without_readings())
            if one is self.accepted:
                self.accepted = self.tried[i]

    def is_hopeless(self, more: float) -> bool:
        """Whether nothing would be accepted even with `more` times the readings."""
        best = max((one.score for one in self.tried), default=-np.inf)
        return self.accepted is None and (self.is_spurious or more * best < self.needed)

    @property
    def is_clear(self) -> bool:
        """Whether one effect was accepted, far ahead of all others."""
        return len(self.ids) == 1 and self.margin >= settings.DECISIVE


@dataclass(frozen=True)
class Judged:
    """A fit as the selection judges it. Where it has a delay, further lags that the data ask for count as noise."""

    fit: joint.Fit
    log_evidence: float
    chi_square: float  # of residual and prior, in units of the fit's inflated noise

    @staticmethod
    def of(engine: Engine, fit: joint.Fit) -> "Judged":
        more, removed = lags.explained(engine, fit)
        return Judged(fit, fit.log_evidence + more, _cost(fit) - removed)

    @property
    def unexplained(self) -> float:
        """Chi-square beyond what the noise as stated explains, at least its usual scatter."""
        used = (self.fit.weights > 0).sum(axis=0)
        by_noise = float(3 * np.sum(used / self.fit.inflation**2))
        return max(self.chi_square - by_noise, np.sqrt(2 * self.fit.observations))

    def fraction_explained(self, after: "Judged", added: int) -> float:
        """Fraction of the unexplained chi-square that `added` parameters explain, at the same weights and noise."""
        removed = self.chi_square - after.chi_square - added
        return float(removed / max(self.unexplained, removed, 1.0))


def parameters_of(fits: Collection[CandidateFit]) -> tuple[list[str], dict[str, float]]:
    """Names of all parameters of effects that are fitted, and the values at which others are held."""
    names = [name for one in fits for name in one.candidate.names]
    return names, dict(pair for one in fits for pair in one.candidate.shape)


def run_round(
    engine: Engine,
    before: joint.Fit,
    candidates: list[Candidate],
    accepted: list[CandidateFit],
    known: CandidateFit | None = None,
    surely: bool = False,
) -> Round:
    """Screens all candidates, refits the best jointly with calibration and accepted effects, and decides.

    known    a candidate that takes part in any case, with its fit at the weights and noise of the fit before
    surely   as for decide()
    """
    engine.progress("screening all candidates")
    names, fixed = parameters_of(accepted)
    if accepted:  # what a refit without a further effect finds too is no gain of one
        again = engine.fit_like(before, names, fixed=fixed, tolerance=settings.COARSE)
        before = max(before, again, key=lambda fit: fit.log_evidence)
    thin, at = engine.thinned(before)
    screened = screen(thin, at, candidates, fixed)
    if not screened and known is None:
        return Round(before, [], reason="no effect is left to try")
    refits = Refits(engine, before, fixed)
    if known:
        own = thin.derivatives(at, known.candidate.names, fixed | dict(known.candidate.shape))
        known = replace(known, gain=lags.linearised(thin, at).gain(at.whiten(own)))
    chosen = refits.in_reach(contenders(known, screened) if known else worth_a_refit(screened))
    tried = refits.of_all(chosen, known)
    before, tried = refits.without_best(tried)
    fitted = [one.candidate for one in tried]
    tried += [one for one in screened if one.candidate not in fitted]
    tried.sort(key=lambda one: (-one.score, -one.linear))
    round_ = Round(before, tried)
    n_effects = len({one.id for one in (*candidates, *tried)})
    decide(round_, n_effects, accepted, joint.rejects(before), surely)
    round_.release_memory()
    return round_


def screen(
    engine: Engine, before: joint.Fit, candidates: list[Candidate], fixed: dict[str, float]
) -> list[CandidateFit]:
    """All candidates with their linearised gain, best first."""
    n_tubes, linear = engine.robot.n_tubes, lags.linearised(engine, before)
    candidates = [c for c in candidates if not set(c.names) & set(before.names)]
    forces = catalogue.names_with("tip_force", n_tubes)
    everywhere = dict.fromkeys(catalogue.names_with("moment", n_tubes), starts.EVERYWHERE)
    names = list(dict.fromkeys([*(name for c in candidates for name in c.names), *forces]))
    derivatives = engine.derivatives(before, names, fixed | everywhere)

    def by(own: Collection[str]) -> Array:
        return derivatives[:, :, [names.index(name) for name in own]]

    def worth(columns: Array) -> float:
        return linear.gain(before.whiten(columns)).log_evidence

    def gain_of(start: Candidate, columns: Array) -> Gain:
        gain = linear.gain(before.whiten(columns))
        neutral, _, low, high = engine.priors(start.names[: len(gain.values)])
        blocked = np.where(gain.values < 0, neutral <= low, neutral >= high)
        return gain.at_neutral if blocked.all() else gain

    by_force = by(forces) / engine.priors(forces)[1]
    found = []
    for candidate in candidates:
        at = fixed | dict(candidate.shape)
        own = engine.derivatives(before, candidate.names, at) if candidate.shape else by(candidate.names)
        for options in starts.options(engine, candidate, own, by_force, worth):
            gains = [(gain_of(*option), option[0]) for option in options]
            if gains:
                gain, start = max(gains, key=lambda pair: pair[0].log_evidence)
                found.append(CandidateFit(start, gain))
    return sorted(found, key=lambda one: -one.linear)


def worth_a_refit(screened: list[CandidateFit]) -> list[CandidateFit]:
    """The best effects, few variants of each. Forms of the same parameters come last: once an effect is accepted,
    all its forms are tried."""
    worth = [one for one in screened if one.linear > max(settings.REFIT_GAIN, settings.NEAR * screened[0].linear)]
    first = {one.candidate.names: one for one in reversed(worth)}
    chosen: list[CandidateFit] = []
    for one in sorted(worth, key=lambda one: first[one.candidate.names] is not one):
        same = [other for other in chosen if other.id == one.id]
        if len(same) < settings.REFIT_VARIANTS and (same or len({other.id for other in chosen}) < settings.REFITS):
            chosen.append(one)
    return chosen


def contenders(known: CandidateFit, screened: list[CandidateFit]) -> list[CandidateFit]:
    """Other effects worth a refit whose linearised gain contends with that of a known one."""
    least = settings.CONTENDS * max(one.linear for one in (known, *screened) if one.id == known.id)
    return [one for one in worth_a_refit(screened) if one.id != known.id and one.linear > least]


@dataclass
class Refits:
    """Joint fits of candidates with calibration and accepted effects, at the weights and noise of the fit before."""

    engine: Engine
    before: joint.Fit
    fixed: dict[str, float]

    def __post_init__(self) -> None:
        self._judged = Judged.of(self.engine, self.before)

    def in_reach(self, chosen: list[CandidateFit]) -> list[CandidateFit]:
        """Those that a refit to a few of many rows does not leave far behind the best, with that fit as a start."""
        few, before = folds.few_of(self.engine.fitted), self.before
        if few is None or len(chosen) < 2:
            return chosen
        engine = replace(self.engine, rows=few)
        base = engine.fit_like(before, effects_in(before), fixed=self.fixed)
        tried = Refits(engine, base, self.fixed).of_all(chosen)
        best = max(one.score for one in tried)
        reach = min(best, settings.IN_REACH * best)  # the best itself always is
        return [replace(one, fit=there.fit) for one, there in zip(chosen, tried, strict=True) if there.score >= reach]

    def of_all(self, chosen: list[CandidateFit], known: CandidateFit | None = None) -> list[CandidateFit]:
        """Each after its fit, one that is `known` by the fit that it has. Those that contend are fitted to convergence:
        a candidate that is slow to fit must not lose to one that is quick."""
        tried = [self._in_each_shape(self._of(one, settings.FIRST_ITERATIONS)) for one in chosen]
        tried += [[self._by(known, known.fit)]] if known else []
        near = settings.CONTENDS * max((one.score for forms in tried for one in forms), default=0.0)
        return [self._converged(forms, near) for forms in tried]

    def _in_each_shape(self, one: CandidateFit) -> list[CandidateFit]:
        """The candidate with a free shape, where the evidence gains by it, and then with its usual one."""
        candidate = one.candidate.with_shape(self.engine.robot.n_tubes)
        if one.fit is None or candidate == one.candidate:
            return [one]
        freed = self._of(replace(one, candidate=candidate), settings.FIRST_ITERATIONS)
        return [freed, one] if freed.score > one.score + settings.COARSE else [one]

    def _converged(self, forms: list[CandidateFit], near: float) -> CandidateFit:
        """The first form with plausible values, or else the last one; fitted to convergence where it contends."""
        for one in forms:
            if one.fit and not one.fit.converged and one.score > near:
                one = self._of(one, settings.ITERATIONS)
            if not one.implausible:
                break
        return one

    def _of(self, one: CandidateFit, iterations: int) -> CandidateFit:
        engine, before, candidate = self.engine, self.before, one.candidate
        engine.progress(f"fitting {candidate.label}")
        options = {
            "fixed": self.fixed | dict(candidate.shape),
            "max_iterations": iterations,
            "tolerance": settings.COARSE,
            "near": one.fit is not None,
        }
        shape = dict(candidate.shape)
        first = shape | values_of(one.fit) if one.fit else linearised_end(engine, before, one)
        fits: list[joint.Fit] = []
        for start in (first, values_of(before) | shape):
            try:
                fit = engine.fit_like(before, [*effects_in(before), *candidate.names], start, **options)
            except joint.NoFit:
                continue
            if not _is_always_touched(engine, fit, candidate):
                fits.append(fit)
                if _cost(fit) <= _cost(before):  # else it went astray: where nothing acts, the fit before is reached
                    break
        if not fits:
            return replace(one, fit=None, refit=None)
        return self._by(one, min(fits, key=_cost))

    def _by(self, one: CandidateFit, fit: joint.Fit) -> CandidateFit:
        """What the candidate explains by a fit at the weights and noise of the fit before."""
        candidate, before, after = one.candidate, self._judged, Judged.of(self.engine, fit)
        refit = after.log_evidence - before.log_evidence - candidate.penalty
        explained = before.fraction_explained(after, len(candidate.names))
        # A chi-square removed has a standard deviation of twice its root.
        sd = 2 * np.sqrt(max(explained, 0.0) / max(before.unexplained, 1.0))
        implausible = tuple(implausible_values(self.engine.robot.n_tubes, fit, candidate))
        return replace(one, refit=refit, explained=explained, explained_sd=sd, fit=fit, implausible=implausible)

    def without_best(self, tried: list[CandidateFit]) -> tuple[joint.Fit, list[CandidateFit]]:
        """The fit before and the candidates, after a fit without the best candidate that begins where its fit ended:
        what that gains as well is no gain of the candidate, but another optimum of the calibration or of the effects
        before."""
        best = max((one for one in tried if one.fit), key=lambda one: one.score, default=None)
        if best is None:
            return self.before, tried
        engine, before = self.engine, self.before
        start = values_of(best.fit)
        there = engine.fit_like(before, effects_in(before), start, fixed=self.fixed, tolerance=settings.COARSE)
        if there.log_evidence <= before.log_evidence:
            return before, tried
        over_there = Refits(engine, there, self.fixed)
        return there, [over_there._by(one, one.fit) if one.fit else one for one in tried]


def _cost(fit: joint.Fit) -> float:
    """Chi-square of residual and prior under the noise of a fit."""
    return float(fit.admitted_chi_square + fit.shift_square)


def linearised_end(engine: Engine, before: joint.Fit, one: CandidateFit) -> dict[str, float]:
    """Values at which the refit will end if the model is linear."""
    fitted = one.candidate.names[: len(one.gain.values)]  # shapes that have no derivatives yet come after
    neutral, sd, _, _ = engine.priors(fitted)
    moved = before.values + before.priors.factor @ one.gain.calibration[: len(before.names)]
    own = dict(zip(fitted, neutral + sd * one.gain.values, strict=True))
    return dict(zip(before.names, map(float, moved), strict=True)) | dict(one.candidate.shape) | own


def implausible_values(n_tubes: int, fit: joint.Fit, candidate: Candidate) -> list[str]:
    """Values beyond the soft bounds of their effect, by more than two standard deviations."""
    known, found = catalogue.parameter_of(n_tubes), []
    for name in candidate.names:
        i, (low, high) = fit.names.index(name), known[name].soft
        if fit.values[i] + 2 * fit.sd[i] < low or fit.values[i] - 2 * fit.sd[i] > high:
            found.append(f"{name} = {fit.values[i]:.3g} {known[name].unit}".rstrip())
    return found


def _is_always_touched(engine: Engine, fit: joint.Fit, candidate: Candidate) -> bool:
    """Whether a surface lies where the tip hardly ever leaves it: a constant force, and no contact."""
    surface = catalogue.get(candidate.id, engine.robot.n_tubes).names_with("surface")
    if not surface:
        return False
    distance, *direction = ((dict(candidate.shape) | values_of(fit))[name] for name in surface)
    outside = starts.heights(engine, *direction) < distance
    return bool(np.mean(outside[engine.fitted]) < 1 - max(settings.SURFACE_OUTSIDE))


def decide(
    round_: Round, n_effects: int, accepted: list[CandidateFit], is_rejected: bool, surely: bool = False
) -> None:
    """Accepts the best candidate, with all that the data cannot tell from it, or says why not.

    n_effects that were looked at; is_rejected: whether the noise as stated does not explain the residual; surely:
    whether only the share counts that a candidate surely explains.
    """
    missed = settings.REJECTION_MISSED  # where the test rejects nothing
    round_.needed = settings.DECISIVE + np.log(n_effects)
    threshold = round_.needed + (0.0 if is_rejected else math.log((1 - missed) / missed))
    refitted = [one for one in round_.tried if one.fit is not None]
    fitted = [one for one in refitted if not (accepted and one.implausible)]
    if not fitted:
        round_.reason = "no candidate explains anything"
        if refitted:
            values = ", ".join(refitted[0].implausible)
            round_.reason = f"the best candidate, {refitted[0].id}, would need an implausible value, {values}"
        return
    best = fitted[0]
    its_forms = [one for one in fitted if one.id == best.id and best.score - one.score < settings.COARSE]
    best = min(its_forms, key=lambda one: len(one.candidate.shape))
    if best.score < threshold:
        round_.reason = (
            f"the best candidate, {best.id}, gains {best.score:.1f} in log evidence, less than {threshold:.1f}"
        )
        return
    if log_odds_of_cause(best.surely_explained if surely else best.explained, accepted) < 0:
        round_.is_spurious = log_odds_of_cause(best.explained + 2 * best.explained_sd, accepted) < 0
        rather = "imitates a cause outside the catalogue"
        if accepted:
            rather = f"makes up for errors in the forms of the effects before it, or {rather}"
        round_.reason = (
            f"the best candidate, {best.id}, explains only {best.explained:.0%} of the unexplained chi-square: more "
            f"probably it {rather}"
        )
        return
    rivals = [one for one in refitted if one.id != best.id]
    same = [one for one in rivals if best.score - one.score < settings.TIE]
    round_.accepted = best
    round_.ids = [best.id, *dict.fromkeys(one.id for one in same)]
    others = [one.score for one in rivals if one.id not in round_.ids]
    round_.margin = best.score - max(others, default=-np.inf)
