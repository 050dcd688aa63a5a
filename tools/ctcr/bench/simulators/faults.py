"""Faults that a simulator can be told to have: by its control socket, or at set times by a scenario file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ctcr.errors import InputError, Problem, did_you_mean, file_fault
from ctcr.robot import yaml_document

Settings = dict[str, Any]


class Faults:
    """The faults of one simulator by name, each with the value that means: none."""

    def __init__(self, none: Settings):
        self._none, self._now = dict(none), dict(none)

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["_now"][name]
        except KeyError:
            raise AttributeError(name) from None

    def as_dict(self) -> Settings:
        return dict(self._now)

    def set(self, changes: Settings) -> None:
        """Changes some faults; null ends one. Raises InputError and changes nothing where one cannot be."""
        problems, checked = [], {}
        for name, value in changes.items():
            if name not in self._none:
                meant = did_you_mean(name, self._none)
                hint = f": did you mean {meant}?" if meant else f": there are {', '.join(self._none)}"
                problems.append(Problem(f"unknown fault{hint}", field=name))
                continue
            neutral = self._none[name]
            value = neutral if value is None else value
            kinds = (bool,) if isinstance(neutral, bool) else (int, float)
            if type(value) not in kinds:
                needed = "true or false" if kinds == (bool,) else "a number"
                problems.append(Problem(f"{value!r}: needs {needed}", field=name))
            checked[name] = value
        if problems:
            raise InputError(problems)
        self._now.update(checked)


class Scenario:
    """Changes of faults at set times, from a YAML list of `at_s` with the faults that change then."""

    def __init__(self, steps: list[tuple[float, Settings]] = ()):
        self._steps = sorted(steps, key=lambda step: step[0])

    @classmethod
    def load(cls, path: str | Path, faults: Faults) -> "Scenario":
        """Raises InputError with everything wrong in the file; its faults must be those of `faults`."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except OSError as error:
            raise file_fault(error, path, "read") from None
        document = yaml_document.parse(text, str(path))
        steps, problems = [], []
        for i, entry in enumerate(document.data if isinstance(document.data, list) else [None]):
            if not isinstance(entry, dict) or not isinstance(entry.get("at_s"), int | float):
                text = "needs a list of `at_s: seconds` with the faults that change then"
                problems.append(Problem(text, str(path), document.line((i,))))
                continue
            changes = {name: value for name, value in entry.items() if name != "at_s"}
            try:
                Faults(faults._none).set(changes)
            except InputError as error:
                problems += [
                    Problem(problem.message, str(path), document.line((i, problem.field)), problem.field)
                    for problem in error.problems
                ]
            steps.append((float(entry["at_s"]), changes))
        if problems:
            raise InputError(problems)
        return cls(steps)

    def due(self, t: float) -> Iterator[Settings]:
        """The changes up to `t` seconds after the start, each once."""
        while self._steps and self._steps[0][0] <= t:
            yield self._steps.pop(0)[1]
