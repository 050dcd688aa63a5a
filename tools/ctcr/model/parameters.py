"""The named parameters of a robot: names with wildcards, values and prior uncertainties of a robot file, and back.

Names and units are those of the compiled library, in SI; tracker.rotation is the turn of the tracker frame from the one
of the file, about the tracker's axes, as a rotation vector.
"""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cache
from math import inf, pi

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ctcr import _core
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem, did_you_mean
from ctcr.frames import matrix_from_rotation_vector
from ctcr.robot.description import Robot

Array = NDArray[np.float64]

GROUPS = {  # short names
    "tracker.frame": ("tracker.position.*", "tracker.rotation.*"),
    "homes": ("actuation.home_translation.*", "actuation.home_rotation.*"),
}
STANDARD = "standard"  # the parameters of the paper's calibration
_STANDARD_TUBE = ("stiffness", "curvature", "curved_length", "length")
_FIELDS = {  # of a tube: field of the file, SI unit per unit of that field
    "youngs_modulus": ("youngs_modulus_GPa", 1e9),
    "poisson_ratio": ("poisson_ratio", 1.0),
    "density": ("density_kg_m3", 1.0),
    "inner_diameter": ("inner_diameter_mm", 1e-3),
    "outer_diameter": ("outer_diameter_mm", 1e-3),
    "length": ("length_mm", 1e-3),
    "curved_length": ("curved_length_mm", 1e-3),
    "curvature": ("curvature_per_m", 1.0),
    "bending_stiffness": ("bending_stiffness_Nm2", 1.0),
}
ANYWHERE = pi / 3**0.5  # standard deviation of an angle of which nothing is known [rad]
_POSITIVE = ("youngs_modulus", "bending_stiffness", "density", "length", "curved_length", "outer_diameter")


@cache
def names_of(n_tubes: int) -> tuple[str, ...]:
    """All parameters of a robot, in the order of the library."""
    return tuple(_core.parameter_names(n_tubes)[0])


@cache
def units_of(n_tubes: int) -> tuple[str, ...]:
    """Their SI units."""
    return tuple(_core.parameter_names(n_tubes)[1])


def units_with_effects(robot: Robot) -> dict[str, str]:
    """SI unit by name, those of the robot's effects included."""
    units = dict(zip(names_of(robot.n_tubes), units_of(robot.n_tubes), strict=True))
    known = catalogue.parameter_of(robot.n_tubes)
    return units | {name: known[name].unit for name in of_effects(robot)}


def expand(free: str | Iterable[str], robot: Robot) -> list[str]:
    """The parameters that names stand for, each once, in the library's order.

    A name may hold `*` (tubes.*.youngs_modulus), may be a group (tracker.frame, homes), and may be several separated by
    commas. `standard` is the calibration of the paper: tracker frame, homes, and stiffness, curvature, curved length
    and length of each tube (of a straight tube: stiffness and length). Effects that the robot has are named as in
    effects.friction.coefficient.1 (effects.friction.*). Raises InputError for names that do not exist.
    """
    known = [*names_of(robot.n_tubes), *of_effects(robot)]
    wanted = [name.strip() for item in ([free] if isinstance(free, str) else free) for name in item.split(",")]
    problems, chosen = [], set()
    for name in filter(None, wanted):
        patterns = _standard(robot) if name == STANDARD else GROUPS.get(name, (name,))
        found = {other for pattern in patterns for other in known if _stands_for(pattern, other)}
        if not found:
            meant = did_you_mean(name, [*known, *GROUPS, STANDARD])
            names = ", ".join([STANDARD, *GROUPS, known[0]])
            hint = f"did you mean {meant}?" if meant else f"names are {names} and others"
            problems.append(Problem(f"no parameter is named {name}: {hint}"))
        chosen |= found
    if not problems and not chosen:
        problems.append(Problem("nothing is free: name at least one parameter, or standard"))
    if problems:
        raise InputError(problems)
    return [name for name in known if name in chosen]


def of_effects(robot: Robot) -> list[str]:
    """The parameters of the effects that a robot has."""
    return [name for identity in robot.effects for name in catalogue.get(identity, robot.n_tubes).names()]


def values(robot: Robot, names: Iterable[str] | None = None) -> Array:
    """Values of parameters, all by default; at tracker.rotation the rotation vector of the tracker frame."""
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
    of_own = dict(zip(own, zip(*catalogue.priors(robot, own), strict=True), strict=True))
    mean = [of_own[name][0] if name in of_own else _mean(robot, name) for name in names]
    width = [given.get(name, of_own[name][1] if name in of_own else _stated_sd(robot, name)) for name in names]
    problems = [
        Problem(
            f"{name}: its prior standard deviation is {value:g}, but must be above 0; leave a parameter that is known "
            "exactly out of the fit"
            if value is not None
            else f"{name}: the robot file does not state its uncertainty; give a standard deviation, or infinity"
        )
        for name, value in zip(names, width, strict=True)
        if value is None or not value > 0
    ]
    if problems:
        raise InputError(problems)
    low, high = np.transpose(
        [of_own[name][2:] if name in of_own else _bounds(name, value) for name, value in zip(names, mean, strict=True)]
    )
    return np.array(mean), np.array(width), low, high


