"""The robot of a robot.yaml: fields as in the file, with the unit in the name; properties in SI units.

Tubes go from the innermost outwards. Base frame: origin where the tubes leave the front plate, z along insertion.
"""

from collections.abc import Callable, Iterator, Mapping
from math import pi
from typing import Annotated, Any, get_args

import numpy as np
from annotated_types import Len
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    PrivateAttr,
    ValidationInfo,
    WrapValidator,
    field_validator,
)
from pydantic_core import PydanticCustomError

from ctcr.arrays import Array
from ctcr.frames import matrix_from_rotation_vector
from ctcr.robot import defaults
from ctcr.robot.units import Quantity
from ctcr.robot.yaml_document import FieldPath, YamlDocument
from ctcr.show.result import Glance, Shown
from ctcr.show.wording import counted

MAX_TUBES = 4  # of a robot that ctcr can be compiled for
AT_PLATE = 10e-6  # [m]: a calibration may put a tube that never leaves the plate so far in front of it

Three = Annotated[list[float], Len(3, 3)]
TRANSLATIONS = Quantity("mm", usual=(0.1, 2000), count="one number a tube,")
ROTATIONS = Quantity("deg", usual=(0, 360), count="one number a tube,")
ROTATION_VECTOR = Quantity("rad", usual=(0, 2 * pi), count="three numbers")
EACH_TUBE, EACH_AXIS = "a number, or a list of one a tube,", "a number, or a list of one an axis,"
BELOW = "its fields, indented below it"


def _each(value: Any, number: Callable[[Any], float]) -> Any:
    return [number(each) for each in value] if isinstance(value, list) else number(value)


# One number for all, or a list of one for each.
Each = Annotated[float, WrapValidator(_each), PlainSerializer(lambda value: value)]


def path_of(error: Mapping[str, Any]) -> tuple[FieldPath, bool]:
    """The field at which pydantic found a fault, and whether the section has no such field.

    A key that is no Unicode comes without a path.
    """
    return error["loc"] or (error["input"],), error["type"] in ("extra_forbidden", "invalid_key") or not error["loc"]


class Section(BaseModel):
    """A part of the file: its keys are exactly the fields, its numbers finite and possible."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, validate_assignment=True)

    @classmethod
    def quantity(cls, field: str) -> Quantity | None:
        """Unit and range of a field."""
        metadata = cls.model_fields[field].metadata if field in cls.model_fields else ()
        return next((item for item in metadata if isinstance(item, Quantity)), None)

    @classmethod
    def expected(cls, field: str) -> str:
        """The value that a field needs, for messages."""
        info, quantity = cls.model_fields[field], cls.quantity(field)
        may_be_null = type(None) in get_args(info.annotation) and (info.is_required() or info.default is not None)
        return (quantity.expected if quantity else info.description) + (" (null: not known)" if may_be_null else "")

    @classmethod
    def owner(cls, path: FieldPath) -> tuple[type["Section"], str | int]:
        """The innermost section on the way to the field at `path`, and the name of the field there."""
        section, field = cls, path[0]
        for step in path[1:]:
            inner = _section_in(section.model_fields[field].annotation) if field in section.model_fields else None
            if inner is None:
                break
            section, field = (inner, step) if isinstance(step, str) else (section, field)
        return section, field

    def unusual(self, path: FieldPath = ()) -> Iterator[tuple[FieldPath, Quantity, float]]:
        """Possible values that look wrong, here and in the sections below: path, quantity and value of each."""
        for field in type(self).model_fields:
            quantity, value = self.quantity(field), getattr(self, field)
            for index, part in enumerate(value if isinstance(value, list) else [value]):
                where = (*path, field, index) if isinstance(value, list) else (*path, field)
                if isinstance(part, Section):
                    yield from part.unusual(where)
                elif quantity and isinstance(part, int | float) and not quantity.is_usual(part):
                    yield where, quantity, part

    @field_validator("*")
    @classmethod
    def _possible(cls, value: Any, info: ValidationInfo) -> Any:
        quantity = cls.quantity(info.field_name)
        for number in value if isinstance(value, list) else [value]:
            if quantity and number is not None and not quantity.is_possible(number):
                raise PydanticCustomError("impossible", "{value} is impossible", {"value": f"{number:g}"})
        return value


def _section_in(annotation: Any) -> type[Section] | None:
    """The section that a field holds by its annotation, in a list or where it is optional too."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next(filter(None, map(_section_in, get_args(annotation))), None)


