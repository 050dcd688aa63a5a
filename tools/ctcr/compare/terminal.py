"""The comparison on a terminal, and the tables that the report shares with it."""

from collections.abc import Mapping, Sequence

from ctcr.compare.analysis import Comparison
from ctcr.compare.summary import findings, headline, held_out, limits, quiet
from ctcr.show.output import table
from ctcr.show.wording import counted, listed

SHOWN_RUNS = 15
SHOWN_FORMS = 10
SHOWN_ROWS = 20

Table = tuple[str, Mapping[str, str], list[list[str]], int]  # title, columns, rows, number of columns of text
SIZES = {
    "mean": "mean distance between measured and predicted",
    "RMS": "root mean square of it",
    "95 %": "95 of 100 errors are smaller",
    "max": "the largest",
}


def show(console, c: Comparison) -> None:
    """Print a comparison on a rich console."""
    console.print(c.robot, style="bold")
    if c.unexplained:
        console.print(c.unexplained, style="bold")
    console.bullets([one.sentence for one in c.wrong], c.WRONG)
    console.print(headline(c))
    console.print(table(*errors(c)))
    if len(c.runs) > 1:
        _, columns, rows, _ = by_run(c)
        console.print(table("By run, mm", columns, rows[:SHOWN_RUNS]))
        if len(c.runs) > SHOWN_RUNS:
            console.print(f"  and {len(c.runs) - SHOWN_RUNS} more runs (all of them: --json FILE or --report FILE)")
    console.print(table(*repeatability(c)))
    if c.ranking.alone:
        title, columns, rows, texts = dependences(c)
        console.print(table(title, columns, rows[:SHOWN_FORMS], texts))
    for title, lines in [("Findings", [item.text for item in findings(c)]), *remarks(c)]:
        console.bullets(lines, title)
    for line in left_out(c, SHOWN_ROWS):
        console.print(line)


def remarks(c: Comparison) -> list[tuple[str, Sequence[str]]]:
    """Lists of sentences with their titles, beside the findings."""
    return [("No finding", quiet(c)), ("Limits of these data", [*limits(c)]), ("Before the comparison", c.notices)]


def left_out(c: Comparison, most: int) -> list[str]:
    """Sentences on the rows that could not be compared and why, at most `most` of each kind by number."""
    sample = c.sample
    kinds = {"not measured": sample.not_measured.tolist()}
    for row, why in zip(sample.not_solved.tolist(), sample.why, strict=True):
        kinds.setdefault(f"not solved ({why})", []).append(row)
    return [f"{counted(len(rows), 'row')} {kind}: {listed(rows, most)}" for kind, rows in kinds.items() if rows]


def errors(c: Comparison) -> Table:
    """Overall errors: position in mm and % of length, orientation in degrees."""
    spreads = [("position", "mm", c.position_mm), ("position", "% of length", c.percent_of_length)]
    spreads.append((c.angle_kind, "deg", c.angle_deg))
    rows = [
        [name, unit, *(f"{v:.3g}" for v in (s.mean, s.rms, s.p95, s.maximum)), str(s.count)]
        for name, unit, s in spreads
        if s
    ]
    return "Error, measured minus predicted", {"": "", "unit": "", **SIZES, "readings": ""}, rows, 2


def by_run(c: Comparison) -> Table:
    """Errors of each run, with the mean error vector."""
    mean = {f"mean {axis}": f"mean of measured minus predicted along {axis}" for axis in "xyz"}
    columns, rows = {"run": "", "readings": "", **SIZES, **mean}, []
    for r in c.runs:
        p = r.position_mm
        sizes = [f"{v:.2f}" for v in (p.mean, p.rms, p.p95, p.maximum)]
        rows.append([str(r.run), str(p.count), *sizes, *(f"{v:+.2f}" for v in r.mean_error_mm)])
    return "By run, mm; mean error vector in the tracker frame", columns, rows, 0


def repeatability(c: Comparison) -> Table:
    """How readings repeat, and hysteresis, beside the floors of any model."""
    n, d, root3 = c.noise, c.direction, 3**0.5

    def number(value: float) -> str:
        return f"{value:.3f}" if value == value else "not known"

    rows = []
    if n.source == "revisits":
        axis = f"{n.axis_mm:.3f} ± {number(n.uncertainty_mm)}"
        rows.append(["scatter of repeated readings", f"{n.rms_mm:.3f}", axis, str(n.pairs)])
    if n.dwells:
        rows.append(["scatter at rest", f"{n.rest_axis_mm * root3:.3f}", f"{n.rest_axis_mm:.3f}", str(n.dwells)])
    rows.append(["sensor jitter, as stated", number(n.stated_axis_mm * root3), number(n.stated_axis_mm), ""])
    rows.append(["expected error of a right model", number(c.floors["expected_error_mm"]), "", ""])
    if d:
        rows.append(["hysteresis", f"{d.rms_mm:.3f} ± {number(d.uncertainty_mm)}", "", str(d.pairs)])
        rows.append(["floor of a model without history", f"{d.floor_mm:.3f}", "", ""])
    columns = {
        "": "",
        "RMS distance": "root mean square of the distance of a reading from the mean of its like; hysteresis: between "
        "two visits from opposite directions",
        "per axis": "standard deviation along one axis",
        "pairs or rests": "how many pairs of visits, or rests of the robot, tell",
    }
    return "Repeatability, mm", columns, rows, 1


def dependences(c: Comparison) -> Table:
    """Dependences, strongest first; * marks the ones found one after another."""
    found = {item.name for item in c.ranking.chosen}
    rows = [
        [("* " if d.name in found else "  ") + d.label, d.form.frame]
        + [f"{100 * d.share:.1f} %", f"{d.size_mm:.2f}", f"{d.p_value:.3f}"]
        for d in c.ranking.distinct()
    ]
    title = f"What the error depends on, judged on {c.ranking.blocks} {held_out(c)}"
    columns = {
        "depends on": "",
        "frame": "in which the error is predicted",
        "share": "fraction of the squared error about its offset, predicted on held-out data",
        "size, mm": "RMS of the part that is predicted",
        "p": "probability of such a fraction by chance",
    }
    return title, columns, rows, 2
