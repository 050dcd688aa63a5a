"""Which column of a log holds what: by the user's choices, by the format, by the names of the columns."""

import re
from dataclasses import dataclass, field

from ctcr.errors import InputError, Problem
from ctcr.intake import names, units
from ctcr.intake.bodies import (
    EULER,
    GRID,
    POSITION,
    QUATERNION,
    SEQUENCE,
    TRANSLATION,
    Candidate,
    Roles,
    has_position,
    merged,
    settled,
)
from ctcr.intake.choices import GROUPS, Choices, group_of
from ctcr.intake.fields import is_day_of_clock, is_text
from ctcr.intake.log import Log
from ctcr.intake.names import INNER, MIDDLE, OUTER, TIP_WORDS
from ctcr.intake.units import Unit
from ctcr.show.wording import join, listed

MOVING = ("beta", "alpha", "run", "fx", "fy", "fz", "weight", "force")  # what a log of poses alone lacks


@dataclass(frozen=True)
class Used:
    """A column in use."""

    column: int
    name: str
    unit: Unit | None  # None: not known from its name
    how: str  # that unit is known: by the name, or by the format of the log


@dataclass
class Mapping:
    """Columns by role. Poses of the reference marker have roles with ref_ before them."""

    used: dict[str, Used]
    n_tubes: int
    guessed_order: bool = False  # of a quaternion
    notes: list[str] = field(default_factory=list)


def of(log: Log, choices: Choices, n_tubes: int | None, poses: bool = True) -> Mapping:
    """The mapping of a log for a robot of `n_tubes` tubes (None: as many as the log has; 0: its joints do not count).

    Raises InputError with all columns that are missing or that could be two things.
    """
    picker = _Picker(log)
    explicit = _explicit(choices, picker)
    ignored = {i for name in choices.ignore if (i := picker.index(name, "ignore")) is not None}
    taken = {used.column for used in explicit.values()} | ignored
    candidates = []
    for i, (name, spelled) in enumerate(zip(log.names, names.with_middle(log.names), strict=True)):
        found = log.meanings[name] if name in log.meanings else names.meaning(spelled)
        if i not in taken and found and not (n_tubes == 0 and found.role in MOVING):
            candidates.append(Candidate(i, name, found))
    joints, n = _joints(candidates, explicit, choices, n_tubes, picker)
    made = Mapping(joints | explicit, n)
    for role in ("t", "nsec", "run", "fx", "fy", "fz", "weight"):
        axes = role != "weight" or {"fx", "fy", "fz"} & set(made.used)  # else a force without an axis is a weight
        same = [one for one in candidates if one.meaning.role in ((role,) if axes else (role, "force"))]
        if role not in made.used and same:
            made.used[role] = picker.best(role, same)
    days = [one for one in candidates if one.meaning.role == "date"]
    if "t" in made.used and "date" not in made.used:
        clock = made.used["t"].column
        if days := [one for one in days if is_day_of_clock(log, one.column, clock)]:
            made.used["date"] = picker.best("date", days)
    if poses:
        _poses(made, candidates, choices, picker)
        _check_whole(made, candidates, ignored, picker)
    _check(made, picker)
    _check_units(made, choices, picker)
    if picker.faults:
        raise InputError(picker.faults)
    return made


class _Picker:
    """Takes the best of several candidates for a role, and collects the faults of the log: two that are equally good
    are one."""

    def __init__(self, log: Log):
        self.log, self.how = log, "format" if log.is_stated else "name"
        self.faults: list[Problem] = []

    def best(self, role: str, candidates: list[Candidate]) -> Used:
        ordered = sorted(candidates, key=lambda one: one.meaning.rank)
        first = ordered[0]
        equal = [one.name for one in ordered if one.meaning.rank == first.meaning.rank]
        if len(equal) > 1 and self.how == "name":
            self.say(f"{join(equal)} could all be {role}: choose one with --column {role}=NAME", role)
        return Used(first.column, first.name, first.meaning.unit, self.how)

    def say(self, text: str, where: str | None = None) -> None:
        self.faults.append(Problem(text, str(self.log.path), field=where))

    def index(self, name: str, where: str) -> int | None:
        """The position of a column that the user named; None where the log has none, which is a fault."""
        try:
            return self.log.index(name, where)
        except InputError as error:
            self.faults += error.problems
            return None


def _explicit(choices: Choices, picker: _Picker) -> dict[str, Used]:
    made, log = {}, picker.log
    for role, name in choices.columns.items():
        i = picker.index(name, f"column {role}")
        if i is not None:
            found = log.meanings.get(log.names[i])
            unit = found.unit if found else names.unit(log.names[i])
            fits = unit and unit.quantity in ("", names.quantity(role.removeprefix("ref_")))
            made[role] = Used(i, log.names[i], unit if fits else None, "option")
    return made