def applied(robot: Robot, names: Iterable[str], fitted: Iterable[float]) -> Robot:
    """A copy of the robot with other values. New homes leave the old ones as those of the tables."""
    changed, values = robot.model_copy(deep=True), dict(zip(names, map(float, fitted), strict=True))
    own = {name: values.pop(name) for name in [*values] if name.startswith("effects.")}
    if own:
        changed.effects = catalogue.as_section(own.keys(), own.values(), robot)
    actuation, turn = changed.actuation, np.zeros(3)
    for name, value in values.items():
        group, *rest = name.split(".")
        if group == "tubes":
            field, unit = _FIELDS[rest[1]]
            setattr(changed.tubes[int(rest[0]) - 1], field, value / unit)
        elif name == "actuation.translation_ratio":
            actuation.translation_mm_per_rev = value * 2e3 * pi
        elif name == "actuation.rotation_ratio":
            actuation.rotation_rev_per_rev = value
        elif group == "actuation":
            field, unit = ("home_translation_mm", 1e-3) if "translation" in name else ("home_rotation_deg", pi / 180)
            homes = list(getattr(actuation, field))
            if getattr(actuation, f"recorded_{field}") is None:
                setattr(actuation, f"recorded_{field}", list(homes))
            homes[int(rest[1]) - 1] = value / unit
            setattr(actuation, field, homes)
        elif group == "gravity":
            changed.gravity = _replaced(changed.gravity_vector, rest[0], value)
        elif rest[0] == "sensor_roll":
            changed.tracker.sensor_roll_deg = value * 180 / pi
        elif rest[0] == "position":
            changed.tracker.position_mm = _replaced(changed.tracker.position_mm, rest[1], 1e3 * value)
        else:
            turn["xyz".index(rest[1])] = value
    if turn.any():
        frame = matrix_from_rotation_vector(turn) @ robot.tracker.rotation
        changed.tracker.rotation_vector_rad = Rotation.from_matrix(frame).as_rotvec().tolist()
    return changed


def known_directions(robot: Robot, names: list[str]) -> list[tuple[str, Array]]:
    """Changes of the parameters that leave the readings (nearly) as they are, with words, where all are free."""
    axis = robot.tracker.rotation[:, 2]
    yaw = {f"actuation.home_rotation.{i + 1}": 1.0 for i in range(robot.n_tubes)}
    yaw |= {f"tracker.rotation.{'xyz'[j]}": -axis[j] for j in range(3)}
    candidates = [("common rotation of all tubes = yaw of the tracker frame about the robot's axis", yaw)]
    candidates += [
        (
            f"translation offset of tube {i} against its length",
            {f"actuation.home_translation.{i}": 1.0, f"tubes.{i}.length": -1.0},
        )
        for i in range(1, robot.n_tubes + 1)
    ]
    shift = {f"actuation.home_translation.{i + 1}": 1.0 for i in range(robot.n_tubes)}
    shift |= {f"tracker.position.{'xyz'[j]}": -axis[j] for j in range(3)}
    candidates.append(("common translation of all tubes = shift of the tracker frame along the robot's axis", shift))
    stiffness = {name: _value(robot, name) for name in names if name.endswith(("youngs_modulus", "bending_stiffness"))}
    if len(stiffness) == robot.n_tubes:
        candidates.append(("common stiffness of all tubes", stiffness))
    return [
        (text, np.array([change.get(name, 0.0) for name in names]))
        for text, change in candidates
        if all(name in names or abs(part) < 1e-9 for name, part in change.items())
    ]


