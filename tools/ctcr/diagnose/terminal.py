"""A diagnosis, and fitted effects, on the terminal: the verdict first, then why."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import groupby
from typing import Any

from rich.progress import BarColumn, Progress, TimeElapsedColumn

from ctcr.diagnose.pipeline import Diagnosis
from ctcr.diagnose.round import Round
from ctcr.diagnose.varying_coefficients import ADVICE
from ctcr.effects import catalogue
from ctcr.show import output
from ctcr.show.wording import deviation, number, sentence

CANDIDATES = 8  # of a round
ALIKE = 6  # coefficients of one meaning that are all shown; of more, the clearest
STAGES = {"nominal": "as described", "calibrated": "calibrated", "with_effects": "with the effects found"}


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """A function that shows the current step, on a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    columns = (BarColumn(20), TimeElapsedColumn(), "{task.description}")
    with Progress(*columns, console=output.Terminal(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)  # the number of rounds depends on the data
        yield lambda text: bar.update(task, description=text)


def show(console: Any, result: Diagnosis) -> None:
    def say(*lines: str) -> None:
        for line in lines:
            console.print(line)

    console.print(result.verdict.word.upper().replace("_", " "), style="bold")
    say(*result.verdict.sentences, "")
    columns = ["what acts", "probability"]
    console.print(output.table("Explanations that were weighed", columns, result.verdict.rows, text=(0,)))
    console.print(_errors(result))
    for number_, round_ in enumerate(result.rounds, start=1):
        if round_.tried:
            console.print(_candidates(number_, round_))
        if round_.why_not:
            say(round_.why_not)
    say("  linear, fit: log evidence gained, linearised and in the joint fit; explained: of the unexplained chi-square")
    if result.accepted:
        fit = result.final
        show_fitted(console, result.robot.n_tubes, zip(fit.names, fit.values, fit.sd, strict=True))
    say(*result.residual.messages)
    if result.varying:
        say(f"{result.varying.lead}:", *(f"  • {variation.message}" for variation in result.varying.variations))
        say(ADVICE, f"What to measure next: {result.varying.measure[0]}")
    say(*map(sentence, result.notices))
    say(*(f"Not tested: {identity}: {reason}." for identity, reason in result.not_testable.items()))


def _errors(result: Diagnosis) -> Any:
    rows = [[STAGES[name], f"{value:.3f}"] for name, value in result.rms_mm.items() if name in STAGES]
    rows += [[name, f"{value:.3f}"] for name, value in result.floors.rows()]
    return output.table(f"Position error (RMS) on {result.judged_on}", ["model", "mm"], rows)


def _candidates(number_: int, round_: Round) -> Any:
    rows = []
    for one in round_.best[:CANDIDATES]:
        refitted = [f"{one.refit:.1f}", f"{one.explained:.0%}"] if one.refit is not None else ["", ""]
        remark = "accepted" if one is round_.accepted else "as likely" if one.id in round_.ids else ""
        rows.append([one.id, one.candidate.summary, f"{one.linear:.1f}", *refitted, remark])
    title = f"Round {number_}, {round_.place}: candidates, each fitted together with the calibration"
    return output.table(title, ["effect", "parameters", "linear", "fit", "explained", ""], rows, text=(0, 1, 5))


def show_fitted(console: Any, n_tubes: int, fitted: Iterable[tuple[str, float, float]]) -> None:
    """Prints a table for each effect, from name, value and standard deviation (SI) of parameters by full name; those of
    no effect are passed over."""
    known = catalogue.parameter_of(n_tubes)

    def clarity(row: tuple[str, float, float]) -> float:
        name, value, sd = row
        return abs(value - known[name].neutral) / sd if sd > 0 else 0.0

    own = [row for row in fitted if row[0] in known]
    for identity, of_effect in groupby(own, key=lambda row: row[0].split(".")[1]):
        rows, hidden = [], 0
        for meaning, of_meaning in groupby(of_effect, key=lambda row: known[row[0]].meaning):
            alike = list(of_meaning)
            clearest = set(sorted(alike, key=clarity, reverse=True)[:ALIKE])
            hidden += len(alike) - len(clearest)
            for k, (name, value, sd) in enumerate(row for row in alike if row in clearest):
                short = name.removeprefix(f"effects.{identity}.")
                said = "the same" if k and meaning else meaning
                rows.append([short, number(value, sd), deviation(sd), known[name].unit, said])
        columns = ["parameter", "value", "sd", "unit", "meaning"]
        console.print(output.table(f"Fitted: {identity} (SI)", columns, rows, text=(0, 3, 4)))
        if hidden:
            console.print(f"  and {hidden} coefficients that are smaller beside their uncertainty")
