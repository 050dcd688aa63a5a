"""A new robot file: what must be known of a robot, defaults for the rest, and comments that say which is which."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isinf, isnan
from typing import Any

from ctcr.errors import ArgumentError, Problem, did_you_mean, shown, suggestion
from ctcr.robot.defaults import TRACKER, UNCERTAINTY
from ctcr.show.wording import counted, numbers

NITINOL_GPA, NITINOL_POISSON, NITINOL_DENSITY = 60.0, 0.3, 6450.0

_TRACKER = {
    "sensor_on_tube": "1: the innermost",
    "jitter_mm": "default; standard deviation of one reading per axis, of a sensor at rest. Fits need it",
    "jitter_deg": "default",
    "accuracy_95_mm": "95 % figures of the maker; null: no smooth error of the tracker is assumed",
    "position_mm": "default: both frames agree; `ctcr calibrate frame` finds it",
    "sensor_position_mm": "in the tip's frame, z along the tip; null: not known, fits find it",
    "sensor_rotation_vector_rad": "of its axes against those of the tip; null: not known, fits find it",
}


@dataclass
class NewTube:
    """Fields as in the file. A tube of which no curvature was said counts as straight."""

    length_mm: float
    outer_diameter_mm: float
    inner_diameter_mm: float
    curved_length_mm: float = 0.0
    curvature_per_m: float | None = None
    youngs_modulus_GPa: float = NITINOL_GPA
    poisson_ratio: float = NITINOL_POISSON
    density_kg_m3: float = NITINOL_DENSITY


@dataclass
class NewRobot:
    """`gravity` [m/s^2] in the base frame, None where it is not known; `home_mm` is beta at home, else flush tips."""

    tubes: list[NewTube]
    name: str = "my robot"
    gravity: list[float] | None = None
    sensor_on_tube: int = 1
    note: str = ""
    home_mm: list[float] = field(default_factory=list)


_EXAMPLES = (  # innermost first; the fourth is a straight sheath
    NewTube(420.0, 0.88, 0.65, 60.0, 12.0),
    NewTube(300.0, 1.30, 1.00, 60.0, 8.0),
    NewTube(200.0, 1.80, 1.45, 50.0, 5.0),
    NewTube(110.0, 2.40, 2.00, curvature_per_m=0.0),
)


def example(n_tubes: int) -> NewRobot:
    """A robot of 1 to 4 tubes with invented, plausible numbers."""
    name = f"example of {counted(n_tubes, 'tube')}"
    return NewRobot(list(_EXAMPLES[:n_tubes]), name, note=" Its numbers are invented: replace them.")


def tubes_of(given: Sequence[str]) -> list[NewTube]:
    """Tubes of texts such as length_mm=420,outer_diameter_mm=0.88,...; radius_mm may stand for curvature_per_m.

    Raises ArgumentError with all that is wrong with them.
    """
    tubes, problems = [], []
    for i, text in enumerate(given, start=1):
        try:
            tubes.append(_tube_of(text, f"--tube {i}"))
        except ArgumentError as error:
            problems += error.problems
    if problems:
        raise ArgumentError(problems)
    return tubes


def _tube_of(given: str, where: str) -> NewTube:
    known = [*NewTube.__dataclass_fields__, "radius_mm"]
    values, faults, meant = {}, [], set()
    for part in given.split(","):
        name, _, text = (piece.strip() for piece in part.partition("="))
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if "=" not in part:
            faults.append(f"{shown(part)} is not FIELD=VALUE; decimals have a point, such as 1.52")
        elif name not in known:
            faults.append(f"{name} is no field of a tube: {suggestion(name, known, ', '.join(known))}")
            meant.add(did_you_mean(name, known))  # one mistake, one fault
        elif isnan(value) or (isinf(value) and name != "radius_mm"):  # an infinite radius is straight
            faults.append(f"{name}: {text or 'nothing'} is not a number")
        values[name] = value
    radius = values.pop("radius_mm", None)
    if radius is not None and "curvature_per_m" in values:
        faults.append("radius_mm and curvature_per_m say the same: give one")
    elif radius is not None:
        values["curvature_per_m"] = curvature(radius)
    needed = {"length_mm", "outer_diameter_mm", "inner_diameter_mm"}
    faults += [f"{name} is missing" for name in known if name in needed - set(values) - meant]
    if faults:
        raise ArgumentError([Problem(text, field=where) for text in faults])
    return NewTube(**values)


def curvature(radius_mm: float) -> float:
    """Curvature [1/m] of a radius [mm]; 0 for a straight tube, whose radius is written as 0 or inf."""
    return 1e3 / radius_mm if radius_mm else 0.0


def text(robot: NewRobot) -> str:
    """The file, with comments."""
    n = len(robot.tubes)
    home = robot.home_mm or [-tube.length_mm for tube in robot.tubes]
    flush = "" if robot.home_mm else ": here all tips flush with the front plate"
    gravity = "null" if robot.gravity is None else numbers(robot.gravity)
    return (
        f"# A robot for ctcr.{robot.note} null: not known.\n"
        "# docs/formats.md draws frames, angles and signs and lists all fields; `ctcr info` shows what follows.\n"
        f"name: {_quoted(robot.name)}\n"
        f"gravity: {gravity}  # m/s^2, base frame (z along the insertion); null: the tubes' weight is left out\n"
        "\n"
        "# The innermost tube first. Lengths from the grasped end to the tip; the precurved part ends at the tip.\n"
        f"tubes:\n{''.join(_tube(tube) for tube in robot.tubes)}"
        "\n"
        "# The transmission: joint = ratio * motor angle + home. Needed on a bench alone, but for the homes, which\n"
        "# `ctcr import --translation from-home` adds to travel.\n"
        "actuation:\n"
        "  translation_mm_per_rev: null  # of a turn of the motor\n"
        "  rotation_rev_per_rev: null\n"
        f"  home_translation_mm: {numbers(home)}  # beta at home{flush}\n"
        f"  home_rotation_deg: {numbers([0.0] * n)}  # alpha at home\n"
        "\n"
        "# The sensor, and the base frame as the tracker sees it: x_tracker = R x_base + position.\n"
        f"tracker:\n{_section(TRACKER | {'sensor_on_tube': robot.sensor_on_tube}, _TRACKER)}"
        "\n"
        "# How far the true values may be from those above: one standard deviation. The sensor's pose counts as exact\n"
        "# unless sensor_position_mm and sensor_rotation_deg stand here.\n"
        f"uncertainty:\n{_section(UNCERTAINTY, dict.fromkeys(UNCERTAINTY, 'default'))}"
    )


def _tube(tube: NewTube) -> str:
    radius = f"radius {1e3 / abs(tube.curvature_per_m):.4g} mm" if tube.curvature_per_m else "straight"
    radius += ", as no curvature was given" if tube.curvature_per_m is None else ""
    material = (tube.youngs_modulus_GPa, tube.poisson_ratio, tube.density_kg_m3)
    default = "  # nitinol" if material == (NITINOL_GPA, NITINOL_POISSON, NITINOL_DENSITY) else ""
    return (
        f"  - length_mm: {tube.length_mm:.10g}\n"
        f"    curved_length_mm: {tube.curved_length_mm:.10g}\n"
        f"    curvature_per_m: {tube.curvature_per_m or 0.0:.8g}  # {radius}\n"
        f"    inner_diameter_mm: {tube.inner_diameter_mm:.10g}\n"
        f"    outer_diameter_mm: {tube.outer_diameter_mm:.10g}\n"
        f"    youngs_modulus_GPa: {tube.youngs_modulus_GPa:.10g}{default}\n"
        f"    poisson_ratio: {tube.poisson_ratio:.10g}\n"
        f"    density_kg_m3: {tube.density_kg_m3:.10g}\n"
    )


def _section(values: dict[str, Any], notes: dict[str, str]) -> str:
    written = {key: numbers(value) if isinstance(value, list) else value for key, value in values.items()}
    return "".join(
        f"  {key}: {'null' if value is None else value}{f'  # {notes[key]}' if key in notes else ''}\n"
        for key, value in written.items()
    )


def _quoted(name: str) -> str:
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in name)
    return f'"{escaped}"'
