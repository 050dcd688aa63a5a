"""What may be missing: each effect of the catalogue with the parameters by which it enters the race.

An effect may enter in several variants, from few parameters to all; the evidence pays for the parameters that it needs.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ctcr.effects import catalogue
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

METAL = ("metal_volume", "metal_x", "metal_y", "metal_z", "coils_x", "coils_y", "coils_z")
VARIANTS = {
    "friction": (("coefficient",), ("torque_per_length",)),
    "tip_load": (("mass",), ("force_x", "force_y", "force_z")),
    "precurvature_profile": (("linear",), ("quadratic",), ("linear", "quadratic"), ("linear", "quadratic", "cubic")),
    "straight_curvature": (("bend_x",), ("bend_x", "bend_y")),
    "sensor_offset": (("x", "y", "z"), ("x", "y", "z", "turn_x", "turn_y", "turn_z")),
    "field_distortion": (("scale",), None, METAL, ()),
}  # None: all amplitudes; (): all parameters but those of a piece of metal
# Values of choices and shapes with which an effect enters the race besides its usual ones.
FORMS = {"friction": ({"law": 1.0, "slip_angle": 0.03}, {"insertion": 0.0}), "delay": ({"spread": 0.5},)}
TOLD = 6  # parameters of a candidate that its label names


@dataclass(frozen=True)
class Candidate:
    """An effect with the parameters that are fitted, and the values at which its shape parameters are held."""

    id: str
    names: tuple[str, ...]
    shape: tuple[tuple[str, float], ...] = ()
    penalty: float = 0.0  # log evidence that it costs to have picked such a value among many

    @property
    def summary(self) -> str:
        """Its parameters, and the values of those that are held."""
        own = dict.fromkeys(name.split(".")[2] for name in self.names)
        told = [*own] if len(own) <= TOLD else [*list(own)[:3], f"{len(own) - 3} more"]
        held = (f"{name.split('.')[2]} {value:g}" for name, value in self.shape if name not in self.names)
        return ", ".join([*told, *held])

    @property
    def label(self) -> str:
        return f"{self.id} ({self.summary})"


def candidates(robot: Robot, measurements: Measurements) -> tuple[list[Candidate], dict[str, str]]:
    """Those that these data can show, and why not for the others."""
    found, left_out = [], {}
    for effect in catalogue.all_effects(robot.n_tubes).values():
        reason = _unseen(effect, robot, measurements)
        if reason:
            left_out[effect.id] = reason
            continue
        for variant in VARIANTS.get(effect.id, (None,)):
            names = _names(effect, variant)
            if effect.id == "contact":
                names = effect.names("stiffness")
            turns = variant is not None and any(".turn_" in name for name in names)
            if turns and measurements.quaternion is None:
                continue
            for form in ({}, *FORMS.get(effect.id, ())):
                shape = tuple((f"effects.{effect.id}.{name}", value) for name, value in form.items())
                found.append(Candidate(effect.id, tuple(names), shape))
    return found, left_out


def forms(effect: catalogue.Effect, candidate: Candidate, rejected_variants: Collection[str] = ()) -> list[Candidate]:
    """What an accepted candidate may become: under each law that the effect offers, its shape free, with the strengths
    by which it entered the race or with all that it may enter by. A piece of metal is among these where the race left
    its place, full names, `rejected_variants`."""
    laws = set(effect.choices)
    rest = {name: value for name, value in candidate.shape if name not in laws}
    shapes = [candidate.shape]
    for form in ({}, *FORMS.get(effect.id, ())):
        full = {f"effects.{effect.id}.{name}": value for name, value in form.items()}
        law = full if laws & set(full) else {}  # with the shape from which it begins
        shapes.append(tuple((rest | law).items()))
    wider = [name for names in _strengths(effect) if set(candidate.names) <= set(names) for name in names]
    has_metal = any(is_of_metal(name) for name in (*candidate.names, *rejected_variants))
    details = [name for name in effect.shapes if has_metal or not is_of_metal(name)]
    more = [details, [*wider, *details]]
    if is_of_metal(candidate.names[0]):  # besides it, the field of what is farther away
        more = [effect.amplitudes, [*effect.amplitudes, *details]]
    free = [tuple(dict.fromkeys((*candidate.names, *names))) for names in more]
    unlike = list({frozenset(shape): shape for shape in shapes}.values())  # in whatever order it is told
    return [Candidate(effect.id, names, shape) for names in dict.fromkeys(free) for shape in unlike]


def other_amplitudes(effect: catalogue.Effect, candidate: Candidate) -> list[Candidate]:
    """The same of an effect that offers several laws, by strengths that are neither part of its own nor hold them."""
    strengths = _strengths(effect) if effect.choices else []
    own = {name for names in strengths for name in names} & set(candidate.names)
    return [Candidate(effect.id, names, candidate.shape) for names in strengths if own.isdisjoint(names)]


def is_of_metal(name: str) -> bool:
    """Whether a parameter, by full name, is one of a piece of metal."""
    return name.startswith("effects.field_distortion.") and name.split(".")[2] in METAL


def _strengths(effect: catalogue.Effect) -> list[tuple[str, ...]]:
    """By which it may enter the race, where it has several."""
    return [tuple(_names(effect, variant)) for variant in VARIANTS.get(effect.id, ())]


def _names(effect: catalogue.Effect, variant: tuple[str, ...] | None) -> Sequence[str]:
    if variant is None:
        return effect.amplitudes
    return effect.names(*variant) if variant else [name for name in effect.names() if not is_of_metal(name)]


def _unseen(effect: catalogue.Effect, robot: Robot, measurements: Measurements) -> str | None:
    if "time" in effect.needs and not np.isfinite(measurements.t).all():
        return "times are missing"
    if "order" in effect.needs and np.isfinite(measurements.t).all() and (np.diff(measurements.t) < 0).any():
        return "the rows are not in the order of time"
    if effect.id == "tip_load" and robot.gravity is None:
        return "the direction of gravity is not known"
    return None
