"""The result of a scenario: each run with its errors and its verdict, and the numbers of each weight."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ctcr.arrays import Array, Mask
from ctcr.track.scenario import TASKS, Scenario

FAR = 10e-3  # [m] from the obstacle's surface; errors nearer to it do not count, as the tip must deviate there
FAILED = 1e-3  # [m] error above which a run has failed
UNSETTLED = 1e-3  # [m] distance from the start of the path above which a run has not started
COLUMNS = {
    "weight": "at the tip",
    "mean, mm": "mean distance of the tip from its reference",
    "p99.8, mm": "998 of 1000 distances are below",
    "max, mm": "largest distance",
    "< 1 mm, %": "fraction of the distances below 1 mm",
    "obstacle, mm": "least distance of the tip from the obstacle",
    "failed": "runs that failed",
}


@dataclass(frozen=True)
class Run:
    """One run; rows are control periods. Positions [m], base frame of the plant."""

    mass_g: float
    repetition: int
    status: str
    settled: float  # distance to the start of the path when it begins [m]
    time: Array  # (R,) [s]
    joints: Array  # (R, 2N) beta [m], alpha [rad]
    tip: Array  # (R, 3) without noise
    wanted: Array  # (R, 3) the reference
    shortfall: Array  # (R, tasks): above 1 the task gave way
    held: NDArray[np.int32]  # (R, 4) bits of the tubes held at base gaps, tip gaps, travel; speed
    force: Array  # (R, 3) [N] tip force in the controller's model
    stability: Array  # (R,) det B_u
    far: Mask  # (R,) whether the reference is far from the obstacle
    clearance: float  # least distance between tip and obstacle [m]; infinite without one

    @property
    def started(self) -> bool:
        return self.settled <= UNSETTLED and len(self.time) > 0

    @property
    def error(self) -> Array:
        """Distance between tip and reference (R,) [m]."""
        return np.linalg.norm(self.tip - self.wanted, axis=1)

    @property
    def counted(self) -> Array:
        """Errors where the reference is far from the obstacle [m]."""
        return self.error[self.far]

    @property
    def at_limit(self) -> Mask:
        """(R,) whether a position limit held the step."""
        return (self.held[:, :3] > 0).any(axis=1)

    @property
    def failed(self) -> bool:
        if not self.started or self.status != "ok" or self.clearance < 0:
            return True
        return bool((self.counted > FAILED).any())

    def limits_in_words(self) -> list[str]:
        """The position limits that held it, in the order of the time when they first did."""
        n, said = self.joints.shape[1] // 2, {}
        for row in np.flatnonzero(self.at_limit):
            for kind, tube in np.ndindex(3, n):
                if self.held[row, kind] >> tube & 1:
                    said.setdefault((kind, tube), self.time[row])
        return [f"{limit_in_words(kind, tube, n)} (from {time:.1f} s)" for (kind, tube), time in said.items()]

    def given_way(self) -> dict[str, float]:
        """Fraction of the time in which each task gave way, of those that did [0..1]."""
        fraction = (self.shortfall > 1).mean(axis=0) if len(self.time) else np.zeros(len(TASKS))
        return {name: float(part) for name, part in zip(TASKS, fraction, strict=True) if part > 0}

    def verdict(self) -> str:
        """Whether it followed the path, and if not, the cause."""
        if not self.started:
            return f"failed: the start of the path is not reached, the tip stays {1e3 * self.settled:.1f} mm away"
        if self.status != "ok":
            return f"failed at {self.time[-1]:.1f} s: {self.status}"
        if self.clearance < 0:
            return f"failed: the tip is {-1e3 * self.clearance:.2f} mm inside the obstacle"
        limits = "; ".join(self.limits_in_words())
        if self.failed:
            row = int(np.argmax(np.where(self.far, self.error, 0)))
            error = f"the tip is off by up to {1e3 * self.error[row]:.1f} mm (at {self.time[row]:.1f} s)"
            return f"failed: {limits or 'tracking gave way to the other tasks'}; {error}"
        return f"done, held at limits: {limits}" if limits else "done"


def limit_in_words(kind: int, tube: int, n: int) -> str:
    """A position limit of a tube (from 0) of n; kinds are base gap, tip gap and travel."""
    if kind == 2:
        return f"travel of tube {tube + 1}"
    beside = f"that of tube {tube + 2}" if tube + 1 < n else "the front plate"
    return f"{('base', 'tip')[kind]} of tube {tube + 1} against {beside}"


def beside_obstacle(scenario: Scenario, tip: Array, wanted: Array) -> tuple[Mask, float]:
    """The values of Run.far and Run.clearance."""
    if not scenario.obstacle:
        return np.ones(len(wanted), bool), np.inf
    centre, radius = 1e-3 * np.array(scenario.obstacle.centre_mm), 1e-3 * scenario.obstacle.radius_mm
    clearance = float(np.linalg.norm(tip - centre, axis=1).min()) - radius if len(tip) else np.inf
    return np.linalg.norm(wanted - centre, axis=1) > radius + FAR, clearance


def by_mass(runs: list[Run]) -> dict[float, list[Run]]:
    """The runs of each weight [g], in order."""
    return {mass: [run for run in runs if run.mass_g == mass] for mass in sorted({run.mass_g for run in runs})}


def worst(runs: list[Run]) -> Run:
    """A failed run if there is one, and of these the one with the largest error; one that never started comes first."""
    return max(runs, key=lambda run: (run.failed, run.counted.max() if run.started else np.inf))


def errors_mm(runs: list[Run]) -> Array:
    """Errors of all rows that count [mm]."""
    return np.concatenate([1e3 * run.counted for run in runs if run.started] or [np.empty(0)])


def figures(runs: list[Run]) -> dict[str, Any]:
    """The numbers of one weight."""
    error = errors_mm(runs)
    known, bad = len(error) > 0, worst(runs)
    return {
        "runs": len(runs),
        "failed": sum(run.failed for run in runs),
        "mean_mm": float(error.mean()) if known else None,
        "p99_8_mm": float(np.percentile(error, 99.8)) if known else None,
        "max_mm": float(error.max()) if known else None,
        "below_1_mm_percent": float(100 * (error < 1).mean()) if known else None,
        "obstacle_mm": 1e3 * min(run.clearance for run in runs),
        "held_periods": int(sum(run.at_limit.sum() for run in runs)),
        "verdict": bad.verdict(),
        "gave_way": bad.given_way(),
    }


def summary(runs: list[Run]) -> dict[str, Any]:
    """The figures of each weight, by its name, such as "20 g"."""
    return {f"{mass:g} g": figures(group) for mass, group in by_mass(runs).items()}


def rows(numbers: dict[str, dict[str, Any]]) -> list[list[str]]:
    """The rows of a table with COLUMNS."""
    forms = {"mean_mm": ".3f", "p99_8_mm": ".3f", "max_mm": ".3f", "below_1_mm_percent": ".2f", "obstacle_mm": ".2f"}

    def cell(value: float | None, form: str) -> str:
        return "-" if value is None or not np.isfinite(value) else format(value, form)

    return [
        [weight, *(cell(f[name], form) for name, form in forms.items()), f"{f['failed']} of {f['runs']}"]
        for weight, f in numbers.items()
    ]