def _joints(candidates, explicit, choices: Choices, n_tubes: int | None, picker) -> tuple[dict[str, Used], int]:
    """Columns of the joints by role, and the number of tubes."""
    joints = [one for one in candidates if one.meaning.role in ("beta", "alpha")]
    numbers = [one.meaning.tube for one in joints]
    zero_based = 0 in numbers
    known = [int(role[-1]) for role in [*explicit, *choices.constants] if role[:-1] in ("beta", "alpha")]
    counted = [number + zero_based for number in numbers if number >= 0]
    words = {number for number in numbers if number < 0}
    found = max([*counted, *known, len(words)], default=0)
    n = n_tubes or found
    place = {INNER: 1, MIDDLE: 2, OUTER: n}
    groups: dict[str, list[Candidate]] = {}
    for one in joints:
        number = one.meaning.tube
        tube = place[number] if number < 0 else number + zero_based
        if choices.order == "outermost-first" and number >= 0:
            tube = n + 1 - tube
        role = f"{one.meaning.role}{tube}"
        if role not in explicit and role not in choices.constants:
            groups.setdefault(role, []).append(one)
    made = {role: picker.best(role, group) for role, group in sorted(groups.items())}
    return made, found if n_tubes is None else n


def _poses(made: Mapping, candidates: list[Candidate], choices: Choices, picker: _Picker) -> None:
    """Columns of the sensor and, where it is asked for, of the reference marker."""
    measured = [one for one in candidates if not one.meaning.is_given]
    bodies = _bodies(measured)
    places = {*POSITION, *TRANSLATION, *SEQUENCE}
    given = places & set(made.used)
    if not given and not any(one.meaning.role in places for one in measured):
        commanded = _bodies([one for one in candidates if one.meaning.is_given])
        if any(map(has_position, commanded.values())):
            bodies = commanded
            made.notes.append("by their names, the positions are commanded or computed, not measured")
    placed = {name: settled(roles) for name, roles in bodies.items() if has_position(roles)}
    if len(placed) > 1 and "" in placed:  # a body without a name goes by its first column
        roles = placed.pop("")
        placed[next(iter(roles.values()))[0].name] = roles
    if given and choices.sensor is None:  # the user named its position: a single orientation may still be guessed
        complete = [settled(roles) for roles in bodies.values()]
        turned = [roles for roles in complete if any(set(roles) >= set(kind) for kind in (QUATERNION, EULER, GRID))]
        if len(turned) == 1:
            _take(made, "", turned[0], choices, picker)
        placed = placed if choices.relative_to else {}
    sensor = None if given and choices.sensor is None else _sensor(placed, choices.sensor, picker)
    if sensor is not None:
        _take(made, "", placed[sensor], choices, picker)
        unnamed = bodies.get("", {})
        turned = any(role[0] in "qrm" for role in placed[sensor]) or has_position(unnamed)
        kept = {role: found for role, found in unnamed.items() if not turned or role == "seen"}
        _take(made, "", settled(kept), choices, picker)  # what has no name is the sensor's
    reference = None
    if choices.relative_to is not None:
        reference = _named(placed, choices.relative_to, "--relative-to", picker)
        if reference is not None:
            _take(made, "ref_", placed[reference], choices, picker)
    if sensor is not None and len(placed) > 1:
        others = [name for name in placed if name not in (sensor, reference)]
        if others:
            hint = "" if reference else "; --relative-to NAME gives the sensor in the frame of one of them"
            made.notes.append(f"other markers: {listed(others)}{hint}")


def _bodies(candidates: list[Candidate]) -> dict[str, Roles]:
    bodies: dict[str, Roles] = {}
    for one in candidates:
        role = one.meaning.role
        if role in POSITION + QUATERNION + EULER or role[0] in "omq" or role == "seen":
            bodies.setdefault(one.meaning.marker, {}).setdefault(role, []).append(one)
    return merged(bodies)


def _sensor(placed, asked: str | None, picker: _Picker) -> str | None:
    if asked is not None:
        return _named(placed, asked, "--sensor", picker)
    if not placed:
        return None
    tips = [name for name in placed if set(name.lower().replace("_", " ").split()) & TIP_WORDS]
    for names_of_one in (list(placed), tips):
        if len(names_of_one) == 1:
            return names_of_one[0]
    picker.say(f"it holds several markers, {join(list(placed))}: choose the one at the tip with --sensor NAME")
    return None