def _si(field: str, factor: float, meaning: str) -> property:
    """A field in SI units, 0 where it is unknown."""
    return property(lambda section: factor * (getattr(section, field) or 0.0), doc=meaning)


class Tube(Section):
    """One tube: straight from the grasped point, precurved over `curved_length_mm` before the tip.

    Its bending stiffness comes from Young's modulus and the diameters, or is given where only it is known.
    """

    youngs_modulus_GPa: Annotated[float | None, Quantity("GPa", usual=(1, 250), above=0)] = None
    bending_stiffness_Nm2: Annotated[float | None, Quantity("N m^2", usual=(1e-5, 10), above=0)] = None
    poisson_ratio: Annotated[float, Quantity("", usual=(0.2, 0.5), above=-1, most=0.5)]
    density_kg_m3: Annotated[float | None, Quantity("kg/m^3", usual=(800, 20000), least=0)] = None
    inner_diameter_mm: Annotated[float | None, Quantity("mm", usual=(0.05, 20), least=0)] = None
    outer_diameter_mm: Annotated[float | None, Quantity("mm", usual=(0.1, 20), above=0)] = None
    length_mm: Annotated[float, Quantity("mm", usual=(5, 2000), above=0)]
    curved_length_mm: Annotated[float, Quantity("mm", usual=(1, 1000), least=0)]
    curvature_per_m: Annotated[float, Quantity("1/m", usual=(0.1, 200))]

    length = _si("length_mm", 1e-3, "Length from the grasped point to the tip [m].")
    curved_length = _si("curved_length_mm", 1e-3, "Length of the precurved part, which ends at the tip [m].")
    curvature = _si("curvature_per_m", 1.0, "Precurvature about the tube's x axis [1/m].")
    youngs_modulus = _si("youngs_modulus_GPa", 1e9, "Young's modulus [Pa]; 0 where the bending stiffness is given.")
    inner_diameter = _si("inner_diameter_mm", 1e-3, "Inner diameter [m]; 0 where unknown.")
    outer_diameter = _si("outer_diameter_mm", 1e-3, "Outer diameter [m]; 0 where unknown.")

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness EI [N m^2]."""
        if self.bending_stiffness_Nm2 is not None:
            return self.bending_stiffness_Nm2
        return self.youngs_modulus * pi * (self.outer_diameter**4 - self.inner_diameter**4) / 64

    @property
    def torsional_stiffness(self) -> float:
        """Torsional stiffness GJ = EI / (1 + nu) [N m^2], as for every annulus."""
        return self.bending_stiffness / (1 + self.poisson_ratio)

    @property
    def mass_per_length(self) -> float:
        """Mass per length [kg/m]; 0 where density or diameters are unknown."""
        return (self.density_kg_m3 or 0.0) * pi * (self.outer_diameter**2 - self.inner_diameter**2) / 4

    @property
    def straightened_strain(self) -> float:
        """Largest strain when the precurved part is straightened, kappa * outer diameter / 2."""
        return abs(self.curvature) * self.outer_diameter / 2


class Actuation(Section):
    """Transmission: q = rho * theta_motor + Delta. The homes, Delta, hold one value a tube.

    A table holds the joints of the controller that recorded it. Once a calibration finds other homes, the recorded
    ones keep those of that controller; without recorded ones both are the same.
    """

    translation_mm_per_rev: Annotated[float | None, Quantity("mm", usual=(0.01, 100))]
    rotation_rev_per_rev: Annotated[float | None, Quantity("", usual=(1e-4, 10))]
    home_translation_mm: Annotated[list[float], TRANSLATIONS]
    home_rotation_deg: Annotated[list[float], ROTATIONS]
    recorded_home_translation_mm: Annotated[list[float] | None, TRANSLATIONS] = None
    recorded_home_rotation_deg: Annotated[list[float] | None, ROTATIONS] = None

    screw_pitch = _si("translation_mm_per_rev", 1e-3, "Translation of a tube by a turn of its motor [m]; 0: unknown.")

    @property
    def translation_correction(self) -> Array:
        """Correction (N,) [m] to add to the joints beta of a table."""
        recorded = self.recorded_home_translation_mm or self.home_translation_mm
        return 1e-3 * (np.array(self.home_translation_mm) - np.array(recorded))

    @property
    def rotation_correction(self) -> Array:
        """Correction (N,) [rad] to add to the joints alpha of a table."""
        recorded = self.recorded_home_rotation_deg or self.home_rotation_deg
        return np.deg2rad(np.array(self.home_rotation_deg) - np.array(recorded))


class Tracker(Section):
    """The sensor, and T_ref, the pose of the robot base frame in the tracker frame.

    `sensor_position_mm` and `sensor_rotation_vector_rad` are T_tip_sensor, the pose of the sensor in the frame of the
    tip; left out, the sensor is the tip. Fits estimate what is null.
    """

    sensor_on_tube: Annotated[int, Field(ge=1, description="the number of a tube, innermost 1")]
    rate_Hz: Annotated[float | None, Quantity("Hz", usual=(0.1, 10000), above=0)]
    jitter_mm: Annotated[float | None, Quantity("mm", usual=(1e-4, 5), least=0)]
    jitter_deg: Annotated[float | None, Quantity("deg", usual=(1e-4, 5), least=0)]
    accuracy_95_mm: Annotated[float | None, Quantity("mm", usual=(1e-3, 20), least=0)]
    accuracy_95_deg: Annotated[float | None, Quantity("deg", usual=(1e-3, 20), least=0)]
    position_mm: Annotated[Three, Quantity("mm", usual=(0, 5000), count="three numbers")]
    rotation_vector_rad: Annotated[Three, ROTATION_VECTOR]
    sensor_position_mm: Annotated[Three | None, Quantity("mm", usual=(0, 200), count="three numbers")] = [0.0, 0.0, 0.0]
    sensor_rotation_vector_rad: Annotated[Three | None, ROTATION_VECTOR] = [0.0, 0.0, 0.0]

    @property
    def position(self) -> Array:
        """Origin of the base frame in the tracker frame (3,) [m]."""
        return 1e-3 * np.array(self.position_mm)

    @property
    def rotation(self) -> Array:
        """R_tracker_base (3, 3)."""
        return matrix_from_rotation_vector(self.rotation_vector_rad)

    @property
    def sensor_position(self) -> Array:
        """The sensor in the tip's frame (3,) [m]; at the tip where it is not known."""
        return 1e-3 * np.array(self.sensor_position_mm or (0.0, 0.0, 0.0))

    @property
    def sensor_rotation_vector(self) -> Array:
        """The rotation vector of R_tip_sensor (3,) [rad]; zero where it is not known."""
        return np.array(self.sensor_rotation_vector_rad or (0.0, 0.0, 0.0))

    @property
    def sensor_rotation_known(self) -> bool:
        """Whether measured orientations can be compared."""
        return self.sensor_rotation_vector_rad is not None


