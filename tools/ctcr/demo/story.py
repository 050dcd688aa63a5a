"""A story told by commands: each runs as a person would type it, and its result is kept."""

import json
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ctcr.errors import InputError, Problem, file_faults
from ctcr.show.output import Terminal

LOG = "log.txt"


@dataclass(frozen=True)
class Step:
    """A command that was run: why, how it is typed, its result in words, its duration [s]."""

    why: str
    command: str
    found: str
    seconds: float


def new_folder(path: str | Path) -> Path:
    """An empty folder for a story; that of an earlier story is removed. Raises InputError for anything else."""
    folder = Path(path)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / LOG).exists():
        raise InputError(Problem("is not empty and holds no demonstration: choose another folder", str(folder)))
    with file_faults(folder, "write"):
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(parents=True)
    (folder / LOG).touch()
    return folder


class Story:
    """Runs `ctcr` commands in a folder, with their output in its log, and prints each step."""

    def __init__(self, folder: Path, console: Terminal):
        self.folder, self.steps, self.answers = folder, [], {}
        self._console = console

    def do(self, why: str, command: str, found: str | Callable[[Any], str], answer: str = "") -> None:
        """Runs one command line. With `answer` its JSON is kept under that name; `found` puts it into words: a function
        of it, or a format with its keys.

        Raises InputError with the message of the command where it fails.
        """
        self._console.print(f"{len(self.steps) + 1:2}. {why}", style="bold")
        self._console.print(f"    $ ctcr {command}", style="dim")
        start, told = time.monotonic(), None
        self._run(shlex.split(command) + (["--json", f"{answer}.json"] if answer else []), command)
        if answer:
            told = self.answers[answer] = json.loads((self.folder / f"{answer}.json").read_text(encoding="utf-8"))
        words = found(told) if callable(found) else found.format_map(told or {})
        step = Step(why, f"ctcr {command}", words, time.monotonic() - start)
        self.steps.append(step)
        self._console.print(f"    {step.found} ({step.seconds:.0f} s)", style="green")

    def _run(self, arguments: list[str], command: str) -> None:
        with open(self.folder / LOG, "a", encoding="utf-8") as log:
            log.write(f"$ ctcr {command}\n")
            log.flush()
            done = subprocess.run(
                [sys.executable, "-m", "ctcr", *arguments],
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=None if sys.stderr.isatty() else subprocess.PIPE,  # the command shows its progress on a terminal
                text=True,
            )
            log.write(f"{done.stderr or ''}\n")
        if done.returncode:
            said = " ".join((done.stderr or "").split()).removeprefix("Error: ")
            where = f"ctcr {command} (see {self.folder / LOG})"
            raise InputError(Problem(f"failed{': ' + said if said else ''}", where))
