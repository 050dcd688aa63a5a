"""Forward selection of effects with a refinement of each one's form, then backward elimination."""

from dataclasses import dataclass, field, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.diagnose import segment_delays
from ctcr.diagnose.candidates import Candidate, forms, other_amplitudes
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.round import CandidateFit, Round, fraction_explained, parameters_of, run_round
from ctcr.effects import catalogue
from ctcr.fit import folds, joint


@dataclass
class Accepted:
    """An effect that was accepted, with all that the data cannot tell from it."""

    best: CandidateFit  # in its best form
    ids: list[str]
    log_evidence: float
    margin: float
    residual: Array | None = None  # (M, 3) [m] with it and those accepted before
    rejected_variants: dict[str, float] = field(default_factory=dict)  # fitted values of its other variants

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
    rounds: list[Round] = field(default_factory=list)
    accepted: list[Accepted] = field(default_factory=list)
    calibrated: joint.Fit | None = None  # without effects
    fit: joint.Fit | None = None  # with the accepted effects
    finished: bool = False  # whether another round would accept nothing

    @property
    def fits(self) -> list[CandidateFit]:
        return [a.best for a in self.accepted]

    def calibrate(self, fits: list[CandidateFit], start: dict[str, float]) -> joint.Fit:
        """Calibration and these effects together."""
        self.engine.progress("calibration")
        names, fixed = parameters_of(fits)
        return self.engine.fit_with_field(names, start, fixed)

    def grow(self, pool: list[Candidate], more: float = 1.0) -> None:
        """Accepts one effect after the other.

        more: how many times as many readings there are in all. Where these could change the outcome of a round, it is
        left to them.
        """
        while len(self.accepted) < settings.MAX_EFFECTS:
            taken = {identity for a in self.accepted for identity in a.ids}
            open_to = [c for c in pool if c.id not in taken]
            round_ = self._round(open_to)
            sure = round_.is_hopeless(more) or (len(round_.ids) == 1 and round_.margin >= settings.DECISIVE)
            if more > 1 and not sure:
                return
            self.rounds.append(round_)
            if round_.accepted is None:
                break
            self._accept(round_)
        for a in self.accepted[:-1]:  # what the others hid of their forms shows now
            self.refine_form(a)
        self.finished = True

    def _round(self, open_to: list[Candidate]) -> Round:
        """A round before which no prior was widened for what one of its candidates may have done; where it accepts
        nothing that is likelier than the wider priors, one with these."""
        engine, fit = self.engine, self.fit
        before = engine.less_widened(fit, open_to, parameters_of(self.fits)[1])
        round_ = run_round(engine, before, open_to, self.fits)
        best = round_.accepted
        if before is fit or (best and best.fit.log_evidence > fit.log_evidence + settings.DECISIVE):
            return round_
        return run_round(engine, fit, open_to, self.fits)

    def _accept(self, round_: Round) -> None:
        """Adds the effect of a round in its best form."""
        best, engine, before = round_.accepted, self.engine, self.fit
        engine.robust = True
        variants = round_.rejected_variants
        one = Accepted(best, round_.ids, best.refit, round_.margin, rejected_variants=variants)
        self.accepted.append(one)
        names, fixed = parameters_of(self.fits)
        converged = best.fit
        if not converged.converged:
            converged = engine.fit_like(before, names, values_of(converged), fixed=fixed)
        self.fit = self.calibrate(self.fits, values_of(converged))
        if self.fit.log_evidence < converged.log_evidence - settings.LOST_TO_OUTLIERS:
            self.fit = engine.fit_like(before, names, values_of(converged), fixed=fixed)
        needs_history = "order" in catalogue.get(one.id, engine.robot.n_tubes).needs
        if needs_history and engine.revise_initial_history(self.fit, names, fixed):
            self.fit = self.calibrate(self.fits, values_of(self.fit))
        self.refine_form(one)
        one.residual = self.fit.residual[:, :3]

    def refine_form(self, one: Accepted) -> None:
        """Frees the shape of an accepted effect, and tries its other constitutive laws, where that helps.

        Where all of them are hardly right, its other amplitudes are tried too, if it was accepted last.
        """
        given, fit = one.best.candidate, self.fit
        effect = catalogue.get(given.id, self.engine.robot.n_tubes)
        others = other_amplitudes(effect, given) if one is self.accepted[-1] else []
        ended: list[tuple[joint.Fit, CandidateFit, joint.Fit]] = []  # calibrated anew, form, fit of the form
        for variant in (given, *others):
            tried = [form for form in forms(effect, variant, one.rejected_variants) if form != given]
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
            more = fraction_explained(fit, freed, len(freed.names) - len(fit.names))
            explained = best.explained + (1 - best.explained) * more
            one.best = replace(best, fit=freed.without_readings(), explained=explained)

    def _with(self, one: Accepted, best: CandidateFit) -> list[CandidateFit]:
        """The accepted effects, one of them in another form."""
        return [best if a is one else a.best for a in self.accepted]

    def _fit_forms(self, one: Accepted, tried: list[Candidate]) -> list[tuple[CandidateFit, joint.Fit]]:
        """Forms of an accepted effect, each fitted in the noise of the fit with the given form."""
        found, fit = [], self.fit
        for form in tried:
            self.engine.progress(f"freeing the shape of {form.id}")
            best = replace(one.best, candidate=form)
            names, fixed = parameters_of(self._with(one, best))
            neutral = dict(zip(form.names, self.engine.priors(form.names)[0], strict=True))
            start = neutral | one.rejected_variants | dict(form.shape) | values_of(fit)
            found.append((best, self.engine.fit_like(fit, names, start, fixed=fixed)))
        return found

    def eliminate(self) -> None:
        """Drops one accepted effect that the later ones have made superfluous."""
        for a in self.accepted[:-1]:
            rest = [b.best for b in self.accepted if b is not a]
            self.engine.progress(f"without {a.id}")
            names, fixed = parameters_of(rest)
            start, options = values_of(self.fit), {"fixed": fixed, "tolerance": settings.COARSE, "near": False}
            # A fit that is far behind need not converge.
            for iterations in (settings.FIRST_ITERATIONS, settings.ITERATIONS):
                without = self.engine.fit_like(self.fit, names, start, max_iterations=iterations, **options)
                evidence = segment_delays.log_evidence
                a.log_evidence = evidence(self.engine, self.fit) - evidence(self.engine, without)
                if a.log_evidence > settings.SURELY_NEEDED:
                    break
                start = values_of(without)
            if a.log_evidence < settings.DECISIVE:
                self.accepted.remove(a)
                self.fit = self.calibrate(rest, values_of(without))
                return


