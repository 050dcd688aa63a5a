"""A recording in progress as a page that the browser reloads: a file, so nothing listens on the network."""

import time
from contextlib import AbstractContextManager
from math import isnan
from pathlib import Path

from ctcr.bench.record.display import in_mm
from ctcr.bench.record.session import Progress
from ctcr.show import html_page
from ctcr.show.output import write_text

EVERY_S = 2
SHOWN = 400  # newest readings
WIDTH, HEIGHT, LEFT, BOTTOM = 860, 300, 60, 30  # of the picture and its margins [px]


class LivePage(AbstractContextManager):
    """Shows the newest progress every EVERY_S; in a `with` block, whose end stops the reloading."""

    def __init__(self, path: str | Path, title: str):
        self._path, self._title = path, title
        self._next, self._last = 0.0, Progress(0)

    def __exit__(self, *_) -> None:
        self._write(reload_s=0)

    def show(self, progress: Progress) -> None:
        """Raises InputError where the file cannot be written."""
        self._last, now = progress, time.monotonic()
        if now >= self._next:
            self._next = now + EVERY_S
            self._write(EVERY_S)

    def _write(self, reload_s: int) -> None:
        write_text(page(self._last, self._title, reload_s), self._path)


def page(progress: Progress, title: str, reload_s: int) -> str:
    """The whole HTML text."""
    errors = progress.errors_mm
    known = [error for error in errors if not isnan(error)]
    numbers = [("good", f"{progress.done} of {progress.total}", "rows of the plan")]
    if known:
        numbers += [
            ("good", in_mm(errors[-1]), "error of the last reading"),
            ("good", in_mm(progress.rms_mm), "RMS error against the model"),
            ("error", in_mm(max(known)), "largest error"),
        ]
    doing = progress.doing if progress.seen else f"{progress.doing}: the tracker does not see the sensor"
    sections = [
        html_page.paragraph(doing if reload_s else "ended", "lead"),
        html_page.cards(numbers),
        picture(errors[-SHOWN:], len(errors)),
    ]
    return html_page.page(title, sections, reload_s=reload_s)


def picture(errors_mm: list[float], count: int) -> str:
    """The newest errors over the number of the reading, of `count`, as SVG; no point where one is not known.

    Nothing where none is known.
    """
    known = [error for error in errors_mm if not isnan(error)]
    if not known:
        return ""
    top = max(known) or 1.0
    step = (WIDTH - LEFT) / max(1, len(errors_mm) - 1)

    def height(error: float) -> float:
        return 10 + (HEIGHT - BOTTOM - 10) * (1 - error / top)

    points = [(LEFT + i * step, height(error)) for i, error in enumerate(errors_mm) if not isnan(error)]
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5"/>' for x, y in points)
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    levels = "".join(
        f'<line x1="{LEFT}" x2="{WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="var(--line)"/>'
        f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:.2f}</text>'
        for value, y in ((value, height(value)) for value in (0.0, top / 2, top))
    )
    first, base = count - len(errors_mm) + 1, HEIGHT - 8
    return (
        f'<figure class="wide"><svg viewBox="0 0 {WIDTH + 10} {HEIGHT}" font-size="12" fill="var(--noise)">{levels}'
        f'<text x="{LEFT}" y="{base}">reading {first}</text>'
        f'<text x="{WIDTH}" y="{base}" text-anchor="end">{count}</text>'
        f'<polyline points="{line}" fill="none" stroke="var(--faint)"/><g fill="var(--error)">{dots}</g></svg>'
        "<figcaption>Distance between the measured tip and that of the model at the joints of the encoders, mm, newest "
        "right.</figcaption></figure>"
    )
