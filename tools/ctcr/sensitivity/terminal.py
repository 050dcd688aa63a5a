"""The study as tables, as data and in words."""

from typing import Any

from ctcr.sensitivity.advice import Advice, advise
from ctcr.sensitivity.closed_loop import ClosedLoop
from ctcr.sensitivity.open_loop import OpenLoop
from ctcr.show import output

OPEN_COLUMNS = ["mean, mm", "95 %, mm", "max, mm"]
CLOSED_COLUMNS = ["range", "mean +um", "max +um"]


def advices(found: dict[str, Any], accuracy: float) -> dict[str, Advice]:
    """For each study. Open loop: errors that 95 % of the configurations stay below, independent of each other; closed
    loop: the worst case, as in the paper."""
    told = {}
    if "open_loop" in found:
        influence = {one.name: one.p95 for one in found["open_loop"].influences}
        told["open_loop"] = advise(influence, accuracy, independent=True)
    if "closed_loop" in found:
        loop = found["closed_loop"]
        increase = {curve.varied.name: curve.worst_maximum for curve in loop.curves}
        told["closed_loop"] = advise(increase, accuracy, loop.nominal_maximum)
    return told


def open_rows(study: OpenLoop) -> list[list[str]]:
    """Largest influence first; the last row is of all together."""
    order = [*sorted(study.influences, key=lambda one: -one.p95), study.together]
    return [[one.name, f"{one.mean:.3f}", f"{one.p95:.3f}", f"{one.maximum:.3f}"] for one in order]


def closed_rows(study: ClosedLoop) -> list[list[str]]:
    order = sorted(study.curves, key=lambda curve: -curve.worst_maximum)
    rows = [
        [
            curve.varied.name,
            f"{curve.varied.low:+g} to {curve.varied.high:+g} {curve.varied.unit}".strip(),
            f"{1e3 * curve.worst_mean:.1f}",
            f"{1e3 * curve.worst_maximum:.1f}",
        ]
        for curve in order
    ]
    total = ["all of them, worst case", "", f"{1e3 * study.cumulated_mean:.1f}", f"{1e3 * study.cumulated_maximum:.1f}"]
    return [*rows, total]


def closing(found: dict[str, Any], accuracy: float) -> list[str]:
    """What it comes to, in words."""
    lines = []
    if "open_loop" in found:
        study = found["open_loop"]
        if study.seconds > 0:
            lines.append(
                f"{study.solved:.3g} tips predicted by {study.evaluations:.3g} evaluations of the model in "
                f"{study.seconds:.1f} s of processor time: {study.solved / study.seconds:.3g} tips and "
                f"{study.evaluations / study.seconds:.3g} evaluations a second and core."
            )
    names = {"open_loop": "Open loop, 95 % of configurations", "closed_loop": "Closed loop, largest error"}
    for kind, advice in advices(found, accuracy).items():
        lines.append(f"{names[kind]}. {advice.text()}")
    return lines


def show(console, found: dict[str, Any], accuracy: float) -> None:
    if "open_loop" in found:
        title = f"Open loop: tip errors at {found['open_loop'].configurations} random configurations"
        console.print(output.table(title, ["parameter", *OPEN_COLUMNS], open_rows(found["open_loop"])))
    if "closed_loop" in found:
        loop = found["closed_loop"]
        nominal = f"mean {loop.nominal_mean:.3f}, max {loop.nominal_maximum:.3f} mm"
        title = f"Closed loop: increase of the error; with true parameters: {nominal}"
        console.print(output.table(title, ["parameter", *CLOSED_COLUMNS], closed_rows(loop), 2))
    for line in closing(found, accuracy):
        console.print(line, markup=False)


def as_data(robot: str, found: dict[str, Any], accuracy: float) -> dict[str, Any]:
    data: dict[str, Any] = {"robot": robot, "accuracy_mm": accuracy}
    if "open_loop" in found:
        study = found["open_loop"]
        rows = [*study.influences, study.together]
        data["open_loop"] = {
            "configurations": study.configurations,
            "tips": study.solved,
            "evaluations": study.evaluations,
            "processor_s": study.seconds,
            "influence": {
                one.name: {"mean_mm": one.mean, "p95_mm": one.p95, "max_mm": one.maximum, "unsolved": one.unsolved}
                for one in rows
            },
        }
    if "closed_loop" in found:
        loop = found["closed_loop"]
        data["closed_loop"] = {
            "nominal_mean_mm": loop.nominal_mean,
            "nominal_max_mm": loop.nominal_maximum,
            "cumulated_mean_mm": loop.cumulated_mean,
            "cumulated_max_mm": loop.cumulated_maximum,
            "influence": {
                curve.varied.name: {
                    "unit": curve.varied.unit,
                    "change": [curve.varied.change(f) for f in curve.fraction],
                    "mean_increase_mm": curve.mean,
                    "max_increase_mm": curve.maximum,
                }
                for curve in loop.curves
            },
        }
    for kind, advice in advices(found, accuracy).items():
        data[kind]["calibrate"] = advice.calibrate
        data[kind]["error_mm"] = advice.error
    return data
