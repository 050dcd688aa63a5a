"""The tracked bodies of a log: which columns are whose, and how each says its position and rotation."""

from dataclasses import dataclass

from ctcr.intake.names import Meaning

POSITION, QUATERNION, EULER = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("rx", "ry", "rz")
SEQUENCE = tuple(f"m{i}" for i in range(1, 17))  # a 4 x 4 matrix as one list
GRID = tuple(f"m{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
TRANSLATION = ("m14", "m24", "m34")


@dataclass(frozen=True)
class Candidate:
    """A column, and what its name or its format suggests."""

    column: int
    name: str
    meaning: Meaning


Roles = dict[str, list[Candidate]]  # what could have each role


def merged(bodies: dict[str, Roles]) -> dict[str, Roles]:
    """Positions and orientations under different names are one body where there is one of each."""
    placed = [name for name, roles in bodies.items() if has_position(roles)]
    turned = [name for name, roles in bodies.items() if name not in placed and any(r[0] in "oqrm" for r in roles)]
    if len(placed) == 1 and len(turned) == 1:
        return {placed[0]: bodies[turned[0]] | bodies[placed[0]]}
    return bodies


def has_position(roles: Roles) -> bool:
    """Whether the columns of a body give its position."""
    return set(roles) >= set(POSITION) or _matrix_roles(roles) is not None


def _matrix_roles(roles: Roles) -> dict[str, str] | None:
    """Roles of a complete matrix: role as named -> role."""
    for first in (1, 0):
        if all(f"m{i}" in roles for i in range(first, first + 16)):
            return {f"m{i + first - 1}": f"m{i}" for i in range(1, 17)}
        if all((f"m{i}" in roles) == (i < first + 12) for i in range(first, first + 13)):  # three rows
            return {f"m{i + first - 1}": f"m{i}" for i in range(1, 13)}
        place = {f"m{i + first}{j + first}": f"m{i + 1}{j + 1}" for i in range(3) for j in range(4)}
        if all(name in roles for name in place):
            return place
    return None


def settled(roles: Roles) -> Roles:
    """The roles of one body, with orientations told apart by which there are."""
    made = {role: roles[role] for role in (*POSITION, *QUATERNION, *EULER, "seen") if role in roles}
    if "ox" in roles:
        target = "q" if "ow" in roles or "qw" in roles else "r"
        made |= {f"{target}{axis}": roles[f"o{axis}"] for axis in "wxyz" if f"o{axis}" in roles}
    elif "ow" in roles:
        made["qw"] = roles["ow"]
    if "qw" not in made and "q0" in roles and "qx" in made:  # as NDI names them
        made["qw"] = roles["q0"]
    for first in (0, 1):
        four = all((f"q{i}" in roles) == (i < first + 4) for i in range(first, first + 5))  # more are joints
        if not set(QUATERNION) & set(made) and four:
            made |= {role: roles[f"q{i}"] for i, role in enumerate(QUATERNION, start=first)}
            made["numbered"] = roles[f"q{first}"]
    if matrix := _matrix_roles(roles):
        made |= {role: roles[name] for name, role in matrix.items()}
    elif set(roles) >= set(GRID):
        made |= {role: roles[role] for role in GRID}
    return made
