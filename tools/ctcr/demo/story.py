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

from ctcr.bench.devices import emergency_stop
from ctcr.bench.devices.release import release
from ctcr.errors import InputError, Problem, file_faults
from ctcr.show.output import Terminal

LOG = "log.txt"
MOST_STOPS = 9  # of one command: a busy computer lets some rows of a recording through in between


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

    def __init__(self, folder: Path, console: Terminal, bench: Path | None = None):
        """`bench`: the folder of a bench of its own, whose stops it releases."""
        self.folder, self.steps, self.answers = folder, [], {}
        self._console, self._bench = console, bench

    def do(self, why: str, command: str, found: str | Callable[[Any], str], answer: str = "") -> None:
        """Runs one command line. With `answer` its JSON is kept under that name; `found` puts it into words: a function
        of it, or a format with its keys.

        Where it ends with a stop of the bench, it is run again, which resumes it. Raises InputError with the message of
        the command where it fails otherwise.
        """
        self._console.print(f"{len(self.steps) + 1:2}. {why}", style="bold")
        self._console.print(f"    $ ctcr {command}", style="dim")
        start, told = time.monotonic(), None
        arguments = shlex.split(command) + (["--json", f"{answer}.json"] if answer else [])
        stops = 0
        while failed := self._run(arguments, command):
            stops += 1
            if stops > MOST_STOPS or not (self._bench and emergency_stop.is_stopped(self._bench)):
                raise failed
            self._console.print(f"    {release(self._bench)[-1]}; the same command again", style="yellow")
        if answer:
            told = self.answers[answer] = json.loads((self.folder / f"{answer}.json").read_text(encoding="utf-8"))
        words = found(told) if callable(found) else found.format_map(told or {})
        step = Step(why, f"ctcr {command}", words, time.monotonic() - start)
        self.steps.append(step)
        self._console.print(f"    {step.found} ({step.seconds:.0f} s)", style="green")

    def _run(self, arguments: list[str], command: str) -> InputError | None:
        """Why the command failed; None where it did not."""
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
        if not done.returncode:
            return None
        said = " ".join((done.stderr or "").split()).removeprefix("Error: ")
        return InputError(Problem(f"failed{': ' + said if said else ''}", f"ctcr {command} (see {self.folder / LOG})"))
