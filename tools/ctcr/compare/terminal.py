"""The comparison on a terminal: compact tables and the findings."""

from ctcr.compare.analysis import Comparison, Spread
from ctcr.compare.limits import limits
from ctcr.compare.summary import findings, headline, quiet
from ctcr.show.output import listed, table

SHOWN_RUNS = 15
SHOWN_FORMS = 10
SHOWN_ROWS = 20


def show(console, c: Comparison) -> None:
    """Print a comparison on a rich console."""
    console.print(f"[bold]{c.robot}[/bold]", highlight=False)
    console.print(headline(c), markup=False)
    console.print(table("Error, measured minus predicted", ["", "unit", *COLUMNS], error_rows(c), text_columns=2))
    if len(c.runs) > 1:
        console.print(table("By run, mm", RUN_COLUMNS, run_rows(c)[:SHOWN_RUNS], text_columns=1))
        if len(c.runs) > SHOWN_RUNS:
            console.print(f"  and {len(c.runs) - SHOWN_RUNS} more runs (all of them: --json FILE or --report FILE)")
    console.print(table("Repeatability, mm", REPEAT_COLUMNS, repeat_rows(c), text_columns=1))
    if c.ranking.alone:
        console.print(table(ranking_title(c), RANKING_COLUMNS, ranking_rows(c)[:SHOWN_FORMS], text_columns=2))
    for title, lines in (
        ("Findings", [item.text for item in findings(c)]),
        ("No finding", quiet(c)),
        ("What these data cannot say", limits(c)),
        ("What became of the table first", c.notices),
    ):
        if lines:
            console.print(f"[bold]{title}[/bold]")
            for line in lines:
                console.print(f"  • {line}", markup=False)
    for what, rows in (("not measured", c.sample.not_measured), ("not solved", c.sample.not_solved)):
        if len(rows):
            console.print(f"{len(rows)} rows {what}: {listed(rows, SHOWN_ROWS)}", markup=False)


COLUMNS = ["mean", "RMS", "95 %", "max", "readings"]
RUN_COLUMNS = ["run", "readings", "mean", "RMS", "95 %", "max", "mean x", "mean y", "mean z"]
REPEAT_COLUMNS = ["", "RMS distance", "per axis", "pairs or rests"]
RANKING_COLUMNS = ["depends on", "frame", "share", "size, mm", "p"]


def error_rows(c: Comparison) -> list[list[str]]:
    """Overall errors: position in mm and % of length, orientation in degrees."""

    def row(name: str, unit: str, s: Spread) -> list[str]:
        return [name, unit, *(f"{v:.3g}" for v in (s.mean, s.rms, s.p95, s.maximum)), str(s.count)]

    rows = [row("position", "mm", c.position_mm), row("position", "% of length", c.percent_of_length)]
    return [*rows, row(c.angle_kind, "deg", c.angle_deg)] if c.angle_deg else rows


def run_rows(c: Comparison) -> list[list[str]]:
    """Errors of each run, mm, with the mean error vector in the tracker frame."""
    return [
        [str(r.run), str(r.position_mm.count)]
        + [f"{v:.2f}" for v in (r.position_mm.mean, r.position_mm.rms, r.position_mm.p95, r.position_mm.maximum)]
        + [f"{v:+.2f}" for v in r.mean_error_mm]
        for r in c.runs
    ]


def repeat_rows(c: Comparison) -> list[list[str]]:
    """Noise floor and out/return difference beside the stated jitter, mm."""
    n, d, root3 = c.noise, c.direction, 3**0.5

    def number(value: float) -> str:
        return f"{value:.3f}" if value == value else "not known"

    rows = []
    if n.source == "revisits":
        rows.append(
            [
                "noise of a reading, from revisits",
                f"{n.rms_mm:.3f}",
                f"{n.axis_mm:.3f} ± {number(n.uncertainty_mm)}",
                str(n.pairs),
            ]
        )
    if n.dwells:
        rows.append(["scatter at rest", f"{n.rest_axis_mm * root3:.3f}", f"{n.rest_axis_mm:.3f}", str(n.dwells)])
    rows.append(["jitter stated", number(n.stated_axis_mm * root3), number(n.stated_axis_mm), ""])
    if d:
        rows.append(["out against return", f"{d.rms_mm:.3f} ± {number(d.uncertainty_mm)}", "", str(d.pairs)])
        rows.append(["floor of a model without history", f"{d.floor_mm:.3f}", "", ""])
    return rows


def ranking_title(c: Comparison) -> str:
    """What the shares of the ranking mean."""
    return f"What the error depends on, judged on {c.ranking.blocks} {c.ranking.block_kind} left out in turn"


def ranking_rows(c: Comparison) -> list[list[str]]:
    """Dependences, strongest first; * marks the ones found one after another."""
    found = {item.name for item in c.ranking.chosen}
    return [
        [
            ("* " if item.name in found else "  ") + item.label,
            item.form.frame,
            f"{100 * item.share:.1f} %",
            f"{item.size_mm:.2f}",
            f"{item.p_value:.3f}",
        ]
        for item in c.ranking.distinct()
    ]
