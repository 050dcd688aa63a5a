"""Fitted parameters of effects on the terminal, a table for each effect."""

from collections.abc import Iterable
from itertools import groupby
from typing import Any

from ctcr.calibrate.outcome import deviation, number
from ctcr.effects import catalogue
from ctcr.show import output

ALIKE = 6  # coefficients of one meaning that are all shown; of more, so many that are largest beside their uncertainty

Row = tuple[str, float, float]


def show(console: Any, n_tubes: int, fitted: Iterable[Row]) -> None:
    """Prints name, value and standard deviation (SI) of parameters of effects, by full name; others are passed over."""
    known = catalogue.parameter_of(n_tubes)
    own = [row for row in fitted if row[0] in known]
    for identity, group in groupby(own, key=lambda row: row[0].split(".")[1]):
        rows, hidden = [], 0
        for meaning, some in groupby(group, key=lambda row: known[row[0]].meaning):
            alike = list(some)
            shown = set(sorted(alike, key=lambda row: -_certainty(row, known[row[0]].neutral))[:ALIKE])
            hidden += len(alike) - len(shown)
            for k, (name, value, sd) in enumerate(row for row in alike if row in shown):
                rows.append(
                    [
                        name.removeprefix(f"effects.{identity}."),
                        number(value, sd),
                        deviation(sd),
                        known[name].unit,
                        "the same" if k else meaning,
                    ]
                )
        columns = ["parameter", "value", "sd", "unit", "meaning"]
        console.print(output.table(f"Fitted: {identity} (SI)", columns, rows, text=(0, 3, 4)))
        if hidden:
            console.print(f"  and {hidden} coefficients that are smaller beside their uncertainty")


def _certainty(row: Row, neutral: float) -> float:
    _, value, sd = row
    return abs(value - neutral) / sd if sd > 0 else 0.0