class Correlation(Section):
    """The correlation of the priors of two parameters, which have the names that fits show."""

    first: str = Field(description="the name of a parameter, such as tubes.1.length")
    second: str = Field(description="the name of a parameter, such as tubes.1.length")
    r: Annotated[float, Quantity("", above=-1.0, most=1.0)]


class Uncertainty(Section):
    """Prior standard deviations of calibration parameters: a number for all tubes (of the frame and the sensor, all
    axes) or a list with one for each. Left out, the sensor's pose is exactly as the file has it; where that is null,
    nothing is known of it."""

    tracker_frame_mm: Annotated[Each, Quantity("mm", usual=(1e-3, 100), count=EACH_AXIS, least=0)]
    tracker_frame_deg: Annotated[Each, Quantity("deg", usual=(1e-3, 90), count=EACH_AXIS, least=0)]
    rotation_offset_deg: Annotated[Each, Quantity("deg", usual=(1e-3, 180), count=EACH_TUBE, least=0)]
    translation_offset_mm: Annotated[Each, Quantity("mm", usual=(1e-3, 50), count=EACH_TUBE, least=0)]
    length_mm: Annotated[Each, Quantity("mm", usual=(1e-3, 50), count=EACH_TUBE, least=0)]
    curved_length_mm: Annotated[Each, Quantity("mm", usual=(1e-3, 50), count=EACH_TUBE, least=0)]
    curvature_percent: Annotated[Each, Quantity("%", usual=(0.01, 100), count=EACH_TUBE, least=0)]
    youngs_modulus_percent: Annotated[Each, Quantity("%", usual=(0.01, 200), count=EACH_TUBE, least=0)]
    sensor_position_mm: Annotated[Each | None, Quantity("mm", usual=(1e-3, 200), count=EACH_AXIS, least=0)] = None
    sensor_rotation_deg: Annotated[Each | None, Quantity("deg", usual=(1e-3, 180), count=EACH_AXIS, least=0)] = None

    correlations: list[Correlation] = Field(
        default_factory=list, description="a list of pairs of parameters: first, second, r; others are independent"
    )

    def of(self, key: str, index: int) -> float:
        """The standard deviation of a tube or an axis, from 0, in the unit of the key."""
        stated = getattr(self, key)
        return stated[index] if isinstance(stated, list) else stated


