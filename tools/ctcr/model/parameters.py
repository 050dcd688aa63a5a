"""The named parameters of a robot: names with wildcards, values and prior uncertainties of a robot file, and back.

Names and units are those of the compiled library, in SI. tracker.rotation and tracker.sensor_rotation are the turns of
the tracker frame and of the sensor from those of the file, about the axes of the tracker and of the tip, as rotation
vectors.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from math import inf, pi
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import _core, settings
from ctcr.arrays import Array, ArrayLike
from ctcr.effects import catalogue
from ctcr.errors import ArgumentError, InputError, Problem, suggestion
from ctcr.robot.description import Robot
from ctcr.robot.yaml_document import FieldPath

GROUPS = {  # short names
    "tracker.frame": ("tracker.position.*", "tracker.rotation.*"),
    "tracker.sensor": ("tracker.sensor_position.*", "tracker.sensor_rotation.*"),
    "tracker.sensor_roll": ("tracker.sensor_rotation.z",),
    "homes": ("actuation.home_translation.*", "actuation.home_rotation.*"),
}
STANDARD = "standard"  # the parameters of the paper's calibration
_FIELDS = {  # kind of a parameter: field of the robot file (#: tube or axis), unit there, that unit per SI unit
    "tubes.#.youngs_modulus": (("tubes", "#", "youngs_modulus_GPa"), "GPa", 1e-9),
    "tubes.#.poisson_ratio": (("tubes", "#", "poisson_ratio"), "", 1.0),
    "tubes.#.density": (("tubes", "#", "density_kg_m3"), "kg/m^3", 1.0),
    "tubes.#.inner_diameter": (("tubes", "#", "inner_diameter_mm"), "mm", 1e3),
    "tubes.#.outer_diameter": (("tubes", "#", "outer_diameter_mm"), "mm", 1e3),
    "tubes.#.length": (("tubes", "#", "length_mm"), "mm", 1e3),
    "tubes.#.curved_length": (("tubes", "#", "curved_length_mm"), "mm", 1e3),
    "tubes.#.curvature": (("tubes", "#", "curvature_per_m"), "1/m", 1.0),
    "tubes.#.bending_stiffness": (("tubes", "#", "bending_stiffness_Nm2"), "N m^2", 1.0),
    "gravity.*": (("gravity", "#"), "m/s^2", 1.0),
    "actuation.translation_ratio": (("actuation", "translation_mm_per_rev"), "mm/rev", 2e3 * pi),
    "actuation.rotation_ratio": (("actuation", "rotation_rev_per_rev"), "", 1.0),
    "actuation.home_translation.#": (("actuation", "home_translation_mm", "#"), "mm", 1e3),
    "actuation.home_rotation.#": (("actuation", "home_rotation_deg", "#"), "deg", 180 / pi),
    "tracker.position.*": (("tracker", "position_mm", "#"), "mm", 1e3),
    "tracker.sensor_position.*": (("tracker", "sensor_position_mm", "#"), "mm", 1e3),
    "tracker.rotation.*": (None, "deg", 180 / pi),  # a turn of the rotation vector, not one of its numbers
    "tracker.sensor_rotation.*": (None, "deg", 180 / pi),
}
TURNS = {"tracker.rotation": "rotation_vector_rad", "tracker.sensor_rotation": "sensor_rotation_vector_rad"}
_UNCERTAINTY = {  # section and kind of a parameter: the field of `uncertainty`
    ("tracker", "position"): "tracker_frame_mm",
    ("tracker", "rotation"): "tracker_frame_deg",
    ("tracker", "sensor_position"): "sensor_position_mm",
    ("tracker", "sensor_rotation"): "sensor_rotation_deg",
    ("actuation", "home_translation"): "translation_offset_mm",
    ("actuation", "home_rotation"): "rotation_offset_deg",
    ("tubes", "length"): "length_mm",
    ("tubes", "curved_length"): "curved_length_mm",
    ("tubes", "curvature"): "curvature_percent",
    ("tubes", "youngs_modulus"): "youngs_modulus_percent",
    ("tubes", "bending_stiffness"): "youngs_modulus_percent",
}
CONFOUNDED = ("length_mm", "translation_offset_mm")  # readings determine little more than the sums of the two
_UNCERTAINTY_UNITS = {"mm": 1e-3, "deg": pi / 180, "percent": 0.01}  # SI per unit; percent: of the value
LEAST_EIGENVALUE = 1e-6  # of correlations: beyond it they leave a sum of parameters exactly known
ANYWHERE = {"position": settings.SENSOR_BESIDE, "rotation": settings.ANY_ANGLE}  # [m], [rad] where nothing is known
OF_FRAME = ("tracker.position.", "tracker.rotation.")  # how the names of the tracker frame's parameters begin


@dataclass(frozen=True)
class Field:
    """A parameter's field of the robot file (None: no field of its own), its unit there, and that unit per SI unit."""

    path: FieldPath | None
    unit: str
    factor: float
    lowest: float = -inf  # possible values, SI
    highest: float = inf


