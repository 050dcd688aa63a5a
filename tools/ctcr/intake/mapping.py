"""Which column of a log holds what: by the user's choices, by the format, by the names of the columns."""

from dataclasses import dataclass, field

from ctcr.errors import InputError, Problem
from ctcr.intake import names
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
from ctcr.intake.choices import Choices
from ctcr.intake.log import Log
from ctcr.intake.names import INNER, MIDDLE, OUTER
from ctcr.intake.units import Unit
from ctcr.show.wording import join, listed

TIP_WORDS = {"tip", "sensor", "probe", "ee", "effector", "end", "tool", "distal"}
MOVING = ("beta", "alpha", "run", "fx", "fy", "fz", "weight")  # what a log of poses alone lacks


@dataclass(frozen=True)
class Used:
    """A column in use."""

    column: int
    name: str
    unit: Unit | None  # None: not known from its name
    how: str


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
    faults: list[Problem] = []
    explicit = _explicit(log, choices, faults)
    ignored = {i for name in choices.ignore if (i := _index(log, name, "ignore", faults)) is not None}
    taken = {used.column for used in explicit.values()} | ignored
    candidates = []
    for i, name in enumerate(log.names):
        found = log.meanings[name] if name in log.meanings else names.meaning(name)
        if i not in taken and found and not (n_tubes == 0 and found.role in MOVING):
            candidates.append(Candidate(i, name, found))
    how = "format" if log.meanings else "name"
    picker = _Picker(log, how, faults)
    joints, n = _joints(candidates, explicit, choices, n_tubes, picker)
    made = Mapping(joints | explicit, n)
    for role in ("t", "nsec", "run", "fx", "fy", "fz", "weight"):
        same = [one for one in candidates if one.meaning.role == role]
        if role not in made.used and same:
            made.used[role] = picker.best(role, same)
    if poses:
        _poses(made, candidates, choices, picker)
    _check(log, made, n_tubes, faults)
    if faults:
        raise InputError(faults)
    return made


class _Picker:
    """Takes the best of several candidates; two that are equally good are a fault."""

    def __init__(self, log: Log, how: str, faults: list[Problem]):
        self.log, self.how, self.faults = log, how, faults

    def best(self, role: str, candidates: list[Candidate]) -> Used:
        ordered = sorted(candidates, key=lambda one: one.meaning.rank)
        first = ordered[0]
        equal = [one.name for one in ordered if one.meaning.rank == first.meaning.rank]
        if len(equal) > 1 and self.how == "name":
            self.say(f"{join(equal)} could all be {role}: choose one with --column {role}=NAME", role)
        return Used(first.column, first.name, first.meaning.unit, self.how)

    def say(self, text: str, where: str | None = None) -> None:
        self.faults.append(Problem(text, str(self.log.path), field=where))


def _index(log: Log, name: str, where: str, faults: list[Problem]) -> int | None:
    try:
        return log.index(name, where)
    except InputError as error:
        faults += error.problems
        return None


def _explicit(log: Log, choices: Choices, faults: list[Problem]) -> dict[str, Used]:
    made = {}
    for role, name in choices.columns.items():
        i = _index(log, name, f"column {role}", faults)
        if i is not None:
            found = log.meanings[log.names[i]] if log.names[i] in log.meanings else names.meaning(log.names[i])
            unit = found.unit if found and found.unit and found.unit.quantity == names.quantity(_plain(role)) else None
            made[role] = Used(i, log.names[i], unit, "option")
    return made