def admissible(robot: Robot, beta: Array, names: list[str]) -> list[tuple[str, Array, float]]:
    """What must stay true of the named parameters for joints beta (M, N) [m] of a table to be possible.

    Each with words for where it just is, and as the least value of a sum of changes of the parameters: tubes are
    grasped behind the plate and one behind the other, tips are in front of it and one before the other, and no tube is
    longer curved than it is long. 99 rows in 100 stay possible; where fewer are, none more become impossible.
    """
    beta = beta + robot.actuation.translation_correction
    tip, tubes = beta + [tube.length for tube in robot.tubes], range(1, robot.n_tubes + 1)
    home, length, curved = "actuation.home_translation.{}", "tubes.{}.length", "tubes.{}.curved_length"
    last = robot.n_tubes
    found = [
        (f"tube {last} is grasped at the plate", {home: {last: -1}}, -beta[:, -1]),
        (f"the tip of tube {last} is flush with the plate", {home: {last: 1}, length: {last: 1}}, tip[:, -1]),
    ]
    for i in tubes[:-1]:
        apart = {i: 1, i + 1: -1}
        found += [
            (f"tubes {i} and {i + 1} are grasped at one place", {home: {i: -1, i + 1: 1}}, beta[:, i] - beta[:, i - 1]),
            (f"the tips of tubes {i} and {i + 1} are flush", {home: apart, length: apart}, tip[:, i - 1] - tip[:, i]),
        ]
    found += [
        (
            f"tube {i} is curved over all its length",
            {length: {i: 1}, curved: {i: -1}},
            np.array([robot.tubes[i - 1].length - robot.tubes[i - 1].curved_length]),
        )
        for i in tubes
    ]
    limits = []
    for text, parts, room in found:
        change = {kind.format(i): float(sign) for kind, signs in parts.items() for i, sign in signs.items()}
        row = np.array([change.get(name, 0.0) for name in names])
        if row.any() and len(room):
            limits.append((text, row, -max(0.0, float(np.quantile(room, 0.01)))))
    return limits


def _stands_for(pattern: str, name: str) -> bool:
    return name == pattern or ("*" in pattern and fnmatchcase(name, pattern))


def _standard(robot: Robot) -> list[str]:
    found = ["tracker.position.*", "tracker.rotation.*", "actuation.home_translation.*", "actuation.home_rotation.*"]
    for i, tube in enumerate(robot.tubes, start=1):
        curved = tube.curvature != 0 and tube.curved_length != 0
        stiffness = "youngs_modulus" if tube.bending_stiffness_Nm2 is None else "bending_stiffness"
        own = _STANDARD_TUBE if curved else ("stiffness", "length")
        found += [f"tubes.{i}.{stiffness if name == 'stiffness' else name}" for name in own]
    return found


def _mean(robot: Robot, name: str) -> float:
    return 0.0 if name.startswith("tracker.rotation.") else _value(robot, name)


def _value(robot: Robot, name: str) -> float:
    group, *rest = name.split(".")
    if group == "tubes":
        field, unit = _FIELDS[rest[1]]
        return unit * float(getattr(robot.tubes[int(rest[0]) - 1], field) or 0.0)
    if group == "gravity":
        return float(robot.gravity_vector["xyz".index(rest[0])])
    if name == "tracker.sensor_roll":
        return float(robot.tracker.roll)
    if group == "tracker":
        vector = robot.tracker.position if rest[0] == "position" else robot.tracker.rotation_vector_rad
        return float(vector["xyz".index(rest[1])])
    actuation = robot.actuation
    if rest[0] == "translation_ratio":
        return 1e-3 * (actuation.translation_mm_per_rev or 2e3 * pi) / (2 * pi)
    if rest[0] == "rotation_ratio":
        return actuation.rotation_rev_per_rev or 1.0
    if rest[0] == "home_translation":
        return 1e-3 * actuation.home_translation_mm[int(rest[1]) - 1]
    return pi / 180 * actuation.home_rotation_deg[int(rest[1]) - 1]


def _stated_sd(robot: Robot, name: str) -> float | None:
    """What the robot file's `uncertainty` says of a parameter, SI; None: nothing."""
    u, kind = robot.uncertainty, name.split(".")[2 if name.startswith("tubes.") else 1]
    size = abs(_value(robot, name))
    if kind == "sensor_roll":
        return ANYWHERE if robot.tracker.sensor_roll == "unknown" else None
    if name.startswith("tracker."):
        return 1e-3 * u.tracker_frame_mm if kind == "position" else pi / 180 * u.tracker_frame_deg
    return {
        "home_translation": 1e-3 * u.translation_offset_mm,
        "home_rotation": pi / 180 * u.rotation_offset_deg,
        "length": 1e-3 * u.length_mm,
        "curved_length": 1e-3 * u.curved_length_mm,
        "curvature": u.curvature_percent / 100 * size,
        "youngs_modulus": u.youngs_modulus_percent / 100 * size,
        "bending_stiffness": u.youngs_modulus_percent / 100 * size,
    }.get(kind)


def _bounds(name: str, value: float) -> tuple[float, float]:
    """Beyond these no robot file may hold the value."""
    kind = name.rpartition(".")[2]
    if kind == "poisson_ratio":
        return -0.9, 0.5
    return (1e-3 * value if kind in _POSITIVE else -inf), inf


def _replaced(vector: Iterable[float], axis: str, value: float) -> list[float]:
    return [value if "xyz"[i] == axis else float(old) for i, old in enumerate(vector)]