@cache
def names_of(n_tubes: int) -> tuple[str, ...]:
    """All parameters of a robot, in the order of the library."""
    return tuple(p.name for p in _core.robot_parameters(n_tubes))


@cache
def _fields() -> dict[str, Field]:
    """The field of every parameter of any robot."""
    found = {}
    for p in _core.robot_parameters(max(_core.TUBES)):
        path, unit, factor = _FIELDS[p.kind]
        path = path and tuple(p.index if step == "#" else step for step in path)
        found[p.name] = Field(path, unit, factor, p.lowest, p.highest)
    return found


def field_of(name: str) -> Field:
    """The field of a parameter such as "tubes.2.length", "tracker.rotation.x" or one of an effect."""
    if name in _fields():
        return _fields()[name]
    of_effects = catalogue.parameter_of(max(_core.TUBES))
    return Field(None, of_effects[name].unit if name in of_effects else "", 1.0)


def value_at(robot: Robot, path: FieldPath) -> Any:
    """The value of a field of the robot file; None where the file lacks the field or a section that would hold it."""
    value = robot
    for step in path:
        if value is not None:
            value = value[step] if isinstance(step, int) else getattr(value, step)
    return value


def expand(free: str | Iterable[str], robot: Robot) -> list[str]:
    """The parameters that names stand for, each once, in the library's order.

    A name may hold `*` (tubes.*.youngs_modulus), may be a group (tracker.frame, homes), and may be several separated by
    commas. `standard` is the calibration of the paper: tracker frame, homes, and stiffness, curvature, curved length
    and length of each tube (of a straight tube: stiffness and length), and what is uncertain of the sensor's pose.
    Effects that the robot has are named as in effects.friction.coefficient.1 (effects.friction.*). Raises InputError
    for names that do not exist.
    """
    known = [*names_of(robot.n_tubes), *of_effects(robot)]
    wanted = [name.strip() for item in ([free] if isinstance(free, str) else free) for name in item.split(",")]
    problems, chosen = [], set()
    for name in filter(None, wanted):
        patterns = _standard(robot) if name == STANDARD else GROUPS.get(name, (name,))
        found = {other for p in patterns for other in known if other == p or ("*" in p and fnmatchcase(other, p))}
        if not found:
            names = ", ".join([STANDARD, *GROUPS, known[0]])
            hint = suggestion(name, [*known, *GROUPS, STANDARD], f"names are {names} and others")
            problems.append(Problem(f"no parameter is named {name}: {hint}"))
        chosen |= found
    if not problems and not chosen:
        problems.append(Problem("nothing is free: name at least one parameter, or standard"))
    if problems:
        raise ArgumentError(problems)
    return [name for name in known if name in chosen]


def of_effects(robot: Robot) -> list[str]:
    """The parameters of the effects that a robot has."""
    return [name for identity in robot.effects for name in catalogue.get(identity, robot.n_tubes).names()]


def values(robot: Robot, names: Iterable[str] | None = None) -> Array:
    """Values of parameters, all by default; at turns the rotation vector of the robot file."""
    return np.array([_value(robot, name) for name in (names_of(robot.n_tubes) if names is None else names)])


