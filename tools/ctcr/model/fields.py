"""The fitted parameters as the robot file and its reader know them: place in the file, unit, doubts."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi

from ctcr import settings
from ctcr.effects import catalogue
from ctcr.model import parameters
from ctcr.robot.description import MAX_TUBES, Robot, Tube
from ctcr.robot.ledger import Change
from ctcr.robot.yaml_document import FieldPath

_TUBE = {
    "youngs_modulus": ("youngs_modulus_GPa", "GPa", 1e-9),
    "poisson_ratio": ("poisson_ratio", "", 1.0),
    "density": ("density_kg_m3", "kg/m^3", 1.0),
    "inner_diameter": ("inner_diameter_mm", "mm", 1e3),
    "outer_diameter": ("outer_diameter_mm", "mm", 1e3),
    "length": ("length_mm", "mm", 1e3),
    "curved_length": ("curved_length_mm", "mm", 1e3),
    "curvature": ("curvature_per_m", "1/m", 1.0),
    "bending_stiffness": ("bending_stiffness_Nm2", "N m^2", 1.0),
}
_ACTUATION = {
    "translation_ratio": ("translation_mm_per_rev", "mm/rev", 2e3 * pi),
    "rotation_ratio": ("rotation_rev_per_rev", "", 1.0),
    "home_translation": ("home_translation_mm", "mm", 1e3),
    "home_rotation": ("home_rotation_deg", "deg", 180 / pi),
}


@dataclass(frozen=True)
class Field:
    """Where a parameter stands in the file (None: in no field of its own), its unit there, and that unit per SI."""

    path: FieldPath | None
    unit: str
    factor: float


@dataclass(frozen=True)
class Fitted:
    """A parameter before and after, in the unit of the file; `ratio`: posterior over prior standard deviation."""

    name: str
    unit: str
    nominal: float
    prior_sd: float
    value: float
    sd: float
    shift: float  # in prior standard deviations
    ratio: float
    implausible: str  # why no real robot has this value, or empty

    @property
    def moved_far(self) -> bool:
        """Whether what the file says of it can hardly be true."""
        return isfinite(self.shift) and abs(self.shift) > settings.MOVED_FAR

    @property
    def says_nothing(self) -> bool:
        """Whether the data leave it as unknown as it was."""
        return self.ratio > settings.SAYS_NOTHING

    @property
    def flag(self) -> str:
        """The gravest doubt in a word or two."""
        if self.implausible:
            return "implausible"
        return "moved far" if self.moved_far else "unknown" if self.says_nothing else ""


def doubts(items: list[Fitted]) -> list[str]:
    """The doubts of all parameters in sentences."""
    said = [f"{item.name}: {item.implausible}." for item in items if item.implausible]
    far = [f"{item.name} ({item.shift:+.1f})" for item in items if item.moved_far]
    if far:
        said.append(
            f"Moved more than {settings.MOVED_FAR:g} standard deviations of what the robot file says, so either that "
            f"is wrong or they stand in for something else: {', '.join(far)}."
        )
    silent = [item.name for item in items if item.says_nothing]
    if silent:
        said.append(f"The data say nothing of {', '.join(silent)}.")
    return said


def field_of(name: str) -> Field:
    """The field of a parameter such as "tubes.2.length" or "tracker.rotation.x"."""
    group, *rest = name.split(".")
    if group == "tubes" and rest[-1] in _TUBE:
        key, unit, factor = _TUBE[rest[-1]]
        return Field(("tubes", int(rest[0]) - 1, key), unit, factor)
    if group == "actuation" and rest[0] in _ACTUATION:
        key, unit, factor = _ACTUATION[rest[0]]
        return Field(("actuation", key, *(int(number) - 1 for number in rest[1:])), unit, factor)
    if group == "gravity":
        return Field(("gravity", "xyz".index(rest[0])), "m/s^2", 1.0)
    if name.startswith("tracker.position."):
        return Field(("tracker", "position_mm", "xyz".index(rest[1])), "mm", 1e3)
    if name == "tracker.sensor_roll":
        return Field(("tracker", "sensor_roll_deg"), "deg", 180 / pi)
    if name.startswith("tracker.rotation."):
        return Field(None, "deg", 180 / pi)
    return Field(None, _effect_unit(name), 1.0)


def _effect_unit(name: str) -> str:
    known = catalogue.parameter_of(MAX_TUBES)
    return known[name].unit if name in known else ""


def value_at(robot: Robot, path: FieldPath) -> float:
    """The number at a place of the file."""
    value = robot
    for step in path:
        value = value[step] if isinstance(step, int) else getattr(value, step)
    return value


def in_si(values: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Values by name, in the units of the robot file, as values of each parameter in SI."""
    return {
        name: value / field_of(name).factor
        for pattern, value in values.items()
        for name in parameters.expand([pattern], robot)
    }


def fitted(fit) -> list[Fitted]:
    """The parameters of a fit."""
    rows = []
    for i, name in enumerate(fit.names):
        field = field_of(name)
        ratio = float(fit.ratio[i])
        rows.append(
            Fitted(
                name,
                field.unit,
                *(float(field.factor * values[i]) for values in (fit.prior_mean, fit.prior_sd, fit.values, fit.sd)),
                float(fit.shift[i]),
                ratio,
                _implausible(field, float(field.factor * fit.values[i])),
            )
        )
    return rows


def changes(fit, before: Robot, after: Robot) -> list[Change]:
    """What a fit changes in the file; a turn of the tracker frame changes its rotation vector."""
    made = []
    for name, sd in zip(fit.names, fit.sd, strict=True):
        field = field_of(name)
        if field.path:
            made.append(Change(field.path, field.unit, value_at(after, field.path), field.factor * float(sd)))
    said = {change.path for change in made}
    for key, unit in (("position_mm", "mm"), ("rotation_vector_rad", "rad")):
        for i, (old, new) in enumerate(zip(getattr(before.tracker, key), getattr(after.tracker, key), strict=True)):
            if old != new and ("tracker", key, i) not in said:
                made.append(Change(("tracker", key, i), unit, new))
    return made


def _implausible(field: Field, value: float) -> str:
    if not field.path or field.path[0] != "tubes":
        return ""
    key = field.path[2]
    if key == "poisson_ratio" and value < 0:
        return f"{value:.2f} is negative, which no tube is: it stands in for something else"
    quantity = Tube.quantity(key)
    if quantity.is_usual(value):
        return ""
    low, high = quantity.usual
    return f"{value:.4g} {field.unit} is unusual ({low:g} to {high:g} is usual)".replace("  ", " ")
