"""Reads and writes robot.yaml.

`load` reports every error of a file at once, `warnings` values that are possible but look wrong. `save` keeps the
comments and the layout of the file that the robot came from; a comment beside a value that has changed says that
it was written for an earlier one.
"""

import io
from collections.abc import Iterable
from math import degrees, radians
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedBase, CommentedMap
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.tokens import CommentToken
from ruamel.yaml.util import load_yaml_guess_indent

from ctcr import _core, settings
from ctcr.arguments import checked
from ctcr.errors import InputError, Problem, suggestion
from ctcr.robot import checks, defaults, yaml_document
from ctcr.robot.description import Robot
from ctcr.robot.yaml_document import YamlDocument
from ctcr.show.output import atomic_writer

LINE_WIDTH = 1000  # a row of the ledger stays one line
EARLIER = "(written for an earlier value)"  # behind a comment beside a value that has changed since

NO_PYTHON = (
    "effects written in Python cannot act here, where compiled code runs: write it in C++ (docs/effects.md), or take it"
    " out (ctcr remove)"
)


class _Representer(RoundTripRepresenter):
    """Writes what is not known as `null`, as the format calls it, not as an empty field."""

    def represent_none(self, data: None, **_: Any) -> ScalarNode:
        return self.represent_scalar("tag:yaml.org,2002:null", "null")


_Representer.add_representer(type(None), _Representer.represent_none)

user_effects: dict[str, Any] = {}  # effects of users' files by id, which robot files may hold; see `ctcr.user_effects`


@checked
def load(path: str | Path, *, compiled: bool = False) -> Robot:
    """The robot described by a file. Raises InputError with all faults of the file.

    compiled    whether only the compiled library runs it: effects that users wrote in Python are faults
    """
    return _robot(yaml_document.load(path), compiled)


def parse(content: bytes, file: str = "robot.yaml") -> Robot:
    """The robot described by the content of a file; `file` is its name in errors."""
    return _robot(yaml_document.parse(content, file))


def _robot(document: YamlDocument, compiled: bool = False) -> Robot:
    if not isinstance(document.data, dict):
        hint = " (is this the table of measurements?)" if "," in document.text.partition("\n")[0] else ""
        text = f"does not describe a robot: no fields such as name, tubes, tracker{hint}"
        raise InputError(Problem(text, document.file))
    try:
        robot, errors = Robot.model_validate(_filled(document.data)), []
    except ValidationError as error:
        robot, errors = None, error.errors(include_url=False)
    faults = checks.faults(document.data, errors) + _unknown_effects(document.data, compiled)
    if robot is None or faults:
        raise InputError(checks.problems(faults, document))
    if robot.n_tubes not in _core.TUBES:
        tubes = " or ".join(map(str, _core.TUBES))
        text = f"ctcr is compiled here for robots of {tubes} tubes; in a checkout, tools/dev setup compiles it for all"
        raise InputError(Problem(text, document.file, field="tubes"))
    robot._source = document
    return robot


def warnings(robot: Robot) -> list[Problem]:
    """Values that are possible but look wrong, with unit, field and line."""
    return checks.problems(list(checks.doubts(robot)), robot._source)


@checked
def save(robot: Robot, path: str | Path) -> None:
    """Writes a robot; where it was loaded from a file, only the values that changed differ from that file."""
    yaml, document = layout(robot)
    with atomic_writer(path) as file:
        file.write(dumped(yaml, document, robot._source))


def layout(robot: Robot) -> tuple[YAML, CommentedMap]:
    """The document of a robot with the comments and order of its file, and a writer that keeps indents and quotes."""
    values = robot.model_dump(exclude_unset=True)
    yaml = YAML(typ="rt", pure=True)
    yaml.Representer = _Representer
    yaml.preserve_quotes = True
    yaml.width = LINE_WIDTH
    if robot._source is None:
        return yaml, yaml.load(dumped(yaml, values))
    _, indent, offset = load_yaml_guess_indent(robot._source.text)
    if indent is not None:
        yaml.indent(mapping=2, sequence=indent, offset=offset or 0)
    return yaml, updated(yaml.load(robot._source.text), values)


