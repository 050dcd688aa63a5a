"""Section V.A: Figure 4 and the effect of wrong parameters in open and in closed loop."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from ctcr.reproduce.paper import Claim, paper_robot
from ctcr.sensitivity import closed_loop, open_loop
from ctcr.sensitivity.ranges import Varied, all_varied
from ctcr.track.scenario import Scenario, shipped

SLOW_FEEDBACK = 7.0  # [1/s] at which closed-loop influences come nearest to the paper's
KINDS = {  # increase of the largest error in the paper [um]
    "rotation offset": 210,
    "precurvature": 236,
    "curved length": 281,
    "Young's modulus": 265,
    "wall thickness": 85,
}
# Uncertainty of the parameters that are simple to measure, in the unit of their range.
MEASURED = {"translation offset": 1.0, "length": 1.0, "tracker position": 0.5, "tracker rotation": 0.3}


@dataclass(frozen=True)
class Influence:
    """Wrong parameters: in open loop, and in closed loop with our feedback and with a slow one."""

    opened: open_loop.OpenLoop
    fast: closed_loop.ClosedLoop
    slow: closed_loop.ClosedLoop
    measured_fast: closed_loop.ClosedLoop
    measured_slow: closed_loop.ClosedLoop


def study(configurations: int, points: int, advance: Callable[[float], None]) -> Influence:
    """The study of the paper's robot; advance(1) is called for each configuration and each run."""
    robot = paper_robot()
    varied = all_varied(robot)
    known = [_as_measured(one) for one in varied if _measured(one)]
    slow = shipped("S2")
    slow.tasks.feedback_per_s = SLOW_FEEDBACK

    def closed(which: list[Varied], scenario: Scenario, count: int) -> closed_loop.ClosedLoop:
        return closed_loop.study(robot, which, scenario, points=count, advance=advance)

    return Influence(
        open_loop.study(robot, varied, configurations, advance=advance),
        closed(varied, shipped("S2"), points),
        closed(varied, slow, points),
        closed(known, shipped("S2"), 3),
        closed(known, slow, 3),
    )


def _measured(one: Varied) -> float | None:
    """Its uncertainty where it is simple to measure, in its unit."""
    return next((size for kind, size in MEASURED.items() if one.kind.startswith(kind)), None)


def _as_measured(one: Varied) -> Varied:
    size = _measured(one)
    return replace(one, low=-size, high=size, at=lambda fraction: one.at(fraction * size / one.high))


def claims(s: Influence) -> list[Claim]:
    """The paper's claims on wrong parameters."""

    def total(study: closed_loop.ClosedLoop, *kinds: str, of: str = "worst_maximum") -> float:
        return 1e3 * sum(getattr(curve, of) for curve in study.curves if curve.varied.kind in kinds)

    own = shipped("S2").tasks.feedback_per_s
    gain = f"sum of the three tubes with a feedback of {SLOW_FEEDBACK:g} 1/s; the paper does not state its own"
    ours = f"with the feedback of our scenarios, {own:g} 1/s: the faster it is, the less a wrong Jacobian matters"
    near = f"{gain}; 15 um lie between 10 and 15 1/s"
    last = [kind for kind in KINDS if kind != "rotation offset"]
    listed = "worst case of " + ", ".join(last[:-1]) + " and " + last[-1]
    simple = "worst case of translation offset and length (1 mm), T_ref (0.5 mm, 0.3 deg)"
    opened = max(one.maximum for one in s.opened.influences)
    ratio = opened / max(curve.worst_maximum for curve in s.slow.curves)
    increase = "increase of the largest error"
    found = [
        Claim("Fig. 4, V.A", f"{kind}: {increase}", paper, total(s.slow, kind), "um", gain)
        for kind, paper in KINDS.items()
    ]
    found.append(Claim("V.A", f"Poisson's ratio: {increase}", 0, total(s.slow, "Poisson's ratio"), "um", gain))
    for error, of, paper in (("largest", "worst_maximum", 867), ("mean", "worst_mean", 304)):
        for loop, why in ((s.slow, gain), (s.fast, ours)):
            text = f"{listed}: increase of the {error} error"
            found.append(Claim("V.A", text, paper, total(loop, *last, of=of), "um", why))
    for loop, why in ((s.measured_slow, near), (s.measured_fast, ours)):
        found.append(Claim("V.A", f"{simple}: {increase}", 15, 1e3 * loop.cumulated_maximum, "um", why))
    text = "the paper: around a hundred times; with a feedback of 7 1/s"
    return [
        *found,
        Claim("V.A", "open loop: largest change of a predicted tip", 30, opened, "mm", "the paper: a few centimetres"),
        Claim("V.A", "open loop against closed loop", 100, ratio, "", text),
    ]
