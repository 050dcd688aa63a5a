"""Faults of a robot description, in single fields and between fields, and possible values that look wrong."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from ctcr.errors import InputError, Problem, did_you_mean, shown
from ctcr.robot import defaults
from ctcr.robot.description import AT_PLATE, Robot, Section, Tube, path_of
from ctcr.robot.yaml_document import FieldPath, YamlDocument

Fault = tuple[FieldPath, str]
S = TypeVar("S", bound=Section)

_PER_TUBE = ("home_translation_mm", "home_rotation_deg", "recorded_home_translation_mm", "recorded_home_rotation_deg")
_MAX_STRAIN = 0.08  # superelastic nitinol recovers about that much


def faults(data: Any, errors: list[dict[str, Any]]) -> list[Fault]:
    """Every fault of a parsed file, each once. `errors`: those that pydantic found, field by field."""
    listed = data.get("tubes")
    tubes = [_mapping(tube) for tube in listed] if isinstance(listed, list) else []
    missing = [error["loc"] for error in errors if error["type"] == "missing"]
    gravity = data.get("gravity")
    weighed = isinstance(gravity, list) and any(isinstance(g, int | float) and g != 0 for g in gravity)
    missing += _missing_of_tubes(tubes, weighed)
    found: list[Fault] = []
    for error in errors:
        path, is_unknown = path_of(error)
        section, field = Robot.owner(path)
        if is_unknown:
            meant = did_you_mean(str(field), section.model_fields)
            missing = [other for other in missing if other != (*path[:-1], meant)]  # one mistake, one fault
        if error["type"] != "missing":
            found.append(_of_field(Robot, error))
    found += [_of_field(Robot, {"loc": path, "type": "missing"}) for path in dict.fromkeys(missing)]
    return found + list(_relations(data, tubes))


def validated(kind: type[S], document: YamlDocument) -> S:
    """The section that a document describes. Raises InputError with all faults of its fields."""
    try:
        return kind.model_validate(document.data)
    except ValidationError as error:
        found = [_of_field(kind, one) for one in error.errors(include_url=False)]
        raise InputError(problems(found, document)) from None


def doubts(robot: Robot) -> Iterator[Fault]:
    """Values that are possible but look wrong, and unknown ones that the model could use."""
    yield from ((path, quantity.doubt(value)) for path, quantity, value in robot.unusual())
    yield from (((name,), defaults.SAID[name]) for name in robot.left_out)
    for i, tube in enumerate(robot.tubes):
        if (strain := tube.straightened_strain) > _MAX_STRAIN:
            text = f"straightening this tube strains it by {100 * strain:.1f} %: it yields"
            yield ("tubes", i, "curvature_per_m"), text
        if (bend := tube.curved_length * abs(tube.curvature)) > 2 * np.pi:
            text = f"bends this tube by {np.degrees(bend):.0f} degrees, more than a circle: is this the radius in mm?"
            yield ("tubes", i, "curvature_per_m"), text
        if (tube.curved_length == 0) != (tube.curvature == 0):
            text = "only one of curvature and curved length is zero: this tube counts as straight"
            yield ("tubes", i, "curved_length_mm"), text
    for i, (tube, around) in enumerate(pairwise(robot.tubes)):
        if around.inner_diameter > 0 and tube.outer_diameter > around.inner_diameter:
            yield _too_narrow(around.inner_diameter_mm, i, tube.outer_diameter_mm)
    home = robot.actuation.home_translation_mm
    for i, (mm, inside) in enumerate(zip(home, [-np.inf, *home], strict=False)):
        if mm > 1e3 * AT_PLATE:
            text = f"{mm:g} mm is in front of the plate: beta is negative behind it"
            yield ("actuation", "home_translation_mm", i), text
        elif mm < inside:
            text = f"{mm:g} mm is behind tube {i} inside it, {inside:g} mm: inner tubes are grasped behind outer ones"
            yield ("actuation", "home_translation_mm", i), text
    if not any(np.any(getattr(robot.uncertainty, key)) for key in defaults.UNCERTAINTY):
        yield ("uncertainty",), "all is 0, known exactly: no fit can change anything, and `ctcr diagnose` needs one"
    if robot.gravity is None:
        yield ("gravity",), "not known: the tubes' own weight is left out"
    elif 0 < (size := np.linalg.norm(robot.gravity)) < 9.7:
        yield ("gravity",), f"its size is {size:.2f} m/s^2: on Earth it is 9.8"
    for unit in ("mm", "deg"):
        jitter, accuracy = (getattr(robot.tracker, f"{kind}_{unit}") for kind in ("jitter", "accuracy_95"))
        if jitter and accuracy and jitter > accuracy:
            text = f"{jitter:g} {unit} of one reading is more than the accuracy, {accuracy:g} {unit}"
            yield ("tracker", f"jitter_{unit}"), text


def problems(found: list[Fault], document: YamlDocument | None) -> list[Problem]:
    """Faults with their fields and lines, in the order of the file."""
    file, line_of = (document.file, document.line) if document else (None, lambda path: None)
    placed = [Problem(text, file, line_of(path), path_text(path)) for path, text in found]
    return sorted(placed, key=lambda problem: problem.line or 0)


def path_text(path: FieldPath) -> str:
    """("tubes", 0, "length_mm") -> tubes[0].length_mm"""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


def _relations(data: dict, tubes: list[dict]) -> Iterator[Fault]:
    """Faults between fields. Comparisons with NaN are false, so that fields that are faulty themselves are skipped."""
    keys = ("inner_diameter_mm", "outer_diameter_mm", "length_mm", "curved_length_mm")
    inner, outer, length, curved = ([_number(tube, key) for tube in tubes] for key in keys)
    reverse = len(tubes) > 1 and bool(np.all(np.diff(outer) < 0))
    if reverse:
        yield ("tubes",), "go from the outermost inwards: list the innermost first"
    for i, tube in enumerate(tubes):
        if tube.get("bending_stiffness_Nm2") is not None and tube.get("youngs_modulus_GPa") is not None:
            text = "the stiffness is given twice: keep this or bending_stiffness_Nm2"
            yield ("tubes", i, "youngs_modulus_GPa"), text
        if inner[i] >= outer[i]:
            text = f"{outer[i]:g} mm is not above the inner diameter, {inner[i]:g} mm"
            yield ("tubes", i, "outer_diameter_mm"), text
        if curved[i] > length[i]:
            text = f"{curved[i]:g} mm is more than the length of the tube, {length[i]:g} mm"
            yield ("tubes", i, "curved_length_mm"), text
    for i in range(1, 1 if reverse else len(tubes)):
        # Published diameters are often fitted: a tube that reaches into the wall around it is a doubt, one that reaches
        # past the middle of that wall a fault.
        if outer[i - 1] > (inner[i] + outer[i]) / 2:
            yield _too_narrow(inner[i], i - 1, outer[i - 1])
        if length[i] > length[i - 1]:
            text = f"{length[i]:g} mm is longer than tube {i} inside it, {length[i - 1]:g} mm: no joints fit both"
            yield ("tubes", i, "length_mm"), text
    actuation, tracker = _mapping(data.get("actuation")), _mapping(data.get("tracker"))
    for key in _PER_TUBE:
        home = actuation.get(key)
        if tubes and isinstance(home, list) and len(home) != len(tubes):
            yield ("actuation", key), f"has {len(home)} values: needs {len(tubes)}, one a tube"
    for key, stated in _mapping(data.get("uncertainty")).items():
        count, what = (3, "axis") if str(key).startswith(("tracker_frame", "sensor_")) else (len(tubes), "tube")
        if tubes and key != "correlations" and isinstance(stated, list) and len(stated) != count:
            yield ("uncertainty", key), f"has {len(stated)} values: needs {count}, one for each {what}, or one for all"
    sensor = tracker.get("sensor_on_tube")
    if tubes and isinstance(sensor, int) and sensor > len(tubes):
        yield ("tracker", "sensor_on_tube"), f"{sensor} is not a tube: the robot has {len(tubes)}"


def _too_narrow(inner_mm: float, inside: int, outer_mm: float) -> Fault:
    text = f"{inner_mm:g} mm is too narrow for tube {inside + 1} inside it, outer diameter {outer_mm:g} mm"
    return ("tubes", inside + 1, "inner_diameter_mm"), text


def _missing_of_tubes(tubes: list[dict], weighed: bool) -> list[FieldPath]:
    """Fields that only some tubes need: those of the stiffness, and of the weight where gravity acts."""
    absent = []
    for i, tube in enumerate(tubes):
        stiff = tube.get("bending_stiffness_Nm2") is not None
        needed = [] if stiff else ["youngs_modulus_GPa"]
        needed += ["density_kg_m3"] if weighed else []
        needed += ["inner_diameter_mm", "outer_diameter_mm"] if weighed or not stiff else []
        absent += [("tubes", i, key) for key in needed if tube.get(key) is None]
    return absent


def _of_field(kind: type[Section], error: dict[str, Any]) -> Fault:
    """A fault that pydantic found in a section or below it, with the values that the field accepts."""
    path, is_unknown = path_of(error)
    section, field = kind.owner(path)
    if is_unknown:
        return path, _unknown(section, str(field))
    return path, f"{_complaint(error)}: needs {section.expected(field)}"


def _unknown(section: type[Section], field: str) -> str:
    meant = did_you_mean(field, section.model_fields)
    if meant is None:
        return "unknown field: the fields here are " + ", ".join(section.model_fields)
    quantity = section.quantity(meant)
    other_unit = quantity and "_" in field and field.rpartition("_")[0] == meant.rpartition("_")[0]
    return f"unknown field: did you mean {meant}" + (f", in {quantity.unit}?" if other_unit else "?")


def _complaint(error: dict[str, Any]) -> str:
    value = error.get("input")
    match error["type"]:
        case "missing":
            return "is missing"
        case "impossible":
            return error["msg"]
        case "too_short" | "too_long":
            return f"has {len(value)} entries"
        case "finite_number":
            return f"{shown(value)} is not finite"
        case _ if value is None:
            return "is empty"
        case "float_type":
            return f"{shown(value)} is not a number"
        case _:
            return f"{shown(value)} does not fit"


def _mapping(part: Any) -> dict:
    return part if isinstance(part, dict) else {}


def _number(section: dict, key: str) -> float:
    """A field of a tube as a number; NaN where it is none, or impossible."""
    value = section.get(key)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and Tube.quantity(key).is_possible(value) else np.nan