def select_effects(engine: Engine, pool: list[Candidate]) -> Selection:
    """The effects that explain the fitted readings. Of many readings a part decides rounds whose outcome is sure; fits
    that decide need not be converged, only those that are returned."""
    coarse = replace(engine, tolerance=settings.COARSE)
    chosen = Selection(coarse)
    few = folds.few_of(engine.fitted)
    start_plain, start = {}, {}
    if few is not None:
        engine.progress("a part of the readings first")
        chosen.engine = replace(coarse, rows=few)
        chosen.fit = chosen.calibrate([], {})
        start_plain = values_of(chosen.fit)
        chosen.grow(pool, more=np.sum(engine.fitted) / np.sum(few))
        start = values_of(chosen.fit)
        coarse.measurements, chosen.engine = chosen.engine.measurements, coarse
    chosen.calibrated = chosen.fit = chosen.calibrate([], start_plain)
    if chosen.accepted:
        coarse.robust = True
        chosen.fit = chosen.calibrate(chosen.fits, start)
    if not chosen.finished:
        chosen.grow(pool)
    if len(chosen.accepted) > 1:
        chosen.eliminate()
    engine.measurements, chosen.engine = coarse.measurements, engine
    chosen.calibrated, start = chosen.calibrate([], values_of(chosen.calibrated)), values_of(chosen.fit)
    engine.robust = coarse.robust
    chosen.fit = chosen.calibrate(chosen.fits, start) if chosen.accepted else chosen.calibrated
    return chosen


def _best_of_each_law(
    tried: list[tuple[CandidateFit, joint.Fit]], fit: joint.Fit
) -> list[tuple[CandidateFit, joint.Fit]]:
    """The best form alone; or that of each constitutive law, the best first, where the noise of the fit before is so
    inflated that its law must be wrong: in such noise laws can hardly be told apart, but for hopeless ones."""
    tried = sorted(tried, key=lambda pair: -pair[1].log_evidence)
    if np.max(fit.inflation) <= settings.INFLATION_WRONG:
        return tried[:1]
    least = fit.log_evidence - settings.HOPELESS * fit.observations
    laws: dict[tuple, tuple[CandidateFit, joint.Fit]] = {}
    for best, freed in tried:
        if freed.log_evidence > least:
            held = tuple(pair for pair in best.candidate.shape if pair[0] not in best.candidate.names)
            laws.setdefault(held, (best, freed))
    return list(laws.values())
