"""Stepwise selection of effects: forward, with a refinement of each one's form; then exchange and elimination of those
that the later ones show in another light."""

from dataclasses import dataclass, field, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.diagnose import outliers
from ctcr.diagnose.candidates import Candidate, forms, other_amplitudes
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.form_errors import log_odds_of_cause, log_odds_of_imitation
from ctcr.diagnose.round import CandidateFit, Judged, Round, parameters_of, run_round
from ctcr.effects import catalogue
from ctcr.fit import folds, joint


@dataclass
class Accepted:
    """An effect that was accepted."""

    best: CandidateFit  # in its best form
    round: Round  # that chose it
    log_evidence: float  # gained
    beside: float  # fraction that it surely explains of what all others leave of the unexplained chi-square
    residual: Array | None = None  # (M, 3) [m] with it and those accepted before

    @property
    def ids(self) -> list[str]:
        """Its id, and those of effects that the data cannot tell from it."""
        return self.round.ids

    @property
    def id(self) -> str:
        return self.best.id

    @property
    def explained(self) -> float:
        """Fraction of what those before it left of the unexplained chi-square."""
        return self.best.explained


@dataclass
class Selection:
    """Effects that were accepted so far, the rounds that led to them, and the fits without and with them."""

    engine: Engine
    history: list[Round] = field(default_factory=list)  # rounds that changed what is accepted, or what is as likely
    last: Round | None = None  # that accepted nothing
    accepted: list[Accepted] = field(default_factory=list)
    calibrated: joint.Fit | None = None  # without effects
    fit: joint.Fit | None = None  # with the accepted effects

    @property
    def fits(self) -> list[CandidateFit]:
        return [a.best for a in self.accepted]

    @property
    def rounds(self) -> list[Round]:
        return [*self.history, *([self.last] if self.last else [])]

    @property
    def finished(self) -> bool:
        """Whether another round would accept nothing."""
        return self.last is not None or len(self.accepted) == settings.MAX_EFFECTS

    def calibrate(self, fits: list[CandidateFit], start: dict[str, float]) -> joint.Fit:
        """Calibration and these effects together."""
        self.engine.progress("calibration")
        names, fixed = parameters_of(fits)
        return self.engine.fit_with_field(names, start, fixed)

    def grow(self, pool: list[Candidate], more: float = 1.0, surely: bool = False) -> None:
        """Accepts one effect after the other.

        more: how many times as many readings there are in all. Where these could change the outcome of a round, it is
        left to them. surely: as for decide()
        """
        while self.take_one(pool, more, surely):
            pass
        if self.finished:
            for a in self.accepted[:-1]:  # what the others hid of their forms shows now
                self.refine_form(a)

    def take_one(self, pool: list[Candidate], more: float = 1.0, surely: bool = False) -> bool:
        """Accepts the next effect; whether there is one. Arguments as for grow()."""
        if self.finished:
            return False
        round_ = self.decide_next(pool, surely)
        if more > 1 and not (round_.is_clear or round_.is_hopeless(more)):
            return False
        if round_.accepted and self._accept(round_):
            return True
        if more == 1 or round_.is_hopeless(more):
            self.last = round_
        return False

    def revise(self, pool: list[Candidate], more: float = 1.0) -> None:
        """Chooses each effect anew beside all the others, as long as that changes them: one that was accepted early was
        chosen before the later ones were known. Then drops those that are not surely causes. more: as for grow()"""
        seen: list[set[str]] = []
        surely = False
        while (found := {a.id for a in self.accepted}) not in seen:
            seen.append(found)
            if any(self._chosen_anew(a, pool) for a in self.accepted[:-1]):
                self.last = None
                self.grow(pool, more, surely)
            elif len(found) > 1 and self._without_weakest():
                surely, self.last = True, None
                self.grow(pool, more, surely)
        if len(seen) > 1:
            self.follow()

    def decide_next(self, pool: list[Candidate], surely: bool = False) -> Round:
        """The round for the next effect. It must not more probably imitate a cause outside the catalogue."""
        taken = {identity for a in self.accepted for identity in a.ids}
        round_ = self._round([c for c in pool if c.id not in taken], surely)
        best = round_.accepted
        if best and log_odds_of_imitation([one.explained for one in (*self.fits, best)]) > 0:
            beside = "together with effects before it, " if self.accepted else ""
            round_.reject(f"{beside}{best.id} more probably imitates a cause outside the catalogue")
        return round_

    def take_hidden(self, pool: list[Candidate]) -> bool:
        """Accepts an effect that acts on few readings, beside the others or in the place of one; whether there is one.
        In a fit with weights such readings look like outliers, so here all readings count alike."""
        for open_place in (None, *self.accepted):
            others = [a for a in self.accepted if a is not open_place]
            there = replace(self, engine=replace(self.engine, robust=False), accepted=others, last=None)
            there.history = [*self.history]
            if there.finished:
                continue
            there.fit = there.calibrate(there.fits, values_of(self.fit))
            round_ = there.decide_next(pool)
            round_.anew = open_place.id if open_place else ""
            there.engine = replace(self.engine)
            accepted = round_.accepted and there._accept(round_)
            if accepted and there.fit.log_evidence > self.fit.log_evidence + settings.DECISIVE:
                self.engine, self.history, self.last = there.engine, there.history, None
                self.accepted, self.fit = there.accepted, there.fit
                return True
        return False

    def converged(self, engine: Engine) -> joint.Fit:
        """The fit taken on to the tolerance of another engine, which then assumes the same initial history."""
        engine.progress("calibration")
        engine.measurements = self.engine.measurements
        return engine.continued(self.fit, parameters_of(self.fits)[1])

    def _without_weakest(self) -> bool:
        """Drops the effect that is least probably a cause beside the others, if it is more probably none."""

        def log_odds(a: Accepted) -> float:
            return log_odds_of_cause(a.beside, [b.best for b in self.accepted if b is not a])

        weakest = min(self.accepted, key=log_odds)
        if log_odds(weakest) >= 0:
            return False
        self.accepted = [a for a in self.accepted if a is not weakest]
        self.fit = self.calibrate(self.fits, values_of(self.fit))
        why = f"it surely explains only {max(weakest.beside, 0.0):.0%} of what the others leave"
        self.history.append(Round(self.fit.without_readings(), [], anew=weakest.id, reason=why))
        return True

    def _chosen_anew(self, a: Accepted, pool: list[Candidate]) -> bool:
        """Whether the place of this effect was given to another one, or to none."""
        self.engine.progress(f"without {a.id}")
        others = [b for b in self.accepted if b is not a]
        without = self._fit_with(others, settings.FIRST_ITERATIONS)  # the round goes on from there
        taken, rest = {b.id for b in others}, [b.best for b in others]
        known = replace(a.best, fit=self.fit)
        round_ = run_round(self.engine, without, [c for c in pool if c.id not in taken], rest, known)
        round_.anew = a.id
        a.log_evidence = max(one.score for one in round_.tried if one.id == a.id)
        if a.log_evidence < settings.DECISIVE:
            round_.reject(f"beside the others it gains only {a.log_evidence:.1f} in log evidence")
            there = replace(self, accepted=others)
            there.fit = there.calibrate(there.fits, values_of(round_.before))
        elif round_.accepted is None:
            return False
        elif a.id in round_.ids:
            if set(round_.ids) != set(a.ids):
                self.history.append(round_)
            a.round, a.beside = round_, next(one.surely_explained for one in round_.tried if one.id == a.id)
            return False
        else:
            best = round_.accepted
            one = Accepted(best, round_, best.refit, best.surely_explained)
            there = replace(self, accepted=[*others, one])
            there.fit = there.calibrate(there.fits, values_of(best.fit))
            there.refine_form(one)
            if there.fit.log_evidence <= self.fit.log_evidence:
                return False
        self.accepted, self.fit = there.accepted, there.fit
        self.history.append(round_)
        return True

    def _fit_with(self, some: list[Accepted], max_iterations: int = settings.ITERATIONS) -> joint.Fit:
        """Calibration with some of the accepted effects, at the weights and noise of the fit with all."""
        names, fixed = parameters_of([a.best for a in some])
        options = {"fixed": fixed, "tolerance": settings.COARSE, "near": False, "max_iterations": max_iterations}
        return self.engine.fit_like(self.fit, names, values_of(self.fit), **options)

    def follow(self) -> None:
        """The residual with one effect after the other, in the order in which they stand now."""
        fits = [self._fit_with(self.accepted[:k]) for k in range(1, len(self.accepted))]
        for a, fit in zip(self.accepted, [*fits, self.fit], strict=True):
            a.residual = fit.residual[:, :3]

    def _round(self, open_to: list[Candidate], surely: bool) -> Round:
        """The round that decides on the next effect.

        The fit before may have widened priors for what one of the candidates has done. So a first round begins without
        these widenings (Engine.less_widened). If it accepts nothing that is decisively likelier than the widened
        priors, a second round begins with them. If the round found a better optimum of the fit before, the selection
        goes on from there and runs the round again.
        """
        engine, fit = self.engine, self.fit
        before = engine.less_widened(fit, open_to, parameters_of(self.fits)[1])
        round_ = run_round(engine, before, open_to, self.fits, surely=surely)
        best = round_.accepted
        if before is not fit and not (best and best.fit.log_evidence > fit.log_evidence + settings.DECISIVE):
            before, round_ = fit, run_round(engine, fit, open_to, self.fits, surely=surely)
        if round_.before.log_evidence > before.log_evidence + settings.DECISIVE and self._goes_on_from(round_.before):
            return self._round(open_to, surely)
        return round_

    def _goes_on_from(self, there: joint.Fit) -> bool:
        """Takes another optimum of the same parameters, which a round came upon, if it is surely better."""
        fit = self.calibrate(self.fits, values_of(there))
        if fit.log_evidence < self.fit.log_evidence + settings.DECISIVE:
            return False
        self.fit = fit
        if not self.accepted:
            self.calibrated = fit
        return True

    def _accept(self, round_: Round) -> bool:
        """Adds the effect of a round in its best form, if its gain lasts: in a converged fit that finds the outliers
        anew, the readings must be decisively likelier than before."""
        best, engine, before = round_.accepted, self.engine, self.fit
        assumed = engine.measurements
        one = Accepted(best, round_, best.refit, best.surely_explained)
        self.history.append(round_)
        self.accepted.append(one)
        names, fixed = parameters_of(self.fits)
        converged = best.fit
        if not converged.converged:
            converged = engine.fit_like(before, names, values_of(converged), fixed=fixed)
        self.fit = self.calibrate(self.fits, values_of(converged))
        if self.fit.log_evidence < converged.log_evidence - settings.DECISIVE:  # new weights have lost the effect
            self.fit = engine.fit_like(before, names, values_of(converged), fixed=fixed)
        needs_history = "order" in catalogue.get(one.id, engine.robot.n_tubes).needs
        if needs_history and engine.revise_initial_history(self.fit, fixed):
            self.fit = self.calibrate(self.fits, values_of(self.fit))
        self.refine_form(one)
        gain = self.fit.log_evidence - before.log_evidence
        if gain < settings.DECISIVE:
            self.history.pop()
            self.accepted.pop()
            self.fit = before
            engine.measurements = assumed
            round_.refute(gain)
            return False
        one.residual = self.fit.residual[:, :3]
        return True

    def refine_form(self, one: Accepted) -> None:
        """Frees the shape of an accepted effect, and tries its other constitutive laws, where that helps.

        Where all of them are hardly right, its other amplitudes are tried too, if it was accepted last.
        """
        given, fit = one.best.candidate, self.fit
        effect = catalogue.get(given.id, self.engine.robot.n_tubes)
        others = other_amplitudes(effect, given) if one is self.accepted[-1] else []
        rejected = one.round.rejected_variants
        ended: list[tuple[joint.Fit, CandidateFit, joint.Fit]] = []  # calibrated anew, form, fit of the form
        for variant in (given, *others):
            tried = [form for form in forms(effect, variant, rejected) if form != given]
            freed = self._fit_forms(one, tried)
            gain = max((there.log_evidence for _, there in freed), default=-np.inf) - fit.log_evidence
            if variant is given and gain < settings.TIE:
                freed, ended = [], [(fit, one.best, fit)]
            for best, there in _best_of_each_law(freed, fit):
                ended.append((self.calibrate(self._with(one, best), values_of(there)), best, there))
                if np.max(ended[-1][0].inflation) < settings.INFLATION_EXPLAINED:
                    break  # it explains the readings: no other law can do more
            if min(np.max(calibrated.inflation) for calibrated, _, _ in ended) <= settings.INFLATION_WRONG:
                break
        self.fit, best, freed = max(ended, key=lambda end: end[0].log_evidence)
        if self.fit is not fit:
            before, after = Judged.of(self.engine, fit), Judged.of(self.engine, freed)
            more = before.fraction_explained(after, len(freed.names) - len(fit.names))
            explained = best.explained + (1 - best.explained) * more
            one.best = replace(best, fit=freed.without_readings(), explained=explained)
            one.beside += (1 - one.beside) * more

    def _with(self, one: Accepted, best: CandidateFit) -> list[CandidateFit]:
        """The accepted effects, one of them in another form."""
        return [best if a is one else a.best for a in self.accepted]

    def _fit_forms(self, one: Accepted, tried: list[Candidate]) -> list[tuple[CandidateFit, joint.Fit]]:
        """Forms of an accepted effect, each fitted in the noise of the fit with the given form."""
        found, fit, given = [], self.fit, one.best.candidate
        quick = {"max_iterations": settings.FIRST_ITERATIONS}
        for form in tried:
            self.engine.progress(f"freeing the shape of {form.id}")
            best = replace(one.best, candidate=form)
            names, fixed = parameters_of(self._with(one, best))
            neutral = dict(zip(form.names, self.engine.priors(form.names)[0], strict=True))
            known = neutral | one.round.rejected_variants | dict(form.shape) | values_of(fit)
            own = dict(set(form.shape) - set(given.shape))  # values of another law may be a bad start for this one
            starts = [known, known | own] if own.keys() & set(names) else [known | own]
            begun = [self.engine.fit_like(fit, names, start, fixed=fixed, **quick) for start in starts]
            there = max(begun, key=lambda end: end.log_evidence)
            if there.log_evidence > _least(fit):  # converged with a friction path of its own
                there = self.engine.fit_like(fit, names, values_of(there), fixed=fixed, tolerance=settings.TOLERANCE)
            found.append((best, there))
        return found


