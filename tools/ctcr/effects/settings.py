"""Values of the parameters of effects: as texts of the command line (delay=0.05), by name, or of a diagnosis."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from ctcr import inputs
from ctcr.effects import catalogue
from ctcr.errors import ArgumentError, InputError, Problem, suggestion
from ctcr.robot.description import Robot


def settings(given: Iterable[str], robot: Robot, ids: Sequence[str] = ()) -> dict[str, float]:
    """Values by full name, SI, from texts such as EFFECT.PARAMETER.TUBE=VALUE.

    Without a tube the value is that of all tubes, or a list, one value a tube. Without a parameter it is that of the
    effect's only amplitude. With a single effect in `ids` its name may be left out. Raises InputError with all faults.
    """

    def read(text: str) -> dict[str, float]:
        key, sign, value = text.partition("=")
        if not sign:
            raise _fault(text, "needs NAME=VALUE, such as friction.coefficient=0.02")
        return _one(key.strip(), value.split(","), text, robot.n_tubes, list(ids))

    return _together(read, given)


def named(given: Mapping[str, float], robot: Robot, ids: Sequence[str] = ()) -> dict[str, float]:
    """Values by full name, SI, from those by the names that settings() takes. Raises InputError with all faults."""
    return _together(lambda key: _one(key, [given[key]], f"{key}={given[key]:g}", robot.n_tubes, list(ids)), given)


def _together(read: Callable[[str], dict[str, float]], given: Iterable[str]) -> dict[str, float]:
    found, problems = {}, []
    for text in given:
        try:
            found |= read(text)
        except InputError as error:
            problems += error.problems
    if problems:
        raise ArgumentError(problems)
    return found


def diagnosed(path: str | Path, robot: Robot) -> tuple[list[str], dict[str, float], dict[str, float]]:
    """Like found(), from a file that `ctcr diagnose --json` wrote. Raises InputError where it is no such file."""
    content = inputs.read(path, "this is not an answer of ctcr diagnose --json")
    try:
        return found(json.loads(content), robot)
    except (ValueError, LookupError, TypeError):
        raise InputError(Problem("is not an answer of ctcr diagnose --json", path)) from None


def found(answer: Any, robot: Robot) -> tuple[list[str], dict[str, float], dict[str, float]]:
    """Effects of a diagnosis (its as_dict()), the first of each class, then their held and their fitted values.

    Choices are held, and so are parameters without a fitted value, at their neutral value.
    """
    ids, held, values = [], {}, {}
    for entry in answer["effects"]:
        effect, parameters = catalogue.get(entry["class"][0], robot.n_tubes), dict(entry["parameters"])
        ids.append(effect.id)
        for parameter in effect.parameters:
            for name in parameter.full_names:
                value = parameters.get(name.removeprefix(f"effects.{effect.id}."))
                to = held if value is None or parameter.kind == "choice" else values
                to[name] = parameter.neutral if value is None else float(value)
    return ids, held, values


def _one(key: str, values: Sequence[str | float], text: str, n_tubes: int, ids: list[str]) -> dict[str, float]:
    """The values of a name by full name; `text` is what faults show."""
    parts = key.split(".")
    parts = parts[1:] if parts[0] == "effects" else parts
    known = catalogue.all_effects(n_tubes)
    if len(ids) == 1 and parts[0] not in known:
        parts = [ids[0], *parts]
    effect = catalogue.get(parts[0], n_tubes)
    if ids and effect.id not in ids:
        raise _fault(text, f"{effect.id} is not among the effects to add")
    if len(parts) == 1:
        amplitudes = [p.name for p in effect.parameters if p.kind == "amplitude"]
        if len(amplitudes) != 1:
            raise _fault(text, f"{effect.id} has several parameters, name one: {', '.join(amplitudes)}")
        parts.append(amplitudes[0])
    parameter = next((p for p in effect.parameters if p.name == parts[1]), None)
    if parameter is None:
        names = [p.name for p in effect.parameters]
        hint = suggestion(parts[1], names, f"its parameters are {', '.join(names)}")
        raise _fault(text, f"{effect.id} has no parameter {parts[1]}: {hint}")
    names = list(parameter.full_names)
    if len(parts) > 2:
        name = ".".join(["effects", *parts])
        if name not in names:
            tube = f"a tube from 1 to {n_tubes}" if parameter.per_tube else "no tube: it has one value"
            raise _fault(text, f"{parts[1]} needs {tube}")
        names = [name]
    numbers = [_number(item, text, parameter) for item in values]
    if len(numbers) not in (1, len(names)):
        raise _fault(text, f"needs one number, or {len(names)}")
    return dict(zip(names, numbers * (len(names) // len(numbers)), strict=True))


def _number(item: str | float, text: str, parameter: catalogue.EffectParameter) -> float:
    unit = parameter.unit or "no unit"
    try:
        number = float(item)
    except ValueError:
        raise _fault(text, f"{str(item).strip()!r} is not a number (in {unit})") from None
    low, high = parameter.hard
    if not isfinite(number) or not low <= number <= high:
        raise _fault(text, f"{number:g} is impossible: {parameter.name} is {low:g} to {high:g} ({unit})")
    return number


def _fault(text: str, message: str) -> ArgumentError:
    return ArgumentError(Problem(message, field=text))
