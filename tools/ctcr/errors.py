"""Faults of an input, with messages that help its author to correct it."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches


@dataclass(frozen=True)
class Problem:
    """One fault and its position. `line` counts from 1; in a table it is the row that a spreadsheet shows."""

    message: str
    file: str | None = None
    line: int | None = None
    field: str | None = None
    line_name: str = "line"

    def __str__(self) -> str:
        where = [self.file, f"{self.line_name} {self.line}" if self.line else None, self.field]
        return ": ".join([", ".join(part for part in where if part), self.message]).removeprefix(": ")


class InputError(Exception):
    """An input cannot be used. `problems` holds every fault found (at most a screenful; `omitted` counts the rest)."""

    def __init__(self, problems: Problem | Iterable[Problem], omitted: int = 0):
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        self.omitted = omitted
        super().__init__(str(self))

    @property
    def lines(self) -> list[str]:
        """A line a problem, and one for those left out."""
        return [*map(str, self.problems), *([f"and {self.omitted} more"] if self.omitted else [])]

    def __str__(self) -> str:
        return "\n".join(self.lines)


class ArgumentError(InputError):
    """A wrong option of a command or argument of a function, whatever the files hold."""


def did_you_mean(name: str, choices: Iterable[str]) -> str | None:
    """The choice nearest in spelling to `name`, if any is near."""
    near = get_close_matches(name.lower(), [choice.lower() for choice in choices], n=1, cutoff=0.6)
    return next((choice for choice in choices if near and choice.lower() == near[0]), None)


def suggestion(name: str, choices: Iterable[str], otherwise: str) -> str:
    """The end of a message on an unknown name: the choice that was probably meant, or another hint."""
    meant = did_you_mean(name, choices)
    return f"did you mean {meant}?" if meant else otherwise


def shown(value: object) -> str:
    """A value as an error shows it: short, on one line, as people write it; text in quotes."""
    text = repr(value) if isinstance(value, str | bytes) else " ".join(str(value).split())
    return text if len(text) <= 40 else text[:36] + " ..."


@contextmanager
def file_faults(path: object, doing: str) -> Iterator[None]:
    """Raises the operating system's refusal of a file as an InputError of one sentence: `doing` is read or write."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(Problem(f"cannot {doing} it: {reason}", file=str(path))) from None
