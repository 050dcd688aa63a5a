"""Output of commands: files that are whole or absent, JSON, tables on a terminal, progress bars."""

import errno
import json
import os
import stat
import sys
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import IO, Any

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.measure import Measurement
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from ctcr.errors import InputError, Problem, file_faults
from ctcr.show.wording import visible

PROGRESS_AFTER_S = 1.0


@contextmanager
def atomic_writer(path: str | Path, binary: bool = False) -> Iterator[IO]:
    """A file to write; it appears under its name when the block ends well, and leaves nothing behind when not.

    Raises InputError where the folder cannot be written or the disk is full.
    """
    target = Path(os.path.realpath(path))  # a link stays a link
    mode = {"mode": "wb"} if binary else {"mode": "w", "encoding": "utf-8", "newline": "\n"}
    if target.is_dir():
        raise InputError(Problem("cannot write it: it is a folder", str(path)))
    if not target.parent.exists():
        raise InputError(Problem(f"cannot write it: make the folder {Path(path).parent} first", str(path)))
    special = target.exists() and not target.is_file()  # /dev/null and the like are written, never replaced
    temporary = None
    try:
        with file_faults(path, "write"):
            if special:
                with open(target, **mode, opener=_open_at_once) as file:
                    yield file
                return
            handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
            with open(handle, **mode) as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, _permissions(target))
            os.replace(temporary, target)
            temporary = None
    finally:
        if temporary:
            Path(temporary).unlink(missing_ok=True)


def _open_at_once(target: str, flags: int) -> int:
    """A device, or a pipe that is read: to open another one would wait for its reader."""
    try:
        handle = os.open(target, flags | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ENXIO:
            error.strerror = "nothing reads this pipe"
        raise
    os.set_blocking(handle, True)
    return handle


def write_text(text: str, target: str | Path) -> None:
    """Writes a file whole or not at all; errors as `atomic_writer`."""
    with atomic_writer(target) as file:
        file.write(text)


def write_json(data: Any, target: str) -> None:
    """Writes `data` as JSON to a file, or to standard output for "-"; see `plain` for the types it may hold."""
    text = json.dumps(plain(data), indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    write_text(text, target)


def plain(data: Any) -> Any:
    """`data` as JSON types: dataclasses become objects, arrays lists, numbers that are not finite null."""
    if is_dataclass(data):
        data = asdict(data)
    if isinstance(data, dict):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    if hasattr(data, "tolist"):
        return plain(data.tolist())
    if isinstance(data, float) and not abs(data) < float("inf"):
        return None
    return data


class Terminal(Console):
    """The way to the terminal: names of the user's reach it as they are written, whatever they hold.

    No markup is read, and `visible` shows what does not print. It leaves one line of a text: print each by itself.
    """

    def __init__(self, **options: Any):
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(visible(text), **options)

    def print(self, *objects: Any, **options: Any) -> None:
        super().print(*objects, crop=False, **options)

    def bullets(self, lines: Iterable[str], title: str = "") -> None:
        """A list of sentences below its title; nothing without any."""
        for number, line in enumerate(lines):
            if title and not number:
                self.print(title, style="bold")
            self.print(f"  • {line}")


class _Whole(Table):
    """A table that is never narrower than its words and numbers: a terminal may break its lines, nothing cuts them."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        least = Measurement.get(console, options.update(width=sys.maxsize), self).minimum
        return super().__rich_console__(console, options.update(width=max(options.max_width, least)))


def console(json_target: str | None = None) -> Terminal:
    """A terminal for human readers; it leaves standard output alone when that carries JSON."""
    wraps = (sys.stderr if json_target == "-" else sys.stdout).isatty()  # a file or a pipe gets lines as they are
    return Terminal(stderr=json_target == "-", soft_wrap=not wraps)


def table(
    title: str,
    columns: Iterable[str],
    rows: list[list[str | list[str]]],
    text_columns: int = 1,
    text: Collection[int] = (),
):
    """A rich table: the first columns, or those of `text`, are text, the others numbers. A cell may have several lines.

    On a narrow terminal text wraps between words, so that numbers and names are not cut.
    """
    made = _Whole(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for i, column in enumerate(columns):
        is_text = i in text if text else i < text_columns
        cells = [line.strip() for row in rows for line in ([row[i]] if isinstance(row[i], str) else row[i])]
        folds = is_text and any(" " in cell for cell in cells)
        whole = [word for cell in (*cells, column) for word in (cell.split() if folds else [cell])]
        longest = max(map(len, whole), default=0)
        made.add_column(column, justify="left" if is_text else "right", no_wrap=not folds, min_width=longest)
    for row in rows:
        made.add_row(*(cell if isinstance(cell, str) else Group(*cell) for cell in row))
    return made


class Progress(AbstractContextManager):
    """A progress bar on standard error, shown only on a terminal and only once the work has taken a second."""

    def __init__(self, task: str, total: float):
        self.task, self.total, self.done = task, total, 0.0
        self._start, self._bar = time.monotonic(), None

    def __exit__(self, *_) -> None:
        if self._bar:
            self._bar.stop()

    def advance(self, amount: float) -> None:
        self.done += amount
        if self._bar is None and time.monotonic() - self._start > PROGRESS_AFTER_S and sys.stderr.isatty():
            self._show()
        if self._bar:
            self._bar.update(self._id, completed=self.done)

    def _show(self) -> None:
        columns = ("{task.description}", *Bar.get_default_columns()[1:])  # theirs would read markup
        self._bar = Bar(*columns, console=Terminal(stderr=True), transient=True)
        self._id = self._bar.add_task(self.task, total=self.total)
        self._bar.start()


def _permissions(target: Path) -> int:
    """Permissions of a file that is replaced, or of a new one by the umask; those of temporary files are private."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