def priors(
    robot: Robot, names: Iterable[str], sd: Mapping[str, float] | None = None
) -> tuple[Array, Array, Array, Array]:
    """Mean, standard deviation, lowest and highest value of each parameter.

    Standard deviations are those of the file's `uncertainty`; of effects those of the catalogue, about no effect. `sd`
    {name: number in SI, or math.inf} comes before them, and its names may be patterns. Raises InputError for all
    parameters of which none says anything, or 0.
    """
    names = list(names)
    given = {name: float(value) for item, value in (sd or {}).items() for name in expand(item, robot)}
    own = [name for name in names if name.startswith("effects.")]
    known = dict(zip(own, zip(*catalogue.priors(robot, own), strict=True), strict=True))
    known |= {name: _prior(robot, name) for name in names if name not in known}
    mean, stated, low, high = ([known[name][k] for name in names] for k in range(4))
    width = [given.get(name, sd) for name, sd in zip(names, stated, strict=True)]
    without = [name for name, value in zip(names, width, strict=True) if value is None]
    exact = [name for name, value in zip(names, width, strict=True) if value is not None and not value > 0]
    unstated = "the robot file does not state the uncertainty; give a standard deviation, or infinity"
    narrow = "the prior standard deviation must be above 0: state one, or leave out of the fit what is known exactly"
    said = ((without, unstated), (exact, narrow))
    problems = [Problem(f"{', '.join(_short(of, names))}: {text}") for of, text in said if of]
    if problems:
        raise InputError(problems)
    return tuple(np.array(column, float) for column in (mean, width, low, high))


def _short(some: Iterable[str], names: Iterable[str]) -> list[str]:
    """Some of the names: a pattern for those of a kind where all are among them."""
    kinds: dict[str, list[str]] = {}
    for name in names:
        kinds.setdefault(re.sub(r"\.(\d+|[xyz])(?=\.|$)", ".*", name), []).append(name)
    found, chosen = [], set(some)
    for pattern, of_kind in kinds.items():
        found += [pattern] if len(of_kind) > 1 and chosen.issuperset(of_kind) else filter(chosen.__contains__, of_kind)
    return found


def correlations(robot: Robot, names: Sequence[str]) -> Array | None:
    """Correlations (n, n) of the priors of parameters by the file's `uncertainty`; None: they are independent.

    Raises InputError for pairs of which the file states no uncertainty, and where all together are impossible.
    """
    matrix, problems = np.eye(len(names)), []
    file = robot._source.file if robot._source else None
    known = [name for name in names_of(robot.n_tubes) if uncertainty_of(name)]
    for k, pair in enumerate(robot.uncertainty.correlations):
        field = f"uncertainty.correlations[{k}]"
        for name in {pair.first, pair.second}.difference(known):
            hint = suggestion(name, known, f"names are {known[0]} and others")
            problems.append(Problem(f"no parameter with an uncertainty is named {name}: {hint}", file, field=field))
        if pair.first == pair.second:
            problems.append(Problem(f"{pair.first} is named twice: name two parameters", file, field=field))
        elif pair.first in names and pair.second in names:
            i, j = names.index(pair.first), names.index(pair.second)
            matrix[i, j] = matrix[j, i] = pair.r
    if not problems and np.linalg.eigvalsh(matrix)[0] < LEAST_EIGENVALUE:
        text = "no errors can have all these correlations together: leave out some, or make them smaller"
        problems.append(Problem(text, file, field="uncertainty.correlations"))
    if problems:
        raise InputError(problems)
    return None if np.array_equal(matrix, np.eye(len(names))) else matrix


def applied(robot: Robot, names: Iterable[str], fitted: Iterable[float]) -> Robot:
    """A copy of the robot with other values. New homes leave the old ones as those of the tables."""
    changed, values = robot.model_copy(deep=True), dict(zip(names, map(float, fitted), strict=True))
    own = {name: values.pop(name) for name in [*values] if name.startswith("effects.")}
    if own:
        changed.effects = catalogue.as_section(own.keys(), own.values(), robot)
    for name, value in values.items():
        field = field_of(name)
        if field.path:
            _set(changed, field.path, value * field.factor)
    for kind, key in TURNS.items():
        turn = np.array([values.get(f"{kind}.{axis}", 0.0) for axis in "xyz"])
        if turn.any():
            setattr(changed.tracker, key, turned(getattr(robot.tracker, key) or np.zeros(3), turn).tolist())
    return changed


def turned(vector: ArrayLike, turn: ArrayLike) -> Array:
    """The rotation vector (..., 3) of a file, turned by others (..., 3), which are values of tracker.rotation."""
    return (Rotation.from_rotvec(turn) * Rotation.from_rotvec(vector)).as_rotvec()


