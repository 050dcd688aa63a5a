"""A scenario as one HTML page that needs nothing else: no network, no other file."""

from collections.abc import Sequence

from ctcr.robot.description import Robot
from ctcr.show import html_page
from ctcr.show.html_page import as_html, bullets, cards, figure, paragraph, table, view
from ctcr.track import figures
from ctcr.track.result import COLUMNS, FAILED, FAR, Run, by_mass, rows, summary, worst
from ctcr.track.scenario import Scenario


def page(runs: list[Run], files: Sequence[str], scenario: Scenario, robot: Robot, measured: bool = False) -> str:
    """The whole HTML text; `files`: the input files; `measured`: tips are tracker readings."""
    numbers = summary(runs)
    drawn = [worst([run for run in group if run.started] or group) for group in by_mass(runs).values()]
    tip = "as measured" if measured else "without noise"
    sections = [
        _opening(numbers, scenario),
        "<h2>The path</h2>" + view(figures.scene(drawn, scenario), f"The tip {tip}, the worst run of each weight."),
        _errors(runs, numbers, scenario, measured),
        *(_one(run, scenario, robot) for run in _shown(drawn)),
    ]
    title = f"Scenario {scenario.name}: {robot.name}"
    return html_page.page(title, sections, files)


def _shown(runs: list[Run]) -> list[Run]:
    """The first weight, the last whose path was followed, and the first whose path was not."""
    started = [run for run in runs if run.started]
    good = [run for run in started if not run.failed]
    bad = [run for run in started if run.failed]
    return list({id(run): run for run in (*started[:1], *good[-1:], *bad[:1])}.values())


def _opening(numbers: dict, scenario: Scenario) -> str:
    done = [f for f in numbers.values() if not f["failed"] and f["mean_mm"] is not None]
    failed = [weight for weight, f in numbers.items() if f["failed"]]
    shown = []
    if done:
        mean, largest = (max(f[name] for f in done) for name in ("mean_mm", "max_mm"))
        shown.append(("good", f"{mean:.3f} mm", "largest mean error of a weight that did not fail"))
        shown.append(("good", f"{largest:.2f} mm", "largest error of all these"))
    if scenario.obstacle:
        clearance = min(f["obstacle_mm"] for f in numbers.values())
        shown.append(("error" if clearance < 0 else "good", f"{clearance:.2f} mm", "least distance to the obstacle"))
    shown.append(("error" if failed else "good", str(len(failed)), f"weights failed, of {len(numbers)}"))
    lead = paragraph(scenario.about, "lead") if scenario.about else ""
    verdicts = bullets(f"{weight}: {f['verdict']}" for weight, f in numbers.items())
    return f"{lead}{cards(shown)}{verdicts}"


def _errors(runs: list[Run], numbers: dict, scenario: Scenario, measured: bool) -> str:
    text = (
        "Distance between the tip and its reference; boxes are quartiles, whiskers reach to all values, diamonds are "
        f"means. Left out: references nearer than {1e3 * FAR:g} mm to the obstacle, where the tip has to deviate."
    )
    drawn = figure(figures.boxes, runs, 8.5, 3.8, text, wide=True)
    noise = "as measured, with noise" if measured else f"noise {scenario.noise_mm:g} mm a reading and axis"
    note = (
        f'<p class="soft">A run fails that is off by more than {1e3 * FAILED:g} mm, touches the obstacle or stops. '
        f"Runs a weight: {scenario.repetitions}; {noise}.</p>"
    )
    return f"<h2>Tracking errors</h2>{drawn}{table('Errors by weight', COLUMNS, rows(numbers), 1)}{note}"


def _one(run: Run, scenario: Scenario, robot: Robot) -> str:
    text = "Grasped ends and angles of the tubes, with their limits; red: held at a limit."
    joints = figure(figures.actuators, (run, robot, scenario), 10.4, 3.6, text, wide=True)
    text = "The error, and when each task gave way."
    tasks = figure(figures.tasks, (run, scenario), 10.4, 3.8, text, wide=True)
    heading = as_html(f"{run.mass_g:g} g, run {run.repetition}: {run.verdict()}")
    return f"<h2>{heading}</h2>{joints}{tasks}"
