"""The ledger of a robot file as a table and as a waterfall: the error from the first file down to what is expected."""

from dataclasses import dataclass

from ctcr.robot.description import Robot
from ctcr.robot.ledger import section
from ctcr.show import html_page
from ctcr.show.output import table
from ctcr.show.palette import ERROR, NOISE, OUT
from ctcr.show.wording import visible

COLUMNS = {
    "date": "",
    "command": "that changed the file",
    "from": "the measurements",
    "changes": "",
    "error": "RMS before and after, and that expected of a right model",
}
FLOOR = "expected error"
_BAR = 44  # characters of the longest bar


@dataclass(frozen=True)
class Stage:
    """A step of the waterfall: the RMS error, on held-out runs where there were any."""

    name: str
    rms_mm: float
    source: str


def entries(robot: Robot) -> list[list[str]]:
    """The ledger as rows of COLUMNS, oldest first."""
    return [
        [str(entry.get("date", "")), str(entry.get("command", "")), _source(entry), _changes(entry), _error(entry)]
        for entry in robot.history
    ]


def waterfall(robot: Robot) -> list[Stage]:
    """Errors from the oldest entry that has them to the newest, and the expected error of the newest last.

    Each entry starts from the error at the end of the one before. So the error of the first file is taken from the
    first entry alone. Empty where no entry has an error.
    """
    stages, floor = [], None
    for entry in robot.history:
        figures, source = _figures(entry), _source(entry)
        if not stages and "nominal" in figures:
            stages.append(Stage("robot file", figures["nominal"], source))
        if "noise_floor" in figures:
            floor = Stage(FLOOR, figures["noise_floor"], source)
        found = {name: value for name, value in figures.items() if name not in ("noise_floor", "nominal")}
        if "held_out" in found:
            found = {"calibrated": found["held_out"]}
        elif any(stage.name == "calibrated" for stage in stages):
            found.pop("calibrated", None)
        stages += [Stage(name.removeprefix("with_").replace("_", " "), rms, source) for name, rms in found.items()]
    return [*stages, floor] if stages and floor else stages


def show(console, robot: Robot, lines: list[list[str]], stages: list[Stage]) -> None:
    """Prints the ledger and the waterfall on the terminal."""
    if not lines:
        console.print(f"{robot.name}: nothing was changed yet (ctcr calibrate, ctcr add)")
        return
    console.soft_wrap = False
    console.print(table(f"Ledger of {robot.name}", COLUMNS, lines, 5))
    if not stages:
        return
    most = max(stage.rms_mm for stage in stages)
    width = max(len(stage.name) for stage in stages)
    console.print("Error, mm RMS, on held-out readings where there were any")
    for before, stage in zip([None, *stages], stages, strict=False):
        bar = "█" * max(1, round(_BAR * stage.rms_mm / most))
        console.print(f"  {stage.name:{width}}  {stage.rms_mm:7.3f}  {bar}{_change(before, stage)}")
    sources = list(dict.fromkeys(stage.source for stage in stages if stage.source))
    if len(sources) > 1:
        console.print(f"The figures come from different tables: {', '.join(sources)}")


def page(robot: Robot) -> str:
    """The ledger and the waterfall as one HTML page that needs nothing else."""
    stages, lines = waterfall(robot), entries(robot)
    title = f"History: {robot.name}"
    lead = _lead(stages) if stages else "Nothing was changed yet." if not lines else ""
    sections = [html_page.paragraph(lead, "lead")]
    if stages:
        sections.append(figure(stages, "RMS error after each step."))
    sections.append("<h2>Ledger</h2>" + html_page.table("Oldest first", COLUMNS, lines, len(COLUMNS)))
    return html_page.page(title, sections, robot.files)


def figure(stages: list[Stage], caption: str) -> str:
    """The waterfall on a page, as wide as its bars need."""
    width = max(5.2, 1.2 * len(stages))
    return html_page.figure(draw_waterfall, stages, width, 3.4, caption, wide=width > 6)


def _lead(stages: list[Stage]) -> str:
    steps = [stage for stage in stages if stage.name != FLOOR]
    floor = f"; {stages[-1].rms_mm:.3g} mm are expected of a right model" if stages[-1].name == FLOOR else ""
    return f"The error fell from {steps[0].rms_mm:.3g} to {steps[-1].rms_mm:.3g} mm RMS{floor}."


def draw_waterfall(figure, stages: list[Stage]) -> None:
    """A bar a stage, and the expected error as a line."""
    axes = figure.subplots()
    line = stages[-1].rms_mm if stages[-1].name == FLOOR else 0.0
    above = {"textcoords": "offset points", "ha": "center", "fontweight": "bold"}
    for x, (before, stage) in enumerate(zip([None, *stages], stages, strict=False)):
        colour = NOISE if stage.name == FLOOR else OUT if before else ERROR
        axes.bar(x, stage.rms_mm, width=0.62, color=colour)
        axes.annotate(f"{stage.rms_mm:.3g}{_change(before, stage)}", (x, max(stage.rms_mm, line)), (0, 3), **above)
    if line:
        axes.axhline(line, color=NOISE, ls="--", lw=1)
    axes.set_xticks(range(len(stages)), [visible(stage.name).replace(" ", "\n", 1) for stage in stages])
    axes.set(ylabel="error, mm RMS", ylim=(0, 1.14 * max(stage.rms_mm for stage in stages)))
    axes.grid(axis="x", visible=False)


def _change(before: Stage | None, stage: Stage) -> str:
    if before is None or stage.name == FLOOR or not before.rms_mm > 0:
        return ""
    return f"  {100 * (stage.rms_mm / before.rms_mm - 1):+.0f} %"


def _figures(entry: dict) -> dict[str, float]:
    """The errors of an entry by stage, in order."""
    found = section(entry, "figures", "rms_mm")
    return {str(key): float(value) for key, value in found.items() if isinstance(value, int | float) and value > 0}


def _source(entry: dict) -> str:
    return ", ".join(str(item.get("file", "")) for item in entry.get("sources") or () if isinstance(item, dict))


def _changes(entry: dict) -> str:
    figures = section(entry, "figures")
    texts = [f"{verb} {', '.join(map(str, figures[verb]))}" for verb in ("added", "removed") if figures.get(verb)]
    changed = [f"{len(entry['changes'])} values changed"] if entry.get("changes") else []
    return "; ".join(texts + changed)


def _error(entry: dict) -> str:
    figures = _figures(entry)
    floor = figures.pop("noise_floor", None)
    steps = [f"{value:.3g}" for value in figures.values()]
    if not steps:
        return ""
    return " → ".join(dict.fromkeys([steps[0], steps[-1]])) + " mm" + (f" (expected {floor:.2g})" if floor else "")