def known_directions(robot: Robot, names: list[str]) -> list[tuple[str, Array]]:
    """Changes of the parameters that leave the readings (nearly) as they are, with words, where all are free."""
    tubes, axis = range(1, robot.n_tubes + 1), dict(zip("xyz", robot.tracker.rotation[:, 2], strict=True))

    def along_axis(home: str, frame: str) -> dict[str, float]:
        """The same change of all homes, and that of the frame which undoes it."""
        homes = {f"actuation.{home}.{i}": 1.0 for i in tubes}
        return homes | {f"tracker.{frame}.{name}": -part for name, part in axis.items()}

    yaw = "common rotation of all tubes = yaw of the tracker frame about the robot's axis"
    shift = "common translation of all tubes = shift of the tracker frame along the robot's axis"
    candidates = [(yaw, along_axis("home_rotation", "rotation"))]
    for i in tubes:
        change = {f"actuation.home_translation.{i}": 1.0, f"tubes.{i}.length": -1.0}
        candidates.append((f"translation offset of tube {i} against its length", change))
    candidates.append((shift, along_axis("home_translation", "position")))
    stiffness = {name: _value(robot, name) for name in names if name.endswith(("youngs_modulus", "bending_stiffness"))}
    if len(stiffness) == robot.n_tubes:
        candidates.append(("common stiffness of all tubes", stiffness))
    return [
        (text, np.array([change.get(name, 0.0) for name in names]))
        for text, change in candidates
        if all(name in names or abs(part) < 1e-9 for name, part in change.items())
    ]


def admissible(robot: Robot, beta: Array, names: list[str]) -> list[tuple[str, Array, float]]:
    """Linear constraints on changes of the named parameters that keep joints beta (M, N) [m] of a table possible.

    Each holds words for the limit itself, the coefficients of the changes, and the least value of their sum. Tubes are
    grasped behind the plate, an inner one behind an outer one. Tips lie in front of it, an inner one before an outer
    one. The curved part of a tube is no longer than the tube. 99 rows in 100 stay possible; where fewer are possible at
    first, no further ones become impossible.
    """
    beta = beta + robot.actuation.translation_correction
    tip, last = beta + robot.lengths, robot.n_tubes
    home, length, curved = "actuation.home_translation.{}", "tubes.{}.length", "tubes.{}.curved_length"
    found = [
        (f"tube {last} is grasped at the plate", {home: {last: -1}}, -beta[:, -1]),
        (f"the tip of tube {last} is flush with the plate", {home: {last: 1}, length: {last: 1}}, tip[:, -1]),
    ]
    for i in range(1, last):
        apart, gaps = {i: 1, i + 1: -1}, (beta[:, i] - beta[:, i - 1], tip[:, i - 1] - tip[:, i])
        found.append((f"tubes {i} and {i + 1} are grasped at one place", {home: {i: -1, i + 1: 1}}, gaps[0]))
        found.append((f"the tips of tubes {i} and {i + 1} are flush", {home: apart, length: apart}, gaps[1]))
    for i, tube in enumerate(robot.tubes, start=1):
        straight = np.array([tube.length - tube.curved_length])
        found.append((f"tube {i} is curved over all its length", {length: {i: 1}, curved: {i: -1}}, straight))
    limits = []
    for text, parts, room in found:
        change = {kind.format(i): float(sign) for kind, signs in parts.items() for i, sign in signs.items()}
        row = np.array([change.get(name, 0.0) for name in names])
        if row.any() and len(room):
            limits.append((text, row, -max(0.0, float(np.quantile(room, 0.01)))))
    return limits


def _standard(robot: Robot) -> list[str]:
    found = [*GROUPS["tracker.frame"], *GROUPS["homes"], *of_sensor(robot)]
    for i, tube in enumerate(robot.tubes, start=1):
        own = ["length", "youngs_modulus" if tube.bending_stiffness_Nm2 is None else "bending_stiffness"]
        if tube.curvature != 0 and tube.curved_length != 0:
            own += ["curvature", "curved_length"]
        found += [f"tubes.{i}.{name}" for name in own]
    return found


def uncertain(robot: Robot) -> list[str]:
    """The standard parameters that the robot file does not know exactly."""
    return [name for name in expand(STANDARD, robot) if stated_sd(robot, name)]


