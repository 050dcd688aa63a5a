"""Progress of a recording on the terminal, with its error against the model so far."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import isnan

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from ctcr.bench.record.session import Progress
from ctcr.show.output import Terminal

BLOCKS = "▁▂▃▄▅▆▇█"
WIDTH = 60
EVERY_S = 0.1


class Display:
    """A progress bar and a bar for each of the last readings. Shows nothing where standard error is no terminal."""

    def __init__(self):
        console = Terminal(stderr=True)
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None
        self._next, self._start = 0.0, time.monotonic()
        self._first_done = None

    def __enter__(self) -> "Display":
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_) -> None:
        if self._live:
            self._live.stop()

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Leaves the terminal to somebody else."""
        self.__exit__()
        yield
        self.__enter__()

    def show(self, progress: Progress) -> None:
        now = time.monotonic()
        if self._live and now >= self._next:
            self._next = now + EVERY_S
            self._live.update(self._lines(progress, now), refresh=True)

    def _lines(self, progress: Progress, now: float) -> Group:
        if self._first_done is None:
            self._first_done = progress.done
        done = progress.done - self._first_done
        left = (now - self._start) / done * (progress.total - progress.done) if done else None
        ends = "" if left is None else f"{left / 60:.0f} min left" if left > 90 else f"{left:.0f} s left"
        head = Table.grid(padding=(0, 2))
        bar = ProgressBar(total=progress.total, completed=progress.done, width=30)
        head.add_row(f"{progress.done} of {progress.total} rows", bar, ends, progress.doing)
        lines, errors = [head], progress.errors_mm
        if not progress.seen:
            lines.append(Text("the tracker does not see the sensor: waiting for it", style="bold red"))
        if errors:
            worst = max((e for e in errors if not isnan(e)), default=errors[-1])
            figures = f"now {in_mm(errors[-1])}, RMS {in_mm(progress.rms_mm)}, worst {in_mm(worst)}"
            lines.append(f"error against the model: {figures}")
            lines.append(f"{picture(errors)}  newest right, full height {in_mm(_top(errors))}")
        return Group(*lines)


def picture(errors_mm: list[float]) -> str:
    """The last errors as blocks; a gap where one is not known."""
    top, last = _top(errors_mm), len(BLOCKS) - 1
    return "".join(" " if isnan(e) else BLOCKS[min(last, int(e / top * len(BLOCKS)))] for e in errors_mm[-WIDTH:])


def _top(errors_mm: list[float]) -> float:
    return max((e for e in errors_mm[-WIDTH:] if not isnan(e)), default=1.0) or 1.0


def in_mm(value: float) -> str:
    """An error as displays show it."""
    return "not known" if isnan(value) else f"{value:.2f} mm"
