"""The fitted parameters in the fields and units of the robot file, and what is doubtful about them."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.model import parameters
from ctcr.model.parameters import Field, field_of, value_at
from ctcr.robot.description import Robot, Tube
from ctcr.robot.ledger import Change
from ctcr.robot.yaml_document import FieldPath

_POSES = {  # of tracker: of the tracker frame and of the sensor, and their units
    "position_mm": "mm",
    "rotation_vector_rad": "rad",
    "sensor_position_mm": "mm",
    "sensor_rotation_vector_rad": "rad",
}


@dataclass(frozen=True)
class Fitted:
    """A parameter before and after, in the unit of the file; `ratio`: posterior over prior standard deviation."""

    name: str
    unit: str
    nominal: float
    prior_sd: float
    value: float
    sd: float
    shift: float  # in prior standard deviations as stated
    ratio: float
    implausible: str  # why no real robot has this value, or empty
    at_bound: bool  # whether the fit ended where no larger or smaller value is possible
    widened: float  # factor on the stated deviation, which the readings contradict; 1: as stated

    @property
    def sd_left(self) -> float:
        """Posterior standard deviation over the prior one as stated."""
        return self.widened * self.ratio

    @property
    def moved_far(self) -> bool:
        """Whether the fitted value contradicts the robot file."""
        return isfinite(self.shift) and abs(self.shift) > settings.MOVED_FAR * self.widened

    @property
    def undetermined(self) -> bool:
        """Whether the data leave it as uncertain as it was."""
        return self.ratio > settings.UNDETERMINED

    @property
    def flag(self) -> str:
        """The gravest doubt in a word or two."""
        if self.implausible:
            return "implausible"
        if self.at_bound:
            return "at a bound"
        if self.moved_far:
            return "moved far"
        return "widened" if self.widened > 1 else "unknown" if self.undetermined else ""


def doubts(items: list[Fitted]) -> list[str]:
    """The doubts of all parameters in sentences."""
    said = [f"{item.name}: {item.implausible}." for item in items if item.implausible]
    bounded = [f"{item.name} ({item.value:.4g} {item.unit}".rstrip() + ")" for item in items if item.at_bound]
    if bounded:
        said.append(
            f"Ended at a bound of the possible values: {', '.join(bounded)}. Beyond it the error would be smaller, so "
            f"the model lacks something, or the data hardly determine the value."
        )
    far = [f"{item.name} ({item.shift:+.1f})" for item in items if item.moved_far]
    if far:
        said.append(
            f"Moved by more than {settings.MOVED_FAR:g} standard deviations of the robot file, so either the file is "
            f"wrong or they compensate for another error: {', '.join(far)}."
        )
    silent = [item.name for item in items if item.undetermined]
    if silent:
        said.append(f"The data do not determine {', '.join(silent)}.")
    return said


def in_si(values: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Values by name, in the units of the robot file, as values of each parameter in SI."""
    return {
        name: value / field_of(name).factor
        for pattern, value in values.items()
        for name in parameters.expand([pattern], robot)
    }


def fitted(fit: Any) -> list[Fitted]:
    """The parameters of a fit, a `ctcr.fit.result.Fit`."""
    rows, margin = [], 1e-6 * np.nan_to_num(fit.sd, posinf=0.0)  # as the compiled fit allows for rounding
    for i, name in enumerate(fit.names):
        field = field_of(name)
        numbers = [float(field.factor * of[i]) for of in (fit.prior_mean, fit.priors.stated, fit.values, fit.sd)]
        scale = float(fit.priors.scale[i])
        against_prior = scale * float(fit.shift[i]), float(fit.ratio[i])
        room = min(fit.values[i] - fit.priors.low[i], fit.priors.high[i] - fit.values[i])
        at_bound = bool(room <= margin[i])
        doubt = _implausible(field, numbers[2])
        rows.append(Fitted(name, field.unit, *numbers, *against_prior, doubt, at_bound, scale))
    return rows


def changes(fit: Any, before: Robot, after: Robot) -> list[Change]:
    """The changes of the file by a fit; a turn of the tracker frame, or of the sensor, changes its rotation vector."""
    made = []
    for name, sd in zip(fit.names, fit.sd, strict=True):
        field = field_of(name)
        if field.path and _is_list(before, field.path):
            made.append(Change(field.path, field.unit, value_at(after, field.path), field.factor * float(sd)))
    said = {change.path for change in made}
    for key, unit in _POSES.items():
        old, new = getattr(before.tracker, key), getattr(after.tracker, key)
        if old == new:
            continue
        sds = _sds(fit, key, old or [0.0] * 3)
        if not _is_list(before, ("tracker", key, 0)):
            made.append(Change(("tracker", key), unit, new, sds or None))
            continue
        for i in range(3):
            if old[i] != new[i] and ("tracker", key, i) not in said:
                made.append(Change(("tracker", key, i), unit, new[i], sds[i] if sds else None))
    for key, unit in (("sensor_position_mm", "mm"), ("sensor_rotation_deg", "deg")):  # of what was not known
        stated = getattr(after.uncertainty, key)
        if stated != getattr(before.uncertainty, key):
            made.append(Change(("uncertainty", key), unit, stated))
    return made


def _sds(fit: Any, key: str, before: list[float]) -> list[float]:
    """Standard deviations of the three numbers of a pose, in the unit of the file; [] where the fit does not know them.

    before    the numbers before the fit, from which it turned a rotation vector
    """
    kind = next((kind for kind, of in parameters.TURNS.items() if of == key), f"tracker.{key.removesuffix('_mm')}")
    names = [f"{kind}.{axis}" for axis in "xyz"]
    free = [i for i, name in enumerate(names) if name in fit.names]
    at = [fit.names.index(names[i]) for i in free]
    slopes = 1e3 * np.eye(3)[:, free]
    if kind in parameters.TURNS:
        turn, steps = np.zeros(3), 1e-5 * np.eye(3)[free]
        turn[free] = fit.values[at]
        slopes = (parameters.turned(before, turn + steps) - parameters.turned(before, turn - steps)).T / 2e-5
    sds = np.sqrt(np.diag(slopes @ fit.covariance[np.ix_(at, at)] @ slopes.T))
    return sds.tolist() if free and np.isfinite(sds).all() else []


def _is_list(robot: Robot, path: FieldPath) -> bool:
    """Whether the robot file has a list for a field; a pose that is absent or null has none."""
    if path[0] != "tracker":
        return True
    return path[1] in robot.tracker.model_fields_set and getattr(robot.tracker, path[1]) is not None


def _implausible(field: Field, value: float) -> str:
    if not field.path or field.path[0] != "tubes":
        return ""
    key = field.path[2]
    if key == "poisson_ratio" and value < 0:
        return f"{value:.2f} is negative, which no tube is: it compensates for another error"
    quantity = Tube.quantity(key)
    if quantity.is_usual(value):
        return ""
    low, high = quantity.usual
    return f"{value:.4g} {field.unit} is unusual ({low:g} to {high:g} is usual)".replace("  ", " ")