class Robot(Shown, Section):
    """The whole file. `gravity` [m/s^2] in the base frame; null where its direction is not known.

    `effects` are the physical effects beyond the standard model, by id; `history` is the ledger of calibrations, see
    `ctcr.robot.ledger`.
    """

    name: str = Field(description="text")
    gravity: Annotated[Three | None, Quantity("m/s^2", usual=(0, 9.9), count="three numbers")]
    tubes: Annotated[list[Tube], Len(1, MAX_TUBES)] = Field(description=f"a list of 1 to {MAX_TUBES} tubes")
    actuation: Actuation = Field(description=BELOW)
    tracker: Tracker = Field(description=BELOW)
    uncertainty: Uncertainty = Field(description=BELOW)
    effects: dict[str, dict[str, float | list[float]]] = Field(
        default_factory=dict, description="the name of each effect with its parameters, indented below it"
    )
    history: list[dict[str, Any]] = Field(default_factory=list, description="a list of changes, oldest first")

    _source: YamlDocument | None = PrivateAttr(None)  # that robot_file loaded it from

    @property
    def n_tubes(self) -> int:
        return len(self.tubes)

    @property
    def lengths(self) -> Array:
        """The lengths of the tubes (N,) [m]."""
        return np.array([tube.length for tube in self.tubes])

    @property
    def files(self) -> list[str]:
        """The file that the robot was loaded from, for a ledger or a page; none where it was not."""
        return [self.file] if self.file else []

    @property
    def file(self) -> str:
        """The file that the robot was loaded from; empty where it was not."""
        return self._source.file if self._source else ""

    @property
    def left_out(self) -> list[str]:
        """The sections that its file leaves to the defaults."""
        return defaults.absent(self._source.data) if self._source else []

    def glance(self) -> Glance:
        effects = f", effects: {', '.join(self.effects)}" if self.effects else ""
        fields = ("length_mm", "curved_length_mm", "curvature_per_m", "inner_diameter_mm", "outer_diameter_mm")
        rows = [
            [field.rsplit("_", 1)[0].removesuffix("_per").replace("_", " "), Tube.quantity(field).unit]
            + ["-" if (value := getattr(tube, field)) is None else f"{value:g}" for tube in self.tubes]
            for field in fields
        ]
        rows.append(["bending stiffness", "N m^2", *(f"{tube.bending_stiffness:.4g}" for tube in self.tubes)])
        columns = ["", "unit", *(f"tube {i + 1}" for i in range(self.n_tubes))]
        return Glance(f"Robot {self.name}: {counted(self.n_tubes, 'tube')}{effects}", columns, rows, text_columns=2)

    @property
    def standard(self) -> "Robot":
        """The same without its effects beyond the standard model."""
        return self.with_effects({})

    def with_effects(self, effects: Mapping[str, Any]) -> "Robot":
        """A copy with this section of effects instead of its own."""
        return self.model_copy(update={"effects": dict(effects)})

    @property
    def gravity_vector(self) -> Array:
        """Gravity (3,) [m/s^2], base frame; zero where the file does not know it."""
        return np.array(self.gravity or (0.0, 0.0, 0.0))

    def joints_of_table(self, beta: Array, alpha: Array) -> tuple[Array, Array]:
        """The joints beta [m], alpha [rad] (M, N) of this robot for the joints of its controller in a table.

        A tube that the correction puts less than AT_PLATE in front of the plate is at the plate.
        """
        beta = beta + self.actuation.translation_correction
        beta = np.where((beta > 0) & (beta < AT_PLATE), 0.0, beta)
        return beta, alpha + self.actuation.rotation_correction