def select_effects(engine: Engine, pool: list[Candidate]) -> Selection:
    """The effects that explain the fitted readings. Of many readings a part decides rounds whose outcome is sure; fits
    that decide need not be converged, only the one whose values are quoted."""
    coarse = replace(engine, tolerance=settings.COARSE)
    chosen = Selection(coarse)
    few = folds.few_of(engine.fitted)
    start_plain, start = {}, {}
    if few is not None:
        engine.progress("a part of the readings first")
        chosen.engine = coarse.part(few)
        chosen.calibrated = chosen.fit = chosen.calibrate([], {})
        more = float(np.sum(engine.fitted) / np.sum(few))
        chosen.grow(pool, more)
        chosen.revise(pool, more)
        start_plain, start = values_of(chosen.calibrated), values_of(chosen.fit)
        from_home = chosen.engine.measurements.from_home
        coarse.measurements, chosen.engine = replace(coarse.measurements, from_home=from_home), coarse
    chosen.calibrated = chosen.fit = chosen.calibrate([], start_plain)
    if chosen.accepted:
        chosen.fit = chosen.calibrate(chosen.fits, start)
        chosen.follow()
    if not chosen.finished:
        chosen.grow(pool)
    if few is None:
        chosen.revise(pool)
    fit = chosen.converged(engine)
    if outliers.hide_an_effect(engine.measurements, fit) and chosen.take_hidden(pool):
        chosen.grow(pool)
        if few is None:
            chosen.revise(pool)
        fit = chosen.converged(engine)
    chosen.engine, chosen.fit = engine, fit
    if not chosen.accepted:
        chosen.calibrated = fit
    return chosen


def _best_of_each_law(
    tried: list[tuple[CandidateFit, joint.Fit]], fit: joint.Fit
) -> list[tuple[CandidateFit, joint.Fit]]:
    """The forms that are calibrated anew, the best first: the best one alone, or the best of each constitutive law.

    Several laws are kept where the noise of the fit before is so inflated that its law must be wrong. Evidences under
    such noise hardly tell laws apart; only hopeless ones are left out.
    """
    tried = sorted(tried, key=lambda pair: -pair[1].log_evidence)
    if np.max(fit.inflation) <= settings.INFLATION_WRONG:
        return tried[:1]
    laws: dict[tuple, tuple[CandidateFit, joint.Fit]] = {}
    for best, freed in tried:
        if freed.log_evidence > _least(fit):
            held = tuple(pair for pair in best.candidate.shape if pair[0] not in best.candidate.names)
            laws.setdefault(held, (best, freed))
    return list(laws.values())


def _least(fit: joint.Fit) -> float:
    """Log evidence below which another form of its effects is hopeless: 1 less for each number read, as by three times
    the mean square error."""
    return fit.log_evidence - fit.observations
