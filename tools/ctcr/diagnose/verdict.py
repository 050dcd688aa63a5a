"""The verdict: one word for programs, plain sentences for people."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ctcr.diagnose import race as racing
from ctcr.diagnose.accepted import Accepted
from ctcr.diagnose.leftover import Leftover
from ctcr.fit import joint
from ctcr.show.output import listed

# Share of what noise does not explain of locked runs that effects must explain to be no stand-ins, and
EXPLAINED = 0.75
MOSTLY = 0.8  # ... to be identified where more than noise is left, if no run is left by a stand-in's share
SHOWN = 6  # runs that are named
MISLED = 2.0  # times the square of that error beyond noise, at which effects predict worse than none


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
    leftover: Leftover,
    judged: NDArray[np.bool_],
    explained: dict[str, float],
    outdone: bool,
) -> Verdict:
    """explained: of each locked run, the share that effects explain of what noise does not, as of other_runs.explained.
    The median run says whether they are stand-ins: one may be off for reasons of its own. outdone: whether parameters
    that are not constant explain far more.
    """
    jitter = np.sqrt(3) * 1e3 * with_effects.noise.position_jitter
    before, after = (max(fit.rms_mm(judged) ** 2 - jitter**2, 1e-12) for fit in (calibrated, with_effects))
    if not accepted:
        if not leftover.structured:
            return Verdict("nothing_missing", ["Calibration and the tracker's noise explain these measurements."])
        missing = "Something is missing that no effect of the catalogue explains."
        return Verdict("not_in_catalogue", [missing, *leftover.at_places])
    first = accepted[0]
    share = float(np.median([*explained.values()])) if explained else first.share
    if leftover.rejected and share < EXPLAINED:
        return Verdict("stand_in", [f"Adding {first.entry.id} removes part of the error, but much of it stays."])
    if outdone:
        return Verdict("stand_in", [f"Calibration that is not constant explains far more than {first.entry.id} does."])
    if after > max(MISLED * before, jitter**2):
        return Verdict("stand_in", [f"With {first.entry.id} the runs that no fit saw are predicted worse."])
    if any(a.entry.implausible for a in accepted):
        return Verdict("stand_in", ["The data want values that are hardly possible.", *first.entry.implausible])
    if any(len(a.ids) > 1 for a in accepted):
        return Verdict("ambiguous", ["These data cannot tell some effects apart."])
    if any(a.margin < racing.SURE for a in accepted):
        return Verdict("probable", ["Another effect is nearly as likely."])
    names = " and ".join(a.entry.id for a in accepted)
    verb = "explains" if len(accepted) == 1 else "explain"
    odd = [run for run, part in explained.items() if part < EXPLAINED]
    if leftover.rejected and (share < MOSTLY or odd):
        stays = [f"Much of the error in {listed(odd, SHOWN)} stays."] if odd else []
        return Verdict(
            "probable",
            [
                f"Of what noise does not explain of a run that no fit saw, {names} {verb} {share:.0%} (median).",
                *stays,
                "More than noise is left: the law may be another one, or something else acts too.",
            ],
        )
    return Verdict("identified", [f"Given this catalogue, {names} {verb} the error."])
