"""`ctcr next`: what to measure next."""

import click


@click.command(name="next")
@click.argument("robot")
@click.argument("measurements")
@click.option("--runs", type=click.IntRange(1, 100), default=4, show_default=True, help="Runs to propose.")
@click.option(
    "--masses", default="0,10,20", show_default=True, metavar="GRAMS", help="Masses that can be hung at the tip."
)
@click.option("-o", "--output", "target", metavar="PLAN", help="Write the runs as a table that the robot can run.")
@click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output.")
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="File of your own effects.")
@click.option("--threads", type=click.IntRange(0), default=0, help="Threads; 0: all cores.")
def command(robot, measurements, runs, masses, target, json_target, own, threads) -> None:
    """Propose the runs that best tell apart what MEASUREMENTS leave open about ROBOT.

    Diagnoses first. Each run goes out and back through the same stops under one load, within the joints measured so
    far. Says so when nothing is open, and when no run can decide.
    """
    from ctcr import plan
    from ctcr.diagnose import diagnose, terminal
    from ctcr.effects import user_effects
    from ctcr.model import simulation
    from ctcr.robot import robot_file
    from ctcr.show import output
    from ctcr.table import measurements as table

    user_effects.load_all(own)
    grams = _masses(masses)
    loaded = robot_file.load(robot)
    readings = table.load(measurements, loaded.n_tubes)
    console = output.console(json_target)
    with terminal.progress() as say:
        diagnosis = diagnose(loaded, readings, progress=say, threads=threads)
        say("looking for the runs that decide")
        proposal = plan.propose(diagnosis, runs, tuple(1e-3 * gram for gram in grams))
    if proposal.plan is not None and target:
        simulation.write(proposal.plan, target, loaded.n_tubes)
    if json_target:
        output.write_json(
            {
                "rivals": [rival.id for rival in proposal.rivals],
                "log_evidence": {"now": proposal.now if proposal.rivals else None, "expected": proposal.gain},
                "decides": proposal.decides,
                "runs": [{"beta_m": r.beta, "alpha_rad": r.alpha, "mass_kg": r.mass} for r in proposal.runs],
            },
            json_target,
        )
    _show(console, loaded.n_tubes, diagnosis.verdict.word.replace("_", " "), proposal)
    if proposal.plan is not None and target:
        console.print(f"Plan: {target}", markup=False)


def _masses(text: str) -> list[float]:
    from ctcr.errors import InputError, Problem

    try:
        grams = [float(part) for part in text.split(",")]
    except ValueError:
        grams = [-1.0]
    if not all(0 <= gram < 1000 for gram in grams):
        raise InputError(Problem(f"--masses {text}: give grams from 0 to 1000, separated by commas, as 0,10,20"))
    return grams


def _show(console, n_tubes: int, verdict: str, proposal) -> None:
    from ctcr.plan.proposal import instead
    from ctcr.show import output

    if len(proposal.rivals) < 2:
        console.print(f"Nothing is open between effects: the verdict on these measurements is {verdict}.")
        return
    console.print(f"Open: {' or '.join(rival.id for rival in proposal.rivals)}.", markup=False)
    rows = [
        [str(i), f"{1e3 * run.mass:g}", f"{gain:.1f}"]
        for i, (run, gain) in enumerate(zip(proposal.runs, proposal.gain, strict=True), start=1)
    ]
    title = f"Runs, best first; log evidence between the nearest two now: {proposal.now:.1f}"
    console.print(output.table(title, ["run", "mass at the tip, g", "expected log evidence with it"], rows))
    if proposal.decides:
        return
    console.print("No run within the measured joints and these loads can decide. Measure instead:")
    for identity, advice in instead(proposal, n_tubes).items():
        console.print(f"  {identity}: {advice}", markup=False)
