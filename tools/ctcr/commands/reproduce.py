"""`ctcr reproduce`: the paper's results beside ours."""

import click


@click.command(name="reproduce")
@click.option("--quick", is_flag=True, help="Fewer designs, configurations and repetitions: under a minute.")
@click.option("--report", metavar="FILE.html", default="reproduction.html", show_default=True, help="The page.")
@click.option("--json", "json_target", metavar="FILE", help="Write the values as JSON; - for standard output.")
def command(quick: bool, report: str, json_target: str | None) -> None:
    """Compute Tables I and II, Figures 2 to 6 and the claims of Boyer et al. 2024, and write them as one page."""
    import time

    from ctcr.reproduce import control, influence, model
    from ctcr.reproduce import report as page
    from ctcr.reproduce.claim import COLUMNS
    from ctcr.show import output

    designs, configurations, repetitions = (20, 50, 1) if quick else (1000, 1000, 10)
    samples, points = (2000, 3) if quick else (1_000_000, 11)
    start, clock = time.process_time(), time.monotonic()
    with output.Progress("integration schemes", designs) as progress:
        errors, others, seconds = model.integration_errors(designs, configurations, progress.advance)
    with output.Progress("scenarios", 24 * repetitions) as progress:
        runs = control.scenarios(repetitions, progress.advance)
    with output.Progress("sensitivity", samples + 2 * (30 * points + 1 + 12 * 3 + 1)) as progress:
        found = influence.study(samples, points, progress.advance)
    claims = [
        *model.rates(2000 if quick else 20_000),
        *model.integration_claims(errors, others, seconds),
        *control.tracking_claims(runs),
        *influence.claims(found),
    ]
    shown = (0, 1, 3, 4, 5)  # the reasons are on the page
    made = f"{time.process_time() - start:.0f} s of processor time in {time.monotonic() - clock:.0f} s"
    page.write(report, claims, errors, runs, found, made, quick)
    if json_target:
        output.write_json([{**vars(claim), "ratio": claim.ratio} for claim in claims], json_target)
    console = output.console(json_target)
    columns, rows = [COLUMNS[k] for k in shown], [[claim.row()[k] for k in shown] for claim in claims]
    console.print(output.table("Boyer et al. 2024", columns, rows, 2))
    console.print(f"{made}. Report: {report}", markup=False)
