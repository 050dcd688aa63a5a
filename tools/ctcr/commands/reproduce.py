"""`ctcr reproduce`: the paper's results beside ours."""

import click

from ctcr.commands import options


@click.command(name="reproduce")
@click.option("--quick", is_flag=True, help="Fewer designs, configurations and repetitions: under a minute.")
@options.writes("--report", "FILE.html", "The page.", "target", default="reproduction.html", show_default=True)
@options.json
def command(quick: bool, target: str, out) -> None:
    """Compute the paper's results beside ours.

    Tables I and II, Figures 2 to 6 and the claims of Boyer et al., RA-L 2024, as one page. Each value stands beside
    the paper's, with their ratio and, where they differ, the reason.

    Example: ctcr reproduce --quick --report page.html
    """
    import time

    from ctcr.reproduce import control, influence, model, report
    from ctcr.reproduce.paper import COLUMNS
    from ctcr.show.output import Progress, write_text

    designs, configurations, repetitions = (20, 50, 1) if quick else (1000, 1000, 10)
    samples, points = (2000, 3) if quick else (1_000_000, 11)
    start, clock = time.process_time(), time.monotonic()
    with Progress("integration schemes", designs) as progress:
        errors, others, seconds = model.integration_errors(designs, configurations, progress.advance)
    with Progress("scenarios", 24 * repetitions) as progress:
        runs = control.scenarios(repetitions, progress.advance)
    with Progress("sensitivity", samples + 2 * (30 * points + 1 + 12 * 3 + 1)) as progress:
        found = influence.study(samples, points, progress.advance)
    claims = [
        *model.rates(2000 if quick else 20_000),
        *model.integration_claims(errors, others, seconds),
        *control.tracking_claims(runs),
        *influence.claims(found),
    ]
    made = f"{time.process_time() - start:.0f} s of processor time in {time.monotonic() - clock:.0f} s"
    write_text(report.page(claims, errors, runs, found, made, quick), target)
    out.write_json([{**vars(claim), "ratio": claim.ratio} for claim in claims])
    shown = (0, 1, 3, 4, 5)  # the reasons are on the page
    rows = [[claim.row()[k] for k in shown] for claim in claims]
    out.table("Boyer et al. 2024", [list(COLUMNS)[k] for k in shown], rows, 2)
    out.say(f"{made}. Report: {target}")
