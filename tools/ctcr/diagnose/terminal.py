"""A diagnosis on the terminal: the verdict first, then why."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from ctcr.diagnose import fitted_effects
from ctcr.show import output

if TYPE_CHECKING:
    from ctcr.diagnose.pipeline import Diagnosis

SHOWN = 8  # candidates of a round


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """A function that shows the current step, on a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    columns = (BarColumn(20), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)  # the number of rounds depends on the data
        yield lambda text: bar.update(task, description=text)


def show(console: Any, result: "Diagnosis") -> None:
    verdict = result.verdict
    console.print(f"[bold]{verdict.word.upper().replace('_', ' ')}[/bold]")
    for sentence in verdict.sentences:
        console.print(sentence, markup=False)
    console.print()
    console.print(_errors(result))
    for number, round_ in enumerate(result.rounds, start=1):
        if round_.tried:
            console.print(_candidates(number, round_))
        if round_.why_not:
            console.print(round_.why_not, markup=False)
    console.print(
        "  linear, fit: log evidence gained, linearised and in the joint fit; explained: of the unexplained chi-square"
    )
    if result.accepted:
        fit = result.final
        fitted_effects.show(console, result.robot.n_tubes, zip(fit.names, fit.values, fit.sd, strict=True))
    for line in result.residual.messages:
        console.print(line, markup=False)
    if result.varying:
        console.print(f"{result.varying.lead}:", markup=False)
        for variation in result.varying.variations:
            console.print(f"  • {variation.message}", markup=False)
        console.print(result.varying.advice, markup=False)
        console.print(f"What to measure next: {result.varying.measure[0]}", markup=False)
    for notice in result.notices:
        console.print(f"{notice}.", markup=False)
    for identity, reason in result.not_testable.items():
        console.print(f"Not tested: {identity}: {reason}.", markup=False)


def _errors(result: "Diagnosis") -> Any:
    names = {
        "nominal": "as described",
        "calibrated": "calibrated",
        "with_effects": "with the effects found",
        "noise_floor": "noise floor",
    }
    runs = len(set(result.measurements.run[result.judged].tolist()))
    rows = [[names[name], f"{value:.3f}"] for name, value in result.rms_mm.items()]
    rows.append(["expected from noise and uncertain parameters", f"{result.expected_mm:.3f}"])
    title = f"Position error (RMS) on {result.judged.sum()} readings of {runs} held-out run(s)"
    return output.table(title, ["model", "mm"], rows)


def _candidates(number: int, round_: Any) -> Any:
    rows = []
    for one in round_.best[:SHOWN]:
        refitted = [f"{one.refit:.1f}", f"{one.explained:.0%}"] if one.refit is not None else ["", ""]
        remark = "accepted" if one is round_.accepted else "as likely" if one.id in round_.ids else ""
        rows.append([one.id, one.candidate.summary, f"{one.linear:.1f}", *refitted, remark])
    title = f"Round {number}: effects, each fitted together with the calibration"
    return output.table(title, ["effect", "parameters", "linear", "fit", "explained", ""], rows, text=(0, 1, 5))