def of_sensor(robot: Robot) -> list[str]:
    """The parameters of the sensor's pose that the robot file does not know exactly."""
    return [name for name in names_of(robot.n_tubes) if name.startswith("tracker.sensor_") and stated_sd(robot, name)]


def _value(robot: Robot, name: str) -> float:
    """The value of a parameter of the robot in SI; what the file leaves out is 0, and a ratio 1."""
    field = field_of(name)
    if field.path is None:
        vector = getattr(robot.tracker, TURNS[name[:-2]])
        return float(vector["xyz".index(name[-1])]) if vector else 0.0
    value = value_at(robot, field.path)
    return float(name.endswith("_ratio")) if value is None else float(value) / field.factor


def _set(robot: Robot, path: FieldPath, value: float) -> None:
    """Writes a number of the robot file. A new home leaves the old ones as those of the tables."""
    if path[0] == "gravity":
        robot.gravity = _replaced(robot.gravity_vector, path[1], value)
    elif not isinstance(path[-1], int):
        setattr(value_at(robot, path[:-1]), path[-1], value)
    else:
        section, key, i = getattr(robot, path[0]), path[1], path[2]
        old = list(getattr(section, key) or (0.0, 0.0, 0.0))  # a pose that was not known
        if key.startswith("home_") and getattr(section, f"recorded_{key}") is None:
            setattr(section, f"recorded_{key}", old)
        setattr(section, key, _replaced(old, i, value))


def uncertainty_of(name: str) -> tuple[str, int] | None:
    """Where `uncertainty` holds the standard deviation of a parameter: its key, and which tube or axis, from 0."""
    section, *rest = name.split(".")
    which, kind = rest if section == "tubes" else reversed(rest) if len(rest) == 2 else (None, None)
    key = _UNCERTAINTY.get((section, kind))
    return key and (key, "xyz".index(which) if which in "xyz" else int(which) - 1)


def group_of(robot: Robot, name: str) -> str | None:
    """The number of the file's `uncertainty` that is the standard deviation of a parameter and maybe of others, such as
    length_mm, or length_mm[1] in a list; None: there is no such number."""
    key, index = uncertainty_of(name) or (None, 0)
    return f"{key}[{index}]" if key and isinstance(getattr(robot.uncertainty, key), list) else key


def written_at(name: str) -> tuple[FieldPath | None, str]:
    """Where the file holds a parameter, and its unit there; of a turn, the number of the same axis of the vector."""
    kind, _, axis = name.rpartition(".")
    if kind in TURNS:
        return ("tracker", TURNS[kind], "xyz".index(axis)), "rad"
    return field_of(name).path, field_of(name).unit


def name_at(path: FieldPath) -> str | None:
    """The parameter of a field; that of a rotation vector is the turn about the same axis."""
    for kind, key in TURNS.items():
        if path[:2] == ("tracker", key) and len(path) > 2:
            return f"{kind}.{'xyz'[path[2]]}"
    return next((name for name, field in _fields().items() if field.path == path), None)


def stated_sd(robot: Robot, name: str) -> float | None:
    """The standard deviation of a parameter by the robot file's `uncertainty`, SI; None: it states none."""
    key, index = uncertainty_of(name) or (None, 0)
    if key is None:
        return None
    if getattr(robot.uncertainty, key) is None:  # of the sensor's pose
        kind = name.split(".")[1].removeprefix("sensor_")
        field = {"position": "sensor_position_mm", "rotation": "sensor_rotation_vector_rad"}[kind]
        return ANYWHERE[kind] if getattr(robot.tracker, field) is None else None
    relative = abs(_value(robot, name)) if key.endswith("_percent") else 1.0
    return robot.uncertainty.of(key, index) * _UNCERTAINTY_UNITS[key.rsplit("_", 1)[-1]] * relative


def _prior(robot: Robot, name: str) -> tuple[float, float | None, float, float]:
    """Mean and stated standard deviation of a parameter, and the bounds of its possible values."""
    field = field_of(name)
    value = _value(robot, name) if field.path else 0.0  # the tracker frame turns from that of the file
    return value, stated_sd(robot, name), 1e-3 * value if field.lowest == 0 else field.lowest, field.highest


def _replaced(vector: Iterable[float], index: int, value: float) -> list[float]:
    return [value if i == index else float(old) for i, old in enumerate(vector)]
