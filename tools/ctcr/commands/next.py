"""`ctcr next`: what to measure next."""

import click

from ctcr.commands import options


@click.command(name="next")
@options.robot
@options.measurements
@options.setting("--runs", click.IntRange(1, 100), 4, "Runs to propose.")
@options.setting("--masses", str, "0,10,20", "Masses that can be hung at the tip [g].", metavar="GRAMS")
@options.output("PLAN.csv", "Write the runs as a table that the robot can run.")
@options.json
@options.threads
@options.anyway
@options.frames
def command(robot, measurements, runs, masses, target, threads, anyway, frame_per_run, out) -> None:
    """Propose the runs to measure next.

    They discriminate best between the explanations that MEASUREMENTS leave open about ROBOT: other effects, one more
    or one less, noise alone. Diagnoses first. Each run goes out and back through the same stops under one load,
    within the range of the joints measured so far; the runs with the largest expected log evidence come first. Says
    so when nothing is open, and when no run can decide.

    Example: ctcr next robot.yaml measurements.csv --runs 4 --masses 0,20 -o plan.csv
    """
    from ctcr import plan
    from ctcr.api.reviewed import to_fit
    from ctcr.diagnose import diagnose, terminal
    from ctcr.model import simulation

    kilograms = _masses(masses)
    loaded, table = options.load(robot, measurements, any_convention=True)
    readings, said, _ = to_fit(loaded, table, anyway=anyway, frame_per_run=frame_per_run)
    with terminal.progress() as say:
        diagnosis = diagnose(loaded, readings, progress=say, threads=threads)
        say("looking for the runs that decide")
        proposal = plan.propose(diagnosis, runs, kilograms)
    writes = proposal.plan is not None and target
    if writes:
        simulation.write(proposal.plan, target)
    out.write_json(
        {
            "rivals": [str(rival) for rival in proposal.rivals],
            "log_evidence": {"now": proposal.now if proposal.rivals else None, "expected": proposal.gain},
            "decides": proposal.decides,
            "runs": [{"beta_m": r.beta, "alpha_rad": r.alpha, "mass_kg": r.mass} for r in proposal.runs],
        }
    )
    out.say(*said)
    _show(out, loaded.n_tubes, diagnosis.verdict, proposal)
    if writes:
        out.say(f"Plan: {target}")


def _masses(text: str) -> tuple[float, ...]:
    """Masses [kg] of a text in g."""
    from ctcr.errors import ArgumentError, Problem

    try:
        grams = [float(part) for part in text.split(",")]
    except ValueError:
        grams = [-1.0]
    if not all(0 <= gram < 1000 for gram in grams):
        raise ArgumentError(Problem(f"--masses {text}: give grams from 0 to 1000, separated by commas, as 0,10,20"))
    return tuple(1e-3 * gram for gram in grams)


def _show(out, n_tubes: int, verdict, proposal) -> None:
    from ctcr.effects import catalogue
    from ctcr.show.wording import most

    if not proposal.rivals:
        is_open = len(verdict.likeliest) > 1
        why = "No runs could tell apart what is open" if is_open else "Nothing is open"
        out.say(f"{why}: the verdict on these measurements is {verdict.word.replace('_', ' ')}.")
        out.say(*(verdict.sentences if is_open else []))
        return
    out.say(f"Open: {'; or '.join(f'{rival} ({most(rival.probability)})' for rival in proposal.rivals)}.")
    rows = [
        [str(i), f"{1e3 * run.mass:g}", f"{gain:.1f}"]
        for i, (run, gain) in enumerate(zip(proposal.runs, proposal.gain, strict=True), start=1)
    ]
    title = "Runs, best first; log evidence that the true explanation is expected to gain over its nearest rival"
    out.table(title, ["run", "mass at the tip, g", "expected log evidence with it"], rows)
    if not proposal.decides:
        out.say("No run within the measured joints and these loads can decide. Measure instead:")
        out.say(*(f"  {name}: {catalogue.get(name, n_tubes).measure}" for name in verdict.undecided))
