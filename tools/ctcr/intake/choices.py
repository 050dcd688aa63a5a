"""What a user says about the logs of a laboratory, by options and in a small YAML file kept for the next log."""

import re
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, get_args, get_origin

from ctcr.errors import InputError, Problem, shown, suggestion
from ctcr.intake.names import quantity
from ctcr.robot import yaml_document
from ctcr.show.output import atomic_writer

TRANSLATIONS = ("beta", "from-home", "from-flush")
ORDERS = ("innermost-first", "outermost-first")
QUATERNIONS = ("wxyz", "xyzw")
GROUPS = {"t": "time", "beta": "length", "alpha": "angle", "force": "force", "position": "length", "euler": "angle"}
_POSE = r"[xyz]|q[wxyz]|r[xyz]|m\d{1,2}"
_ROLE = re.compile(rf"t|nsec|run|seen|weight|(?:beta|alpha)[1-9]|f[xyz]|(?:ref_)?(?:{_POSE})")
ROLES = (
    "t, nsec, run, beta1.., alpha1.., fx, fy, fz, weight, x, y, z, qw, qx, qy, qz, rx, ry, rz, m11.. or m1..m16, seen"
)


@dataclass
class Choices:
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

    columns: dict[str, str] = field(default_factory=dict)
    ignore: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    translation: str | None = None
    home_mm: list[float] | None = None
    order: str | None = None
    flip: list[str] = field(default_factory=list)
    unwrap: list[str] = field(default_factory=list)
    offsets: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    sensor: str | None = None
    relative_to: str | None = None
    quaternion: str | None = None
    invert_quaternion: bool = False
    invert_pose: bool = False
    euler: str | None = None
    mirror: str | None = None

    def over(self, other: "Choices") -> "Choices":
        """These choices, and those of `other` where these say nothing. Raises InputError with all faults."""
        made = Choices()
        for one in fields(self):
            mine, theirs = getattr(self, one.name), getattr(other, one.name)
            if isinstance(mine, dict):
                wider = {name for name in theirs if one.name == "units" and group_of(name) in mine}
                value = {name: said for name, said in theirs.items() if name not in wider} | mine
            elif isinstance(mine, list) and isinstance(theirs, list):
                value = [*theirs, *(item for item in mine if item not in theirs)] if one.name != "home_mm" else mine
            else:
                value = mine if mine is not None and mine is not False else theirs
            setattr(made, one.name, value)
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
    """Units of roles, as one of their group where it has only one."""
    kinds: dict[str, set[str]] = {}
    for role, unit in units.items():
        kinds.setdefault(group_of(role), set()).add(unit)
    single = {group: next(iter(found)) for group, found in kinds.items() if len(found) == 1}
    return single | {role: unit for role, unit in units.items() if group_of(role) not in single}


def load(path: str | Path) -> Choices:
    """The choices of a file. Raises InputError with all its faults."""
    document = yaml_document.load(path)
    data, known = document.data, {one.name: one for one in fields(Choices)}
    if not isinstance(data, dict):
        raise InputError(Problem(f"does not map columns: its fields are {', '.join(known)}", document.file))
    faults, made = [], {}
    for name, value in data.items():
        if name not in known:
            hint = suggestion(str(name), known, f"the fields are {', '.join(known)}")
            faults.append(Problem(f"unknown field: {hint}", document.file, document.line((name,)), str(name)))
        elif not _fits(value, known[name].type):
            text = f"{shown(value)} does not fit: needs {_expected(known[name].type)}"
            faults.append(Problem(text, document.file, document.line((name,)), name))
        elif value is not None:
            made[name] = {k: str(v) for k, v in value.items()} if isinstance(value, dict) else value
    if faults:
        raise InputError(faults)
    choices = Choices(**made)
    choices.check(document.file)
    return choices


def _fits(value: Any, kind: Any) -> bool:
    if value is None:
        return True
    kind = next((one for one in get_args(kind) if one is not type(None)), kind) if get_origin(kind) is None else kind
    text = str(kind)
    if text.startswith("dict"):
        simple = (str, int, float)
        return isinstance(value, dict) and all(isinstance(k, str) and isinstance(v, simple) for k, v in value.items())
    if text.startswith("list[float]"):
        return isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    if text.startswith("list"):
        return isinstance(value, list) and all(isinstance(v, str) for v in value)
    return isinstance(value, bool if kind is bool else str)


def _expected(kind: Any) -> str:
    text = str(kind)
    words = {
        "dict": "names with values, indented below it",
        "list[float]": "a list of numbers",
        "list": "a list of names",
    }
    plain = "true or false" if kind is bool else "text"
    return next((said for start, said in words.items() if text.startswith(start)), plain)


def save(choices: Choices, path: str | Path) -> None:
    """Writes what is said, with units and columns resolved, for `ctcr import --mapping`."""
    lines = [
        "# How the columns of these logs become measurements: ctcr import LOG --mapping THIS -o measurements.csv\n"
    ]
    for name, value in asdict(choices).items():
        if value is None or value is False or value == {} or value == []:
            continue
        if isinstance(value, dict):
            lines += [f"{name}:\n", *(f"  {_scalar(key)}: {_scalar(inner)}\n" for key, inner in value.items())]
        elif isinstance(value, list):
            lines.append(f"{name}: [{', '.join(map(_scalar, value))}]\n")
        else:
            lines.append(f"{name}: {_scalar(value)}\n")
    with atomic_writer(path) as file:
        file.writelines(lines)


def _scalar(value: Any) -> str:
    """A value of YAML on one line; text that could be read as anything else is quoted."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    other = "y n yes no on off true false null".split()
    if re.fullmatch(r"[A-Za-z][\w-]*", value) and value.lower() not in other:
        return value
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in value)
    return f'"{escaped}"'


def in_order(text: str) -> dict[str, str]:
    """Columns by their order: roles separated by commas, - for none, m1..m16 for a row of them."""
    roles: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        span = re.fullmatch(r"([a-z_]+)(\d+)\.\.(?:\1)?(\d+)", part)
        roles += [f"{span[1]}{i}" for i in range(int(span[2]), int(span[3]) + 1)] if span else [part]
    return {role: f"#{i}" for i, role in enumerate(roles, start=1) if role not in ("-", "")}
