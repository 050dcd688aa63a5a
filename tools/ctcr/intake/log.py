"""A log as its file holds it: named columns of text or numbers, with the row of the file that each value came from."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from ctcr.arrays import Array, Integers
from ctcr.errors import InputError, Problem, suggestion
from ctcr.intake.names import Meaning

_WITH_UNIT = re.compile(r" \[[^][]*\]$")  # as the reader appends the unit of a row below the header


def distinct(names: Sequence[str]) -> list[str]:
    """The names, where one comes again with a number that makes it a name of its own: x, x (2)."""
    taken, made = {*names}, {}
    for name in names:
        if name in made:
            name = next(other for i in count(2) if (other := f"{name} ({i})") not in taken)
            taken.add(name)
        made[name] = None
    return list(made)


@dataclass(frozen=True)
class Log:
    """M rows. What a format says about its columns itself (`meanings`) goes before what their names suggest."""

    path: Path
    kind: str  # of file, as people call it
    names: tuple[str, ...]
    values: tuple[list[str] | Array, ...]  # a column each, (M,)
    rows: Integers  # (M,) row of the file, from 1
    decimal_comma: bool = False
    meanings: dict[str, Meaning | None] = field(default_factory=dict)  # by column
    euler: str | None = None  # sequence of the Euler angles
    notes: list[str] = field(default_factory=list)  # what was left out or assumed on reading

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_stated(self) -> bool:
        """Whether the format says what each column holds."""
        return self.names == tuple(self.meanings)

    def find(self, name: str) -> int | None:
        """The position of a column, by its name or as #3; None where it has none, or several."""
        if name in self.names:
            return self.names.index(name)
        if name.startswith("#") and name[1:].isdigit() and 1 <= int(name[1:]) <= len(self.names):
            return int(name[1:]) - 1
        for spelled in (self.names, [_WITH_UNIT.sub("", known) for known in self.names]):
            loose = [i for i, known in enumerate(spelled) if known.strip().lower() == name.strip().lower()]
            if len(loose) == 1:
                return loose[0]
        return None

    def index(self, name: str, where: str) -> int:
        """find(), or an InputError that names the option `where`."""
        if (found := self.find(name)) is not None:
            return found
        hint = suggestion(name, self.names, f"it has {', '.join(self.names[:12])}{' ...' * (len(self.names) > 12)}")
        raise InputError(Problem(f"the log has no column {name}: {hint}", str(self.path), field=where))
