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
    from ctcr.diagnose.analysis import Diagnosis

SHOWN = 8  # candidates of a round


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Says what is being tried, on a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    columns = (BarColumn(20), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)  # how many rounds there will be, nobody knows
        yield lambda text: bar.update(task, description=text)


def show(console: Any, result: "Diagnosis") -> None:
    verdict = result.verdict
    console.print(f"[bold]{verdict.word.upper().replace('_', ' ')}[/bold]")
    for sentence in verdict.sentences:
        console.print(sentence, markup=False)
    console.print()
    console.print(_errors(result))
    for number, round_ in enumerate(result.rounds, start=1):
        if round_.entries:
            console.print(_candidates(number, round_))
        if round_.why_not:
            console.print(round_.why_not, markup=False)
    console.print("  slopes, fit: gain in log evidence, by slopes alone and in the fit; removed: of the excess error")
    if result.accepted:
        fit = result.final
        fitted_effects.show(console, result.robot.n_tubes, zip(fit.names, fit.values, fit.sd, strict=True))
    for line in result.leftover.in_words:
        console.print(line, markup=False)
    if result.varying:
        console.print(f"{result.varying.lead}:", markup=False)
        for variation in result.varying.variations:
            console.print(f"  • {variation.in_words}", markup=False)
        console.print(result.varying.advice, markup=False)
        console.print(f"What to measure next: {result.varying.measure[0]}", markup=False)
    for notice in result.notices:
        console.print(f"{notice}.", markup=False)
    for identity, reason in result.unseen.items():
        console.print(f"Not looked for: {identity}: {reason}.", markup=False)


def _errors(result: "Diagnosis") -> Any:
    names = {
        "nominal": "as described",
        "calibrated": "calibrated",
        "with_effects": "with the effects found",
        "noise_floor": "noise floor",
    }
    runs = len(set(result.measurements.run[result.judged].tolist()))
    rows = [[names[name], f"{value:.3f}"] for name, value in result.rms_mm.items()]
    rows.append(["allowed by the tracker and uncertain parameters", f"{result.expected_mm:.3f}"])
    title = f"Position error (RMS) on {result.judged.sum()} readings of {runs} run(s) that no fit saw"
    return output.table(title, ["model", "mm"], rows)


def _candidates(number: int, round_: Any) -> Any:
    rows = []
    for entry in round_.best[:SHOWN]:
        refitted = entry.refit is not None
        rows.append(
            [
                entry.id,
                entry.candidate.told,
                f"{entry.linear:.1f}",
                f"{entry.refit:.1f}" if refitted else "",
                f"{entry.share:.0%}" if refitted else "",
                _remark(entry, round_),
            ]
        )
    title = f"Round {number}: effects, each fitted together with the calibration"
    return output.table(title, ["effect", "parameters", "slopes", "fit", "removed", ""], rows, text=(0, 1, 5))


def _remark(entry: Any, round_: Any) -> str:
    if entry is round_.accepted:
        return "accepted"
    return "as likely" if entry.id in round_.ids else ""