def _plain(role: str) -> str:
    return role.removeprefix("ref_")


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
    bodies: dict[str, Roles] = {}
    for one in candidates:
        role = one.meaning.role
        if role in POSITION + QUATERNION + EULER or role[0] in "omq" or role == "seen":
            bodies.setdefault(one.meaning.marker, {}).setdefault(role, []).append(one)
    bodies = merged(bodies)
    placed = {name: settled(roles) for name, roles in bodies.items() if has_position(roles)}
    given = {role for role in made.used if role in (*POSITION, *SEQUENCE, *TRANSLATION)}
    if given and choices.sensor is None:  # the user named its position: a single orientation may still be guessed
        complete = [settled(roles) for roles in bodies.values()]
        turned = [roles for roles in complete if any(set(roles) >= set(kind) for kind in (QUATERNION, EULER, GRID))]
        if len(turned) == 1:
            _take(made, "", turned[0], choices, picker)
        placed = placed if choices.relative_to else {}
    sensor = None if given and choices.sensor is None else _sensor(placed, choices.sensor, picker)
    if sensor is not None:
        _take(made, "", placed[sensor], choices, picker)
        if "seen" not in made.used and "seen" in bodies.get("", {}):
            made.used["seen"] = picker.best("seen", bodies[""]["seen"])
    reference = None
    if choices.relative_to is not None:
        reference = _named(placed, choices.relative_to, "--relative-to", picker)
        if reference is not None:
            _take(made, "ref_", placed[reference], choices, picker)
    if sensor is not None and len(placed) > 1:
        others = [name for name in placed if name not in (sensor, reference)]
        if others:
            hint = "" if reference else "; --relative-to NAME gives the sensor in the frame of one of them"
            made.notes.append(f"other markers: {listed([name or '(no name)' for name in others])}{hint}")


def _sensor(placed, asked: str | None, picker: _Picker) -> str | None:
    if asked is not None:
        return _named(placed, asked, "--sensor", picker)
    if not placed:
        return None
    rank = {
        name: min(one.meaning.rank // 100 for one in roles.get("x") or roles.get("m14") or roles["m1"])
        for name, roles in placed.items()
    }
    best = [name for name in placed if rank[name] == min(rank.values())]
    tips = [name for name in best if set(name.lower().replace("_", " ").split()) & TIP_WORDS]
    if len(best) == 1 or len(tips) == 1:
        return best[0] if len(best) == 1 else tips[0]
    picker.say(f"it holds several markers, {join(best)}: choose the one at the tip with --sensor NAME")
    return None


def _named(placed, asked: str, option: str, picker: _Picker) -> str | None:
    exact = [name for name in placed if name.lower() == asked.lower()]
    found = exact or [name for name in placed if asked.lower() in name.lower()]
    if len(found) == 1:
        return found[0]
    which = f"fits {join(found)}" if found else f"fits none of {join(list(placed))}" if placed else "needs a position"
    picker.say(f"{asked} {which}", option)
    return None


def _take(made: Mapping, prefix: str, roles: Roles, choices: Choices, picker: _Picker) -> None:
    """Gives one body's columns their roles; one orientation is enough."""
    matrix = [role for role in roles if role[0] == "m"]
    quaternion = set(roles) >= set(QUATERNION)
    kept = [*POSITION, "seen"]
    kept += QUATERNION if quaternion else matrix if matrix else EULER
    if set(matrix) & {"m1", "m14"}:
        kept = [role for role in kept if role not in POSITION] if not set(roles) >= set(POSITION) else kept
        kept += [role for role in matrix if role not in kept] if not set(roles) >= set(POSITION) else []
    for role in kept:
        if role in roles and prefix + role not in made.used:
            made.used[prefix + role] = picker.best(prefix + role, roles[role])
    if quaternion and "numbered" in roles and choices.quaternion is None:
        name = picker.best(prefix + "qw", roles["numbered"]).name
        if any(character == "0" for character in name[-2:]):
            made.guessed_order = True
        else:
            text = "four columns are numbered from 1. A quaternion: say its order with --quaternion wxyz or xyzw. "
            picker.say(f"{text}Joints: name them, such as --column beta1={name}", name)


def _check(log: Log, made: Mapping, n_tubes: int | None, faults: list[Problem]) -> None:
    """Faults where columns are missing."""

    def say(text: str) -> None:
        faults.append(Problem(text, str(log.path)))

    n = made.n_tubes
    extra = [role for role in made.used if role[:-1] in ("beta", "alpha") and int(role[-1]) > n]
    if extra:
        say(f"it has {join(sorted(extra))}: the robot has {n} tubes")
    for group, roles in (
        ("force", ("fx", "fy", "fz")),
        ("position", POSITION),
        ("quaternion", QUATERNION),
        ("Euler angles", EULER),
    ):
        for prefix in ("", "ref_"):
            there = [role for role in roles if prefix + role in made.used]
            if there and len(there) < len(roles) and group != "force":
                absent = [prefix + role for role in roles if role not in there]
                lack = f"{join(absent)} of the {group} {'is' if len(absent) == 1 else 'are'} missing"
                say(f"{lack}: give --column {absent[0]}=NAME")
