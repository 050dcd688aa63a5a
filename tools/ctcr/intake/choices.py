"""The user's choices on the logs of a laboratory, from options and from a small YAML file kept for the next log."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from ctcr.errors import InputError, Problem
from ctcr.intake.names import quantity
from ctcr.robot import yaml_document
from ctcr.robot.checks import validated
from ctcr.robot.description import Section
from ctcr.robot.robot_file import LINE_WIDTH
from ctcr.show.output import atomic_writer

TRANSLATIONS = ("beta", "from-home", "from-flush")
ORDERS = ("innermost-first", "outermost-first")
QUATERNIONS = ("wxyz", "xyzw")
GROUPS = {"t": "time", "beta": "length", "alpha": "angle", "force": "force", "position": "length", "euler": "angle"}
_POSE = r"[xyz]|q[wxyz]|r[xyz]|m\d{1,2}"
_ROLE = re.compile(rf"t|nsec|date|run|seen|weight|(?:beta|alpha)[1-9]|f[xyz]|(?:ref_)?(?:{_POSE})")
ROLES = "t, nsec, date, run, beta1.., alpha1.., fx, fy, fz, weight, x, y, z, qw, qx, qy, qz, rx, ry, rz, "
ROLES += "m11.. or m1..m16, seen"
HEAD = "# How the columns of these logs become measurements: ctcr import LOG --mapping THIS -o measurements.csv\n"


def _text(value: Any) -> Any:
    return str(value) if isinstance(value, int | float) else value


Texts = Annotated[
    dict[str, Annotated[str, BeforeValidator(_text)]], Field(description="names with values, indented below it")
]
Names = Annotated[list[str], Field(description="a list of names")]
Numbers = Annotated[list[float] | None, Field(description="a list of numbers")]
Text = Annotated[str | None, Field(description="text")]


class Choices(Section):
    """Fields of the YAML file, which the options of `ctcr import` go before. Numbers of tubes: 1 is the innermost.

    columns     role -> name of a column, or #3; roles are those of ROLES, with ref_ before those of a reference marker
    units       role or group (GROUPS) -> unit
    translation what the translations hold: beta (<= 0), or travel from home or from flush tips, outwards positive
    home_mm     beta of each tube at home, or at flush tips
    euler       sequence of rotation axes as in scipy: ZYX turns about moving axes (R = Rz Ry Rx), zyx about fixed ones;
                vector: the angles are a rotation vector, axis times angle
    flip        joints, force or groups whose sign changes
    offsets     joints, joints of one run (alpha2@7) or t -> what is added to it, with its unit
    unwrap      joints or alpha, whose jumps of a whole turn are taken out
    constants   joints that the log lacks -> their value, with its unit
    mirror      an axis of a left-handed tracker frame
    """

    columns: Texts = {}
    ignore: Names = []
    units: Texts = {}
    missing: Names = []
    translation: Text = None
    home_mm: Numbers = None
    order: Text = None
    flip: Names = []
    unwrap: Names = []
    offsets: Texts = {}
    constants: Texts = {}
    sensor: Text = None
    relative_to: Text = None
    quaternion: Text = None
    invert_quaternion: Annotated[bool, Field(description="true or false")] = False
    invert_pose: Annotated[bool, Field(description="true or false")] = False
    euler: Text = None
    mirror: Text = None

    def over(self, other: "Choices") -> "Choices":
        """These choices, and those of `other` where these say nothing. Raises InputError with all faults."""
        made = Choices()
        for field, mine in self:
            theirs = getattr(other, field)
            if isinstance(mine, dict):
                wider = {name for name in theirs if field == "units" and group_of(name) in mine}
                value = {name: said for name, said in theirs.items() if name not in wider} | mine
            elif isinstance(mine, list) and isinstance(theirs, list):
                value = [*theirs, *(item for item in mine if item not in theirs)] if field != "home_mm" else mine
            else:
                value = mine if mine is not None and mine is not False else theirs
            setattr(made, field, value)
        made.check("")
        return made

    def check(self, file: str) -> None:
        faults = [Problem(text, file or None, field=where) for where, text in self._faults()]
        if faults:
            raise InputError(faults)

    def _faults(self):
        for name in self.columns:
            if not _ROLE.fullmatch(name):
                yield f"column {name}", f"is not known: {ROLES}"
        for name in self.units:
            if name not in GROUPS and quantity(name) is None:
                yield f"unit {name}", f"is not known: {', '.join(GROUPS)}, or one joint such as alpha1"
        joint = r"(?:beta|alpha)[1-9]"
        for option, names, pattern, hint in (
            ("flip", self.flip, rf"{joint}?|force|f[xyz]", "a joint such as alpha2, alpha or force"),
            ("offset", self.offsets, rf"{joint}?(@\d+)?|t", "alpha2, alpha2@7 in run 7 alone, or t"),
            ("unwrap", self.unwrap, r"alpha[1-9]?", "alpha or a joint such as alpha2"),
            ("constant", self.constants, joint, "a joint such as beta3"),
        ):
            for name in names:
                if name in ("x", "y", "z") and option == "flip":
                    yield option, f"{name}: an axis of the tracker changes its sign with the rotations: --mirror {name}"
                elif not re.fullmatch(pattern, name):
                    yield option, f"{name} is not known: give {hint}"
        for option, value, known in (
            ("translation", self.translation, TRANSLATIONS),
            ("order", self.order, ORDERS),
            ("quaternion", self.quaternion, QUATERNIONS),
            ("mirror", self.mirror, ("x", "y", "z")),
        ):
            if value is not None and value not in known:
                yield option, f"{value} is not known: {', '.join(known)}"
        if self.home_mm is not None and self.translation in (None, "beta"):
            yield "home-mm", "needs --translation from-home or from-flush: what does the log measure from there?"
        if self.euler is not None and not re.fullmatch(r"(?!.*(.)\1)([XYZ]{3}|[xyz]{3})|vector", self.euler):
            text = "is no sequence of axes: such as ZYX (moving axes), zyx (fixed axes), or vector (axis times angle)"
            yield "euler", f"{self.euler} {text}"


def group_of(role: str) -> str:
    """The group of a role, as units name it."""
    kinds = {"length": "position", "angle": "euler"}
    kind = role.rstrip("0123456789")
    return kind if kind in GROUPS else kinds.get(quantity(role) or "", "force")


def grouped(units: dict[str, str]) -> dict[str, str]:
    """The units of roles: that of their group where all roles of the group have one unit."""
    kinds: dict[str, set[str]] = {}
    for role, unit in units.items():
        kinds.setdefault(group_of(role), set()).add(unit)
    single = {group: next(iter(found)) for group, found in kinds.items() if len(found) == 1}
    return single | {role: unit for role, unit in units.items() if group_of(role) not in single}


def load(path: str | Path) -> Choices:
    """The choices of a file. Raises InputError with all its faults."""
    document = yaml_document.load(path)
    if not isinstance(document.data, dict):
        known = ", ".join(Choices.model_fields)
        raise InputError(Problem(f"does not map columns: its fields are {known}", document.file))
    said = {name: value for name, value in document.data.items() if value is not None}
    choices = validated(Choices, replace(document, data=said))
    choices.check(document.file)
    return choices


def save(choices: Choices, path: str | Path) -> None:
    """Writes what is said, with units and columns resolved, for `ctcr import --mapping`."""
    said = CommentedMap({name: value for name, value in choices if value not in (None, False, {}, [])})
    for name in [name for name, value in said.items() if isinstance(value, list)]:
        said[name] = CommentedSeq(said[name])
        said[name].fa.set_flow_style()
    yaml = YAML()
    yaml.width = LINE_WIDTH
    with atomic_writer(path) as file:
        file.write(HEAD)
        yaml.dump(said, file)


def in_order(text: str) -> dict[str, str]:
    """Columns by their order: roles separated by commas, - for none, m1..m16 for a row of them."""
    roles: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        span = re.fullmatch(r"([a-z_]+)(\d+)\.\.(?:\1)?(\d+)", part)
        roles += [f"{span[1]}{i}" for i in range(int(span[2]), int(span[3]) + 1)] if span else [part]
    return {role: f"#{i}" for i, role in enumerate(roles, start=1) if role not in ("-", "")}