def dumped(yaml: YAML, document: Any, before: YamlDocument | None = None) -> str:
    """The text of a document; comments beside values that were others `before` say that they were written for those."""
    if before:
        _mark_comments(document, before.data)
    text = io.StringIO()
    yaml.dump(document, text)
    return text.getvalue()


def _mark_comments(new: Any, old: Any) -> None:
    for key in new if isinstance(new, dict) else range(min(len(new), len(old))):
        value = new[key]
        if isinstance(new, dict) and key not in old or value == old[key]:
            continue
        if isinstance(value, CommentedBase) and not value.fa.flow_style() and isinstance(old[key], dict | list):
            _mark_comments(value, old[key])  # in lines of their own
            continue
        for token in new.ca.items.get(key, ()):
            if isinstance(token, CommentToken) and token.value.startswith("#") and EARLIER not in token.value:
                beside, end, below = token.value.partition("\n")
                token.value = f"{beside} {EARLIER}{end}{below}"


def _filled(data: dict[str, Any]) -> dict[str, Any]:
    """A parsed file with the defaults of the sections that it leaves out, and with its sensor's pose for a roll."""
    listed = data.get("tubes")
    lengths = [tube.get("length_mm") for tube in listed if isinstance(tube, dict)] if isinstance(listed, list) else []
    known = [length if isinstance(length, int | float) else 0.0 for length in lengths]  # others are faults of their own
    return _without_roll(data | {name: defaults.section(name, known) for name in defaults.absent(data)})


def _without_roll(data: dict[str, Any]) -> dict[str, Any]:
    """A parsed file with the pose of the sensor instead of its roll about the tip's axis, which older files have."""
    tracker, uncertainty = data["tracker"], data["uncertainty"]
    if not isinstance(tracker, dict) or "sensor_rotation_vector_rad" in tracker:
        return data
    roll, roll_deg = tracker.get("sensor_roll", "known"), tracker.get("sensor_roll_deg")
    if roll not in ("known", "unknown") or not isinstance(roll_deg, int | float | None):  # faults of their own
        return data
    kept = {key: value for key, value in tracker.items() if key not in ("sensor_roll", "sensor_roll_deg")}
    if roll_deg is not None or roll == "unknown":
        kept["sensor_rotation_vector_rad"] = None if roll_deg is None else [0.0, 0.0, radians(roll_deg)]
    if roll == "unknown" and isinstance(uncertainty, dict):
        uncertainty = {"sensor_rotation_deg": [0.0, 0.0, float(round(degrees(settings.ANY_ANGLE)))]} | uncertainty
    return data | {"tracker": kept, "uncertainty": uncertainty}


def unknown_effect(name: str, known: Iterable[str]) -> str:
    """The end of a message on an effect that is not there: what was meant, or how one of the user's own is named."""
    meant = suggestion(name, known, "`ctcr effects` lists those there are.")
    own = "If it is your own, give its file: --effects FILE.py (in Python: ctcr.user_effects.load)"
    return f"{meant} {own}. docs/effects.md says which commands cannot run it"


def _unknown_effects(data: dict[str, Any], compiled: bool) -> list[checks.Fault]:
    effects = data.get("effects")
    if not isinstance(effects, dict):
        return []
    known = [*(effect.id for effect in _core.effect_catalogue()), *([] if compiled else user_effects)]

    def text(name: str) -> str:
        if compiled:
            return f"is no effect of the library: {NO_PYTHON}"
        return f"unknown effect: {unknown_effect(name, known)}"

    return [(("effects", name), text(str(name))) for name in effects if name not in known]


def updated(old: Any, new: Any) -> Any:
    """`old`, a parsed document with its layout, with the values of `new`."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [key for key in old if key not in new]:
            del old[key]
        for key, value in new.items():
            if key in old:
                old[key] = updated(old[key], value)
            else:  # a section may be changed there, with comments, as the others
                old[key] = CommentedMap(value) if type(value) is dict else value
        return old
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, value in enumerate(new):
            old[i] = updated(old[i], value)
        return old
    return old if old == new else new
