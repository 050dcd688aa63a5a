"""Which parameters deserve calibration for a wanted accuracy: as few as possible (paper, Section V)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any


@dataclass(frozen=True)
class Advice:
    """`calibrate` in the order of their influence; with the others at nominal values the error is `error` [mm]."""

    accuracy: float
    calibrate: list[str]
    keep: list[str]
    error: float

    def text(self) -> str:
        if not self.error <= self.accuracy:
            return f"{self.accuracy:g} mm is out of reach: the error is {self.error:.3g} mm with true parameters."
        if not self.calibrate:
            return f"Within {self.accuracy:g} mm nothing needs calibration: the error is {self.error:.3g} mm."
        rest = f"leave the other {len(self.keep)} at nominal values, the error is then {self.error:.3g} mm"
        return f"For {self.accuracy:g} mm calibrate {grouped(self.calibrate)}; {rest}."


def advise(
    influence_mm: Mapping[str, float], accuracy_mm: float, base_mm: float = 0.0, independent: bool = False
) -> Advice:
    """Calibrates the most influential parameters until the error that the others cause is within the accuracy.

    base_mm      the error with true parameters, to which influences add
    independent  influences add as independent errors do, squared; otherwise all at once, as in the worst case
    """
    order = sorted(influence_mm, key=lambda name: -influence_mm[name])

    def error(kept: list[str]) -> float:
        sizes = [influence_mm[name] for name in kept]
        return base_mm + (hypot(*sizes) if independent else sum(sizes))

    count = 0
    while count < len(order) and not error(order[count:]) <= accuracy_mm:
        count += 1
    return Advice(accuracy_mm, order[:count], order[count:], error(order[count:]))


def grouped(names: Iterable[str]) -> str:
    """Names with those of several tubes as one: "length of tubes 1 and 3, tracker position x"."""
    tubes: dict[str, list[str]] = {}
    for name in names:
        kind, _, tube = name.partition(", tube ")
        tubes.setdefault(kind, []).append(tube)

    def of(found: list[str]) -> str:
        *first, last = sorted(found)
        return f" of tubes {', '.join(first)} and {last}" if first else f" of tube {last}"

    return ", ".join(kind + (of(found) if found[0] else "") for kind, found in tubes.items())


def advices(found: dict[str, Any], accuracy: float) -> dict[str, Advice]:
    """The advice of each study.

    Open loop: errors that 95 % of the configurations stay below, independent of each other. Closed loop: the worst
    case, as in the paper.
    """
    given = {}
    if study := found.get("open_loop"):
        given["open_loop"] = advise({one.name: one.p95 for one in study.influences}, accuracy, independent=True)
    if study := found.get("closed_loop"):
        increase = {curve.varied.name: curve.worst_maximum for curve in study.curves}
        given["closed_loop"] = advise(increase, accuracy, study.nominal_maximum)
    return given
