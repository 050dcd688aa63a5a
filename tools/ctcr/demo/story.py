"""A story told by commands: each runs as a person would type it, and what it found is kept."""

import json
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ctcr.errors import InputError, Problem, file_fault

LOG = "log.txt"


@dataclass(frozen=True)
class Step:
    """A command that was run: why, how it is typed, what it found in words, how long it took [s]."""

    why: str
    command: str
    found: str
    seconds: float


def new_folder(path: str | Path) -> Path:
    """An empty folder for a story; what an earlier one left there is removed. Raises InputError for anything else."""
    folder = Path(path)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / LOG).exists():
        raise InputError(Problem("is not empty and holds no demonstration: choose another folder", str(folder)))
    try:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(parents=True)
    except OSError as error:
        raise file_fault(error, folder, "write") from None
    (folder / LOG).touch()
    return folder


class Listener(Protocol):
    """Who hears of every step."""

    def begins(self, why: str, command: str) -> None: ...

    def ended(self, step: Step) -> None: ...


class Story:
    """Runs `ctcr` commands in a folder; what they print goes to its log."""

    def __init__(self, folder: Path, listener: Listener):
        self.folder, self.steps, self.answers = folder, [], {}
        self._listener = listener

    def do(self, why: str, command: str, found: Callable[[Any], str], answer: str = "") -> None:
        """Runs one command line. With `answer` its JSON is kept under that name, and put into words by `found`.

        Raises InputError with what the command said where it fails.
        """
        self._listener.begins(why, f"ctcr {command}")
        start, told = time.monotonic(), None
        self._run(shlex.split(command) + (["--json", f"{answer}.json"] if answer else []), command)
        if answer:
            told = json.loads((self.folder / f"{answer}.json").read_text(encoding="utf-8"))
            self.answers[answer] = told
        self.steps.append(Step(why, f"ctcr {command}", found(told), time.monotonic() - start))
        self._listener.ended(self.steps[-1])

    def _run(self, arguments: list[str], command: str) -> None:
        shown = sys.stderr.isatty()  # progress of the command goes to the terminal, if there is one
        with open(self.folder / LOG, "a", encoding="utf-8") as log:
            log.write(f"$ ctcr {command}\n")
            log.flush()
            done = subprocess.run(
                [sys.executable, "-m", "ctcr", *arguments],
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=None if shown else subprocess.PIPE,
                text=True,
            )
            log.write(f"{done.stderr or ''}\n")
        if done.returncode:
            said = (done.stderr or "").strip().removeprefix("Error: ")
            raise InputError(
                Problem(f"failed{': ' + said if said else ''}", f"ctcr {command} (see {self.folder / LOG})")
            )
