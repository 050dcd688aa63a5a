"""Sections IV and V: Figures 3 to 6 and what the text says of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ctcr.reproduce.claim import Claim
from ctcr.reproduce.robot import paper_robot
from ctcr.sensitivity import closed_loop, open_loop
from ctcr.sensitivity.ranges import all_varied
from ctcr.track.runs import Run, run_all
from ctcr.track.scenario import shipped
from ctcr.track.summary import errors_mm, figures

PLACES = "the paper does not say where its cube, its limits and its gains are"
KINDS = {
    "rotation offset": 210,
    "precurvature": 236,
    "curved length": 281,
    "Young's modulus": 265,
    "wall thickness": 85,
}


@dataclass(frozen=True)
class Scenarios:
    """Runs of S1 to S5, by name and weight [g]."""

    runs: dict[tuple[str, float], list[Run]]


def scenarios(repetitions: int, advance: Callable[[float], None]) -> Scenarios:
    robot, found = paper_robot(), {}
    for name in ("S1", "S2", "S3", "S4", "S5"):
        scenario = shipped(name)
        scenario.repetitions = repetitions
        runs = run_all(scenario, robot, robot, advance)
        found |= {(name, mass): [run for run in runs if run.mass_g == mass] for mass in scenario.load.mass_g}
    return Scenarios(found)


def tracking_claims(s: Scenarios) -> list[Claim]:
    of = {key: figures(runs) for key, runs in s.runs.items()}
    free = of["S2", 0.0]

    def failed(name: str, masses: list[float]) -> float:
        return 100 * float(np.mean([of[name, mass]["failed"] / of[name, mass]["runs"] for mass in masses]))

    usual = [runs for (name, mass), runs in s.runs.items() if name in ("S2", "S3", "S4") and mass <= 20]
    errors = errors_mm([run for runs in usual for run in runs])
    simulated = "ours are simulated; the paper's are of its robot, whose model is not exact"
    added = [20.0, "S3"]
    return [
        Claim("IV.D", "S1: runs that fail", 100, failed("S1", [0.0]), "%"),
        Claim("IV.D", "S2: runs that fail", 0, failed("S2", [0.0]), "%"),
        Claim("IV.D", "S3 and S4 up to 20 g: runs that fail", 0,
              failed("S3", [0.0, 5, 10, 15, 20]) + failed("S4", [0.0, 5, 10, 15, 20]), "%"),
        Claim("IV.D", "S3 and S4 above 20 g: runs that fail", 100,
              0.5 * (failed("S3", [25.0, 30]) + failed("S4", [25.0, 30])), "%"),
        Claim("IV.D", "S5 (beyond the paper) at 25 g: runs that fail", 100, failed("S5", [25.0]), "%",
              "force estimated, the other joints take over from the one at its limit"),
        Claim("IV.D", "20 g unknown: increase of the mean error", 0.01,
              of[added[1], added[0]]["mean_mm"] - free["mean_mm"], "mm", PLACES),
        Claim("IV.D", "20 g unknown: increase of the largest error", 0.3,
              of[added[1], added[0]]["max_mm"] - free["max_mm"], "mm", PLACES),
        Claim("Fig. 6", "largest error of all", 1.22, errors.max(), "mm", simulated),
        Claim("Fig. 6", "errors below 1 mm", 99.8, 100 * (errors < 1).mean(), "%", simulated),
        Claim("Fig. 6", "errors below 0.88 mm", 99.2, 100 * (errors < 0.88).mean(), "%", simulated),
        Claim("VI", "mean error under unknown loads", 0.29, errors_mm(s.runs["S3", 20.0]).mean(), "mm", simulated),
    ]  # fmt: skip


def sensitivity(configurations: int, points: int, advance: Callable[[float], None]):
    """Open and closed loop of the paper's robot."""
    robot = paper_robot()
    varied = all_varied(robot)
    opened = open_loop.study(robot, varied, configurations, advance=advance)
    closed = closed_loop.study(robot, varied, shipped("S2"), points=points, advance=advance)
    return opened, closed


def sensitivity_claims(opened: open_loop.OpenLoop, closed: closed_loop.ClosedLoop) -> list[Claim]:
    def total(kind: str, of: str = "worst_maximum") -> float:
        return 1e3 * sum(getattr(curve, of) for curve in closed.curves if curve.varied.kind == kind)

    def exact(kinds: tuple[str, ...]) -> float:
        return sum(total(kind) for kind in kinds)

    gain = "our feedback is faster; sum of the three tubes"
    last = tuple(kind for kind in KINDS if kind != "rotation offset")
    largest = max(one.maximum for one in opened.influences)
    frame = tuple({c.varied.kind for c in closed.curves if c.varied.tube is None})
    return [
        *(Claim("Fig. 4, V.A", f"{kind}: increase of the largest error", paper, total(kind), "um", gain)
          for kind, paper in KINDS.items()),
        Claim("V.A", "Poisson's ratio: increase of the largest error", 0, total("Poisson's ratio"), "um"),
        Claim("V.A", "translation offset, length and T_ref: increase of the largest error", 15,
              exact(("translation offset", "length", *frame)), "um",
              "ours over all of +-5 mm, +-3 mm and +-3 deg; the paper's over its uncertainties, 1 mm, 0.5 mm, 0.3 deg"),
        Claim("V.A", "all others, worst case: increase of the largest error", 867, exact(last), "um", gain),
        Claim("V.A", "all others, worst case: increase of the mean error", 304,
              sum(total(kind, "worst_mean") for kind in last), "um", gain),
        Claim("V.A", "open loop: largest change of a predicted tip", 30, largest, "mm", "the paper: a few centimetres"),
        Claim("V.A", "open loop against closed loop", 100,
              1e3 * largest / max(max(1e3 * c.worst_maximum for c in closed.curves), 1e-9), "",
              "the paper: around a hundred times"),
    ]  # fmt: skip
