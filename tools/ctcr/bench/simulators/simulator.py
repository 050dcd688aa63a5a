"""Shared by both simulators: the loop that serves, and faults switched by the control socket or a scenario file."""

import select
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar

from ctcr.bench.shared.control import ControlSocket
from ctcr.bench.shared.real_time import Duty, real_time
from ctcr.errors import InputError, Problem, shown, suggestion
from ctcr.robot import yaml_document

Settings = dict[str, Any]
MOST_DEVICES, MOST_MS = 255, 60_000  # a bus is shorter, and a program that waits longer has given up


class Simulator:
    """One device. `faults` holds the present value of each fault of `none`, which maps names to the value without it;
    `most` the largest value of those that number a part of the device.

    Its control socket is `folder/name.sock`.
    """

    ASKS: ClassVar[tuple[str, ...]] = ()  # what the control socket may ask beyond faults

    def __init__(
        self,
        folder: Path,
        name: str,
        none: Settings,
        duty: Duty,
        scenario: str | Path | None,
        most: Mapping[str, int] = MappingProxyType({}),
    ):
        self._none, self._duty, self._most = none, duty, most
        self.faults = SimpleNamespace(**none)
        self._scenario = load_scenario(scenario, none, most) if scenario else []
        self._control = ControlSocket(folder, name, self._reply)
        self._start = time.monotonic()

    def close(self) -> None:
        self._control.close()

    def run(self) -> None:
        """Serves until it is interrupted."""
        with real_time(self._duty):
            while True:
                self.step()

    def step(self) -> None:
        """Waits for the next thing to do, and does it."""
        sources, wait = self.waits_for()
        ready, _, _ = select.select([*self._control.sources, *sources], [], [], max(0.0, wait))
        while self._scenario and self._scenario[0][0] <= time.monotonic() - self._start:
            self.set_faults(self._scenario.pop(0)[1])
        self._control.answer(ready)
        self.work(bool(sources) and sources[0] in ready)

    def waits_for(self) -> tuple[list, float]:
        """The line to the host, where there is one, and the longest wait for it [s]."""
        raise NotImplementedError

    def work(self, heard: bool) -> None:
        """Everything that is due; `heard`: the host has sent something."""
        raise NotImplementedError

    def set_faults(self, changes: Settings) -> None:
        """Changes some faults; null ends one. Raises InputError and changes nothing where one cannot be."""
        vars(self.faults).update(checked(changes, self._none, self._most))

    def request(self, message: Settings) -> Settings:
        """Does what the control socket asks beyond faults; returns the state."""
        raise NotImplementedError

    def _reply(self, message: Settings) -> Settings:
        if not isinstance(message, dict) or not isinstance(faults := message.get("faults", {}), dict):
            raise InputError(Problem("needs an object, and so do its `faults`"))
        if unknown := [str(key) for key in message if key not in ("faults", *self.ASKS)]:
            known = ", ".join(["faults", *self.ASKS])
            raise InputError(Problem(f"is nothing that this device has ({known})", field=key) for key in unknown)
        if "faults" in message:
            self.set_faults(faults)
        return {"faults": dict(vars(self.faults))} | self.request(message)


def checked(changes: Settings, none: Settings, most: Mapping[str, int] = MappingProxyType({})) -> Settings:
    """Changes of faults with null replaced by the value without the fault. Raises InputError with all that is wrong.

    `most`: the largest value of faults that number something.
    """
    problems, values = [], {}
    for name, value in changes.items():
        if name not in none:
            hint = suggestion(name, none, f"there are {', '.join(none)}")
            problems.append(Problem(f"unknown fault: {hint}", field=name))
            continue
        values[name] = none[name] if value is None else value
        kinds, largest, needed = _possible(name, none[name], most.get(name, MOST_DEVICES))
        if type(values[name]) not in kinds or not 0 <= values[name] <= largest:
            problems.append(Problem(f"{shown(value)}: needs {needed}", field=name))
    if problems:
        raise InputError(problems)
    return values


def _possible(name: str, none: Any, most_devices: int) -> tuple[tuple[type, ...], float, str]:
    """Types and largest value of a fault, and both in words."""
    if isinstance(none, bool):
        return (bool,), 1, "true or false"
    if isinstance(none, int):
        return (int,), most_devices, f"a whole number, 0 to {most_devices}"
    most, unit = (MOST_MS, " ms") if name.endswith("_ms") else (1, "")
    return (int, float), most, f"a number, 0 to {most}{unit}"


def load_scenario(
    path: str | Path, none: Settings, most: Mapping[str, int] = MappingProxyType({})
) -> list[tuple[float, Settings]]:
    """Times [s] with the faults that change then, in order. Raises InputError with everything wrong in the file."""
    document = yaml_document.load(path)
    steps, problems = [], []
    for i, entry in enumerate(document.data if isinstance(document.data, list) else [None]):
        if not isinstance(entry, dict) or not isinstance(entry.get("at_s"), int | float):
            text = "needs a list of `at_s: seconds` with the faults that change then"
            problems.append(Problem(text, str(path), document.line((i,))))
            continue
        changes = {name: value for name, value in entry.items() if name != "at_s"}
        try:
            checked(changes, none, most)
        except InputError as error:
            problems += [replace(p, file=str(path), line=document.line((i, p.field))) for p in error.problems]
        steps.append((float(entry["at_s"]), changes))
    if problems:
        raise InputError(problems)
    return sorted(steps, key=lambda step: step[0])