def _named(placed, asked: str, option: str, picker: _Picker) -> str | None:
    plain = {name: re.sub(r"[\W_]+", "", name.lower()) for name in (*placed, asked)}
    exact = [name for name in placed if plain[name] == plain[asked]]
    found = exact or [name for name in placed if plain[asked] in plain[name]]
    if len(found) == 1:
        return found[0]
    which = f"fits {join(found)}" if found else f"fits none of {join(list(placed))}" if placed else "needs a position"
    picker.say(f"{asked} {which}", option)
    return None


def _take(made: Mapping, prefix: str, roles: Roles, choices: Choices, picker: _Picker) -> None:
    """Gives one body's columns their roles; one orientation is enough."""
    matrix = [role for role in roles if role[0] == "m"]
    quaternion = all(role in roles or prefix + role in made.used for role in QUATERNION)
    orientation = QUATERNION if quaternion else matrix or EULER
    in_matrix = {"m1", "m14"} & set(matrix) and not set(roles) >= set(POSITION)  # whether the position stands there
    for role in dict.fromkeys(["seen", *orientation, *matrix] if in_matrix else [*POSITION, "seen", *orientation]):
        if role in roles and prefix + role not in made.used:
            made.used[prefix + role] = picker.best(prefix + role, roles[role])
    if quaternion and "numbered" in roles and choices.quaternion is None:
        name = picker.best(prefix + "qw", roles["numbered"]).name
        if roles["numbered"][0].meaning.role == "q0":
            made.guessed_order = True
        else:
            text = "four columns are numbered from 1. A quaternion: say its order with --quaternion wxyz or xyzw. "
            picker.say(f"{text}Joints: name them, such as --column beta1={name}", name)


def _check(made: Mapping, picker: _Picker) -> None:
    """Faults where columns are missing."""
    n = made.n_tubes
    extra = [role for role in made.used if role[:-1] in ("beta", "alpha") and int(role[-1]) > n]
    if extra:
        picker.say(f"it has {join(sorted(extra))}: the robot has {n} tubes")
    for group, roles in (("position", POSITION), ("quaternion", QUATERNION), ("Euler angles", EULER)):
        for prefix in ("", "ref_"):
            there = [role for role in roles if prefix + role in made.used]
            if there and len(there) < len(roles):
                absent = [prefix + role for role in roles if role not in there]
                lack = f"{join(absent)} of the {group} {'is' if len(absent) == 1 else 'are'} missing"
                picker.say(f"{lack}: give --column {absent[0]}=NAME")


def _check_whole(made: Mapping, candidates: list[Candidate], ignored: set[int], picker: _Picker) -> None:
    """A fault where all columns of a position or of a quaternion but one are there: its name may have a slip."""
    used = {one.column for one in made.used.values()} | ignored
    bodies = _bodies([one for one in candidates if not one.meaning.is_given])
    for what, whole, instead in (
        ("position", POSITION, (*TRANSLATION, *SEQUENCE)),
        ("quaternion", QUATERNION, (*EULER, *GRID, *SEQUENCE)),
    ):
        if {*whole, *instead} & {*made.used}:
            continue
        for roles in map(settled, bodies.values()):
            absent = [role for role in whole if role not in roles]
            if len(absent) == 1:
                there = [one for role in whole for one in roles.get(role, [])]
                known = used | {one.column for one in there}
                others = listed([name for i, name in enumerate(picker.log.names) if i not in known], 30)
                text = f"{join([one.name for one in there])} look like a {what} without {absent[0]}"
                picker.say(f"{text}: give --column {absent[0]}=NAME, or --ignore them (not used: {others or 'none'})")


def _check_units(made: Mapping, choices: Choices, picker: _Picker) -> None:
    """Faults where a name states a unit of no known size, and where a weight has none: it may be in g, kg or N."""
    silent: dict[tuple[str, str], list[str]] = {}
    for role, used in made.used.items():
        group, unit = group_of(role.removeprefix("ref_")), used.unit
        is_clock = role == "t" and is_text(picker.log, used.column)
        if {role, group} & set(choices.units) or is_clock or (unit.quantity if unit else role != "weight"):
            continue
        silent.setdefault((group, unit.text if unit else ""), []).append(used.name)
    for (group, text), columns in silent.items():
        quantity, one = GROUPS[group], {"length": "0.0025mm", "angle": "0.09deg", "time": "0.1s", "force": "0.01N"}
        said = f"{text} is no unit of {quantity} that is known" if text else "has no unit"
        todo = f"say what one is, such as --unit {group}={one[quantity] if text else 'g'} ({units.of(quantity)})"
        if text.lower() == "grad":
            todo = f"in German it is --unit {group}=deg, in English --unit {group}=gon"
        picker.say(f"{said}: {todo}, or --ignore it", join(columns))
