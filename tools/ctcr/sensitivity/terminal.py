"""The study as tables, in sentences and as JSON; without the plotting libraries, which only its page needs."""

from typing import Any

from ctcr.sensitivity.advice import advices
from ctcr.sensitivity.closed_loop import ClosedLoop
from ctcr.sensitivity.open_loop import OpenLoop
from ctcr.show import output

OPEN_COLUMNS = {
    "parameter": "",
    "mean, mm": "mean distance between the tips that the nominal robot and the wrong one predict",
    "95 %, mm": "95 of 100 distances are below",
    "max, mm": "largest distance",
}
CLOSED_COLUMNS = {
    "parameter": "",
    "range": "over which it was varied",
    "mean +um": "by how much the mean tracking error grows, in µm",
    "max +um": "by how much the largest tracking error grows, in µm",
}


def open_rows(study: OpenLoop) -> list[list[str]]:
    """Largest influence first; the last row is of all together."""
    order = [*sorted(study.influences, key=lambda one: -one.p95), study.together]
    return [[one.name, f"{one.mean:.3f}", f"{one.p95:.3f}", f"{one.maximum:.3f}"] for one in order]


def closed_rows(study: ClosedLoop) -> list[list[str]]:
    """Largest influence first; the last row is the worst case of all."""

    def row(name: str, change: str, mean: float, largest: float) -> list[str]:
        return [name, change, f"{1e3 * mean:.1f}", f"{1e3 * largest:.1f}"]

    rows = []
    for curve in sorted(study.curves, key=lambda curve: -curve.worst_maximum):
        one = curve.varied
        change = f"{one.low:+g} to {one.high:+g} {one.unit}".strip()
        rows.append(row(one.name, change, curve.worst_mean, curve.worst_maximum))
    return [*rows, row("all of them, worst case", "", study.cumulated_mean, study.cumulated_maximum)]


def closing(found: dict[str, Any], accuracy: float) -> list[str]:
    """The speed and the advice, in sentences."""
    lines = []
    if (study := found.get("open_loop")) and study.seconds > 0:
        lines.append(
            f"{study.solved:.3g} tips predicted by {study.evaluations:.3g} evaluations of the model in "
            f"{study.seconds:.1f} s of processor time: {study.solved / study.seconds:.3g} tips and "
            f"{study.evaluations / study.seconds:.3g} evaluations a second and core."
        )
    names = {"open_loop": "Open loop, 95 % of configurations", "closed_loop": "Closed loop, largest error"}
    return lines + [f"{names[kind]}. {advice.text()}" for kind, advice in advices(found, accuracy).items()]


def show(console, found: dict[str, Any], accuracy: float) -> None:
    """Prints the tables and the advice on a rich console."""
    if study := found.get("open_loop"):
        title = f"Open loop: tip errors at {study.configurations} random configurations"
        console.print(output.table(title, OPEN_COLUMNS, open_rows(study)))
    if study := found.get("closed_loop"):
        nominal = f"mean {study.nominal_mean:.3f}, max {study.nominal_maximum:.3f} mm"
        title = f"Closed loop: increase of the error; with true parameters: {nominal}"
        console.print(output.table(title, CLOSED_COLUMNS, closed_rows(study), 2))
    for line in closing(found, accuracy):
        console.print(line)


def as_data(robot: str, found: dict[str, Any], accuracy: float) -> dict[str, Any]:
    """The JSON of the command."""
    data: dict[str, Any] = {"robot": robot, "accuracy_mm": accuracy}
    if study := found.get("open_loop"):
        data["open_loop"] = {
            "configurations": study.configurations,
            "tips": study.solved,
            "evaluations": study.evaluations,
            "processor_s": study.seconds,
            "influence": {
                one.name: {"mean_mm": one.mean, "p95_mm": one.p95, "max_mm": one.maximum, "unsolved": one.unsolved}
                for one in (*study.influences, study.together)
            },
        }
    if study := found.get("closed_loop"):
        data["closed_loop"] = {
            "nominal_mean_mm": study.nominal_mean,
            "nominal_max_mm": study.nominal_maximum,
            "cumulated_mean_mm": study.cumulated_mean,
            "cumulated_max_mm": study.cumulated_maximum,
            "influence": {
                curve.varied.name: {
                    "unit": curve.varied.unit,
                    "change": [curve.varied.change(f) for f in curve.fraction],
                    "mean_increase_mm": curve.mean,
                    "max_increase_mm": curve.maximum,
                }
                for curve in study.curves
            },
        }
    for kind, advice in advices(found, accuracy).items():
        data[kind] |= {"calibrate": advice.calibrate, "error_mm": advice.error}
    return data
