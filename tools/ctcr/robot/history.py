"""The ledger of a robot file as a table and as a waterfall: from the error of its first values to the noise floor."""

import html
from dataclasses import dataclass
from pathlib import Path

from ctcr.robot.description import Robot
from ctcr.show import html_page
from ctcr.show.output import atomic_writer, table
from ctcr.show.style import ERROR, NOISE, OUT, draw

FLOOR = "noise floor"
_BAR = 44  # characters of the longest bar


@dataclass(frozen=True)
class Line:
    """An entry of the ledger in words."""

    date: str
    command: str
    source: str
    what: str
    error: str


@dataclass(frozen=True)
class Stage:
    """A step of the waterfall: the error on readings that the fit had not seen, where there were any."""

    name: str
    rms_mm: float
    source: str


def entries(robot: Robot) -> list[Line]:
    """The ledger, oldest first."""
    return [
        Line(str(entry.get("date", "")), str(entry.get("command", "")), _source(entry), _what(entry), _error(entry))
        for entry in robot.history
    ]


def waterfall(robot: Robot) -> list[Stage]:
    """Errors from the oldest entry that has them to the newest, and the noise floor of the newest last.

    An entry begins with what the one before ended with, so that only the first tells of the file's first values.
    """
    stages, floor = [], None
    for entry in robot.history:
        figures = _figures(entry)
        if not figures:
            continue
        source = _source(entry)
        found = {name: value for name, value in figures.items() if name not in ("noise_floor", "nominal")}
        if not stages and "nominal" in figures:
            stages.append(Stage("robot file", figures["nominal"], source))
        if "held_out" in found:
            found = {"calibrated": found["held_out"]}
        elif any(stage.name == "calibrated" for stage in stages):
            found.pop("calibrated", None)
        stages += [Stage(_named(name), value, source) for name, value in found.items()]
        floor = Stage(FLOOR, figures["noise_floor"], source) if "noise_floor" in figures else floor
    return [*stages, floor] if floor else stages


def show(console, robot: Robot, lines: list[Line], stages: list[Stage]) -> None:
    """Both on the terminal."""
    if not lines:
        console.print(f"{robot.name}: nothing was changed yet (ctcr calibrate, ctcr add)", markup=False)
        return
    rows = [[line.date, line.command, line.source, line.what, line.error] for line in lines]
    console.soft_wrap = False
    console.print(table(f"Ledger of {robot.name}", ["date", "command", "from", "what", "error"], rows, 5))
    if not stages:
        return
    most = max(stage.rms_mm for stage in stages)
    width = max(len(stage.name) for stage in stages)
    console.print("Error, mm RMS, on readings that the fits have not seen")
    for before, stage in zip([None, *stages], stages, strict=False):
        bar = "█" * max(1, round(_BAR * stage.rms_mm / most))
        console.print(f"  {stage.name:{width}}  {stage.rms_mm:7.3f}  {bar}{_change(before, stage)}", markup=False)
    sources = list(dict.fromkeys(stage.source for stage in stages if stage.source))
    if len(sources) > 1:
        console.print(f"The figures come from different tables: {', '.join(sources)}", markup=False)


def write_report(robot: Robot, target: str | Path, file: str) -> None:
    """Both as one HTML page that needs nothing else."""
    stages, lines = waterfall(robot), entries(robot)
    title = f"History: {robot.name}"
    head = "".join(f'<th class="text">{name}</th>' for name in ("date", "command", "from", "what", "error"))
    body = "".join(
        "<tr>" + "".join(f'<td class="text">{html.escape(text)}</td>' for text in vars(line).values()) + "</tr>"
        for line in lines
    )
    picture = draw(draw_waterfall, stages, 10.4, 4.4) if stages else ""
    lead = _lead(stages) if stages else "Nothing was changed yet." if not lines else ""
    section = (
        f'<h1>{html.escape(title)}</h1><p class="lead">{html.escape(lead)}</p><figure>{picture}</figure>'
        f"<h2>Ledger</h2><table><tr>{head}</tr>{body}</table>"
    )
    with atomic_writer(target) as page:
        page.write(html_page.page(title, [section], file, "ctcr history"))


def _lead(stages: list[Stage]) -> str:
    steps = [stage for stage in stages if stage.name != FLOOR]
    text = f"The error fell from {steps[0].rms_mm:.3g} to {steps[-1].rms_mm:.3g} mm RMS"
    floor = [stage for stage in stages if stage.name == FLOOR]
    return text + (f"; noise alone would leave {floor[0].rms_mm:.3g} mm." if floor else ".")


def draw_waterfall(figure, stages: list[Stage]) -> None:
    """A bar a stage, and the noise floor as a line."""
    axes = figure.subplots()
    for place, stage in enumerate(stages):
        colour = NOISE if stage.name == FLOOR else ERROR if place == 0 else OUT
        axes.bar(place, stage.rms_mm, width=0.62, color=colour)
        change = _change(stages[place - 1] if place else None, stage)
        axes.annotate(
            f"{stage.rms_mm:.3g}{change}",
            (place, stage.rms_mm),
            (0, 3),
            textcoords="offset points",
            ha="center",
            fontweight="bold",
        )
    if stages[-1].name == FLOOR:
        axes.axhline(stages[-1].rms_mm, color=NOISE, ls="--", lw=1)
    axes.set_xticks(range(len(stages)), [stage.name.replace(" ", "\n", 1) for stage in stages])
    axes.set(ylabel="error, mm RMS", ylim=(0, 1.14 * max(stage.rms_mm for stage in stages)))
    axes.grid(axis="x", visible=False)


def _change(before: Stage | None, stage: Stage) -> str:
    if before is None or stage.name == FLOOR or not before.rms_mm > 0:
        return ""
    return f"  {100 * (stage.rms_mm / before.rms_mm - 1):+.0f} %"


def _named(name: str) -> str:
    return name.removeprefix("with_").replace("_", " ") if name != "calibrated" else name


def _figures(entry: dict) -> dict[str, float]:
    """The errors of an entry by stage, in order; what is no number is left out, as a file may be edited by hand."""
    figures = entry.get("figures")
    found = figures.get("rms_mm") if isinstance(figures, dict) else None
    if not isinstance(found, dict):
        return {}
    return {str(key): float(value) for key, value in found.items() if isinstance(value, int | float) and value > 0}


def _source(entry: dict) -> str:
    sources = entry.get("sources")
    files = [str(item.get("file", "")) for item in sources if isinstance(item, dict)] if sources else []
    return ", ".join(files)


def _what(entry: dict) -> str:
    figures = entry.get("figures") if isinstance(entry.get("figures"), dict) else {}
    said = [f"{verb} {', '.join(map(str, figures[verb]))}" for verb in ("added", "removed") if figures.get(verb)]
    changes = entry.get("changes")
    if changes:
        said.append(f"{len(changes)} values changed")
    return "; ".join(said)


def _error(entry: dict) -> str:
    figures = _figures(entry)
    steps = [value for name, value in figures.items() if name != "noise_floor"]
    if not steps:
        return ""
    text = " → ".join(f"{value:.3g}" for value in ([steps[0], steps[-1]] if len(steps) > 1 else steps))
    floor = f" (floor {figures['noise_floor']:.2g})" if "noise_floor" in figures else ""
    return f"{text} mm{floor}"
