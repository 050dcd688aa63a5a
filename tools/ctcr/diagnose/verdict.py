"""The verdict: one word for programs, plain sentences for people."""

from dataclasses import dataclass, field

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask
from ctcr.diagnose.residual import Residual
from ctcr.diagnose.selection import Accepted
from ctcr.fit import joint
from ctcr.show.wording import listed


@dataclass
class Verdict:
    word: str  # nothing_missing, identified, probable, ambiguous, stand_in, not_in_catalogue
    sentences: list[str] = field(default_factory=list)

    @property
    def names_no_cause(self) -> bool:
        """Whether something is missing, and no effect of the catalogue is said to be it."""
        return self.word in ("stand_in", "not_in_catalogue")


def judge(
    calibrated: joint.Fit,
    with_effects: joint.Fit,
    accepted: list[Accepted],
    residual: Residual,
    judged: Mask,
    explained: dict[str, float],
    outdone: bool,
) -> Verdict:
    """
    judged     (M,) held-out rows that count
    explained  fraction of the unexplained chi-square that effects explain, by held-out run (held_out.explained_by_run).
               The median run says whether they are spurious: one may be off for reasons of its own
    outdone    whether a varying-coefficient model without effects explains far more
    """
    jitter = np.sqrt(3) * 1e3 * with_effects.noise.position_jitter
    before, after = (max(fit.rms_mm(judged) ** 2 - jitter**2, 1e-12) for fit in (calibrated, with_effects))
    if not accepted:
        if not residual.structured:
            return Verdict("nothing_missing", ["Calibration and the tracker's noise explain these measurements."])
        missing = "Something is missing that no effect of the catalogue explains."
        return Verdict("not_in_catalogue", [missing, *residual.about_clusters])
    first = accepted[0]
    typical = float(np.median([*explained.values()])) if explained else first.explained
    if residual.rejected and typical < settings.NOT_SPURIOUS:
        return Verdict("stand_in", [f"Adding {first.id} removes part of the error, but much of it stays."])
    if outdone:
        return Verdict("stand_in", [f"Calibration that is not constant explains far more than {first.id} does."])
    if after > max(settings.MISLED * before, jitter**2):
        return Verdict("stand_in", [f"With {first.id} the prediction of held-out runs is worse."])
    if any(a.best.implausible for a in accepted):
        return Verdict("stand_in", ["The data ask for implausible values.", *first.best.implausible])
    if any(len(a.ids) > 1 for a in accepted):
        return Verdict("ambiguous", ["These data cannot tell some effects apart."])
    if any(a.margin < settings.DECISIVE for a in accepted):
        return Verdict("probable", ["Another effect is nearly as likely."])
    names = " and ".join(a.id for a in accepted)
    verb = "explains" if len(accepted) == 1 else "explain"
    odd = [run for run, fraction in explained.items() if fraction < settings.NOT_SPURIOUS]
    if residual.rejected and (typical < settings.MOSTLY or odd):
        stays = [f"Much of the error in {listed(odd)} stays."] if odd else []
        most = (
            f"In the median held-out run {names} {verb} {typical:.0%} of the chi-square that noise leaves unexplained."
        )
        more = "The residual is more than noise: the constitutive law may be another one, or something else acts too."
        return Verdict("probable", [most, *stays, more])
    return Verdict("identified", [f"Given this catalogue, {names} {verb} the error."])
