"""The story at the bench as one HTML page that needs nothing else."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ctcr.arrays import Array
from ctcr.bench.devices import bench_file
from ctcr.bench.record.folder import ABOUT, TABLE
from ctcr.demo import bench_figures
from ctcr.demo.bench_figures import Driven
from ctcr.demo.bench_story import EFFECT, ROBOTS, VALUE, cube
from ctcr.demo.story import Story
from ctcr.frames import points_to_base
from ctcr.model import parameters as free_parameters
from ctcr.robot import history, robot_file
from ctcr.robot.description import Robot
from ctcr.show import html_page
from ctcr.show.html_page import as_html, cards, figure, table, view
from ctcr.show.output import write_text
from ctcr.table import measurements
from ctcr.track import scenario
from ctcr.track.recording import runs_of

TITLE = "A hidden effect, found on the bench"
SHOWN = ("actuation.home_rotation_deg", "tracker.position_mm")  # of the calibrated parameters


def write(story: Story, hidden: Robot, target) -> list[str]:
    """Writes the page and returns the end of the story in sentences. `hidden` is the robot on the bench.

    Raises InputError where the page cannot be written.
    """
    drives = _drives(story.folder)
    write_text(page(story, hidden, drives), target)
    rms = story.answers["added"]["rms_mm"]
    said = [
        f"The error of the model fell from {rms['nominal']:.2f} to {rms['calibrated']:.2f} mm by calibration, and to "
        f"{rms[EFFECT]:.2f} mm with {EFFECT}."
    ]
    if drives:
        without, with_it = drives.values()
        said.append(
            f"Driven blindly along a cube, the tip was off by {without.blind.mean():.2f} mm before and "
            f"{with_it.blind.mean():.2f} mm after; under control by {without.controlled.mean():.2f} and "
            f"{with_it.controlled.mean():.2f} mm."
        )
    return said


def page(story: Story, hidden: Robot, drives: dict[str, Driven]) -> str:
    """The whole HTML text; `drives` is empty where the story ended before the cube."""
    folder = story.folder
    known, found = robot_file.load(folder / "robot.yaml"), robot_file.load(folder / "with_effect.yaml")
    processes = (
        "Blue: the same processes as on a real bench. Brown: simulated; it answers in the bytes of the real devices, "
        "so that one line of the bench file replaces each by the real one."
    )
    fall = history.figure(history.waterfall(found), "RMS error on held-out runs.")
    sections = [
        _opening(story, found, drives),
        "<h2>The bench</h2>" + figure(bench_figures.bench, None, 10.4, 2.7, processes, wide=True),
        _steps(story),
        _first_look(story, known.n_tubes),
        "<h2>The error of the model falls</h2>" + fall,
        _cube(drives) if drives else "",
        _truth(story, known, found, hidden),
        _loops(story),
    ]
    files = [str(folder / name) for name in ("robot.yaml", "both.csv", "with_effect.yaml")]
    return html_page.page(TITLE, sections, files)


def _drives(folder: Path) -> dict[str, Driven]:
    """Along the cube, by what the model knew; empty where the story ended before."""
    if not list(folder.glob("track_*")):
        return {}
    seen_by, corners, found = robot_file.load(folder / "calibrated.yaml"), cube(folder), {}

    def in_base(points: Array) -> Array:
        return 1e3 * points_to_base(seen_by.tracker, points)

    for robot, name in ROBOTS.items():
        table = measurements.load(folder / f"blind_{robot}" / TABLE, seen_by.n_tubes)
        time, error = _controlled(folder / f"track_{robot}", robot_file.load(folder / f"{robot}.yaml"))
        found[name] = Driven(in_base(corners), in_base(table.position[-len(corners) :]), time, error)
    return found


def _controlled(recording: Path, robot: Robot) -> tuple[Array, Array]:
    """Time along the path (R,) [s], and errors (R,) [mm]."""
    about = json.loads((recording / ABOUT).read_text(encoding="utf-8"))
    wanted = scenario.load(recording / "scenario.yaml", robot.n_tubes)
    age = 1e-3 * bench_file.load(recording / "bench.yaml").tracker.reading_age_ms
    (run,) = runs_of(SimpleNamespace(path=recording, about=about), wanted, robot, age)
    return run.time, 1e3 * run.error


def _opening(story: Story, found: Robot, drives: dict[str, Driven]) -> str:
    rms = story.answers["added"]["rms_mm"]
    minutes, seconds = divmod(round(sum(step.seconds for step in story.steps)), 60)
    numbers = [
        ("error", f"{rms['nominal']:.2f} mm", "error of the model before, on held-out runs"),
        ("error", f"{rms['calibrated']:.2f} mm", "the best that calibration alone can do"),
        ("good", f"{rms[EFFECT]:.2f} mm", f"with {EFFECT}"),
    ]
    if drives:
        without, with_it = drives.values()
        for how, before, after in (
            ("driven blindly", without.blind, with_it.blind),
            ("tracked at 40 Hz", without.controlled, with_it.controlled),
        ):
            numbers.append(("good", f"{before.mean():.2f} → {after.mean():.2f}", f"mm off a cube that was {how}"))
    count = len(free_parameters.expand("standard", found))
    return (
        f'<p class="lead">A robot stands on a simulated bench. It is off its file in {count} calibrated parameters, '
        f"and {EFFECT} acts between its tubes, which its file does not know. The commands below met it through the "
        f"devices' own protocols only, and took {minutes} min {seconds} s.</p>{cards(numbers)}"
    )


def _steps(story: Story) -> str:
    rows = "".join(
        f'<li>{as_html("", bold=step.why)} <span class="soft">{step.seconds:.0f} s</span>'
        f"{html_page.command(step.command)}{as_html(step.found)}</li>"
        for step in story.steps
    )
    return f'<h2>The steps</h2><ol class="steps">{rows}</ol>'


def _first_look(story: Story, n_tubes: int) -> str:
    names = {"calibrated": "calibrated", "with_effect": f"calibrated, with {EFFECT}"}
    models = {name: robot_file.load(story.folder / f"{file}.yaml") for file, name in names.items()}
    loop = measurements.load(story.folder / "both.csv", n_tubes), models
    text = (
        "The error of the model where the same joints were reached from both sides, in its main direction. Without "
        "friction no model can be right on both ways."
    )
    drawn = figure(bench_figures.out_and_return, loop, 10.4, 3.6, text, wide=True)
    return "<h2>The same joints, out and back</h2>" + drawn


def _cube(drives: dict[str, Driven]) -> str:
    without, with_it = drives.values()
    helps = with_it.controlled.mean() < without.controlled.mean()
    text = (
        "The tip along the edges of a cube of 10 mm. Blind: joints planned with the model and driven without a look at "
        "the tracker, so that the error is that of the model. Controlled: the tracker corrects what the model does not "
        f"know; there, knowing {EFFECT} {'helps too' if helps else 'does not help'}."
    )
    drawn = figure(bench_figures.tracking, drives, 10.4, 3.8, text, wide=True)
    tips = view(bench_figures.scene(drives), "The cube, and the corners that the blind robot reached; base frame.")
    return f"<h2>The error in tracking</h2>{drawn}{tips}"


def _truth(story: Story, known: Robot, found: Robot, hidden: Robot) -> str:
    parameters = story.answers["added"]["parameters"]
    rows = [
        [name.removeprefix("effects."), "0", f"{p['value']:.4f}", f"{p['sd']:.4f}", f"{VALUE:.4f}"]
        for name, p in parameters.items()
        if ".coefficient." in name
    ]
    for change in found.history[-1]["changes"]:
        if (field := change["field"]).startswith(SHOWN):
            numbers = (_at(known, field), change["new"], change["sd"], _at(hidden, field))
            rows.append([field, *(f"{number:.2f}" for number in numbers)])
    columns = {
        "": "",
        "robot file": "the value before",
        "found": "by the fit",
        "standard deviation": "of the value found",
        "true": "of the simulated robot",
    }
    return "<h2>Found and true values</h2>" + table("", columns, rows, 1)


def _at(robot: Robot, path: str) -> float:
    """The value at a path of the robot file, such as tubes[0].length_mm."""
    value: Any = robot
    for name, index in re.findall(r"(\w+)|\[(\d+)\]", path):
        value = value[int(index)] if index else getattr(value, name)
    return value


def _loops(story: Story) -> str:
    columns = {
        "recording": "",
        "frames": "of the tracker",
        "missed": "frames that were not read",
        "frames late, ms": "99 of 100 frames are later by less",
        "bus cycles": "exchanges with the motors",
        "bad": "cycles without an answer",
        "cycles late, ms": "99 of 100 cycles begin later by less",
        "worst, ms": "the latest cycle",
        "real-time": "whether the bus had real-time priority",
    }
    rows = []
    for path in sorted(story.folder.glob(f"*/{ABOUT}"), key=lambda path: path.stat().st_mtime):
        about = json.loads(path.read_text(encoding="utf-8"))["sittings"][-1]
        bus, tracker = about["bus"], about["tracker"]
        counts = [tracker["frames"], tracker["missed"], f"{about['frames_late']['p99_ms']:.2f}"]
        counts += [bus["cycles"], bus["bad_cycles"], f"{bus['p99_late_ms']:.2f}", f"{bus['worst_late_ms']:.2f}"]
        rows.append([path.parent.name, *map(str, counts), "yes" if bus["real_time_priority"] else "no"])
    return "<h2>How steady the loops were</h2>" + table("", columns, rows, 1)
