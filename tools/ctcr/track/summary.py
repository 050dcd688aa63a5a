"""The numbers of a scenario: errors by weight, and what failed."""

from typing import Any

import numpy as np

from ctcr.track.runs import Run

COLUMNS = ["mean", "p99.8", "max", "< 1 mm, %", "obstacle", "failed"]


def by_mass(runs: list[Run]) -> dict[float, list[Run]]:
    """The runs of each weight [g], in order."""
    return {mass: [run for run in runs if run.mass_g == mass] for mass in sorted({run.mass_g for run in runs})}


def errors_mm(runs: list[Run]) -> np.ndarray:
    """Errors of all rows that count [mm]."""
    parts = [1e3 * run.counted for run in runs if run.started]
    return np.concatenate(parts) if parts else np.empty(0)


def figures(runs: list[Run]) -> dict[str, Any]:
    """What one weight gave."""
    error = errors_mm(runs)
    known = len(error) > 0
    worst = max(runs, key=lambda run: (run.failed, run.counted.max() if run.started else np.inf))
    return {
        "runs": len(runs),
        "failed": sum(run.failed for run in runs),
        "mean_mm": float(error.mean()) if known else None,
        "p99_8_mm": float(np.percentile(error, 99.8)) if known else None,
        "max_mm": float(error.max()) if known else None,
        "below_1_mm_percent": float(100 * (error < 1).mean()) if known else None,
        "obstacle_mm": 1e3 * min(run.clearance for run in runs),
        "held_periods": int(sum(run.at_limit.sum() for run in runs)),
        "verdict": worst.verdict(),
        "gave_way": worst.given_way(),
    }


def summary(runs: list[Run]) -> dict[str, Any]:
    """{"20 g": figures}."""
    return {f"{mass:g} g": figures(group) for mass, group in by_mass(runs).items()}


def rows(numbers: dict[str, dict[str, Any]]) -> list[list[str]]:
    """For a table with COLUMNS behind the weight; mm."""

    def text(value: float | None, form: str = ".3f") -> str:
        return "-" if value is None or not np.isfinite(value) else format(value, form)

    return [
        [
            weight,
            text(f["mean_mm"]),
            text(f["p99_8_mm"]),
            text(f["max_mm"]),
            text(f["below_1_mm_percent"], ".2f"),
            text(f["obstacle_mm"], ".2f"),
            f"{f['failed']} of {f['runs']}",
        ]
        for weight, f in numbers.items()
    ]
