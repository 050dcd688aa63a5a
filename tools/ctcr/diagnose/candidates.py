"""Effects that may be missing, each in the variants and from the starts with which the catalogue describes it.

A variant may have few parameters or all: the evidence pays for the parameters that it needs.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ctcr.effects import catalogue
from ctcr.effects.catalogue import Effect
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

SHOWN = 6  # parameters of a candidate in its summary


@dataclass(frozen=True)
class Candidate:
    """An effect with the parameters that are fitted, and the values at which its shapes and choices are held."""

    id: str
    names: tuple[str, ...]
    shape: tuple[tuple[str, float], ...] = ()
    penalty: float = 0.0  # log evidence that it costs to have picked such a value among many

    @property
    def summary(self) -> str:
        """Its parameters, and the values of those that are held."""
        own = list(dict.fromkeys(name.split(".")[2] for name in self.names))
        shown = own if len(own) <= SHOWN else [*own[:3], f"{len(own) - 3} more"]
        held = (f"{name.split('.')[2]} {value:g}" for name, value in self.shape if name not in self.names)
        return ", ".join([*shown, *held])

    def with_shape(self, n_tubes: int) -> "Candidate":
        """The same with the shape of its effect fitted too; that of a local source has a variant of its own."""
        effect = catalogue.get(self.id, n_tubes)
        shape = [name for name in effect.of_kind("shape") if name not in effect.names_with("source")]
        return replace(self, names=tuple(dict.fromkeys([*self.names, *shape])))

    @property
    def label(self) -> str:
        return f"{self.id} ({self.summary})"


def candidates(robot: Robot, measurements: Measurements) -> tuple[list[Candidate], dict[str, str]]:
    """The candidates that these data can show; for each other effect the reason why they cannot."""
    found, not_testable = [], {}
    for effect in catalogue.all_effects(robot.n_tubes).values():
        reason = _not_testable(effect, robot, measurements)
        if reason:
            not_testable[effect.id] = reason
            continue
        variants = _variants(effect)
        if measurements.quaternion is None and len(variants) > 1 and effect.acts_on == {"reading"}:
            turns = {name for p in effect.parameters if p.unit == "rad" for name in p.full_names}
            variants = [names for names in variants if turns.isdisjoint(names)]
        found += [Candidate(effect.id, names, shape) for names in variants for shape in _starts(effect)]
    return found, not_testable


def forms(effect: Effect, candidate: Candidate, rejected_variants: Collection[str] = ()) -> list[Candidate]:
    """The forms that an accepted candidate may take: each constitutive law of the effect with its shape free, and with
    the amplitudes of the candidate or of a wider variant. A local source is fitted only where a variant found its
    position: that of the candidate, or one of the full names `rejected_variants`."""
    source, laws = set(effect.names_with("source")), set(effect.laws)
    rest = {name: value for name, value in candidate.shape if name not in laws}
    starts = [candidate.shape]
    for start in _starts(effect):
        law = dict(start) if laws & {name for name, _ in start} else {}  # with the shape from which it begins
        starts.append(tuple((rest | law).items()))
    wider = [name for names in _variants(effect) if set(candidate.names) <= set(names) for name in names]
    has_source = not source.isdisjoint([*candidate.names, *rejected_variants])
    details = [name for name in effect.shapes if has_source or name not in source]
    more = [details, [*wider, *details]]
    if candidate.names[0] in source:  # beside it, the smooth field of what is farther away
        more = [effect.amplitudes, [*effect.amplitudes, *details]]
    free = [tuple(dict.fromkeys((*candidate.names, *names))) for names in more]
    unlike = list({frozenset(start): start for start in starts}.values())  # whatever the order of its values
    return [Candidate(effect.id, names, start) for names in dict.fromkeys(free) for start in unlike]


def other_amplitudes(effect: Effect, candidate: Candidate) -> list[Candidate]:
    """The same by amplitudes of other variants, disjoint from its own, of an effect with several constitutive laws."""
    variants = _variants(effect) if effect.laws and len(effect.variants) > 1 else []
    own = {name for names in variants for name in names} & set(candidate.names)
    return [Candidate(effect.id, names, candidate.shape) for names in variants if own.isdisjoint(names)]


def _variants(effect: Effect) -> list[tuple[str, ...]]:
    return [tuple(effect.names(*names)) for names in effect.variants] or [tuple(effect.amplitudes)]


def _starts(effect: Effect) -> list[tuple[tuple[str, float], ...]]:
    """The usual values, and further ones, by full name."""
    return [tuple((f"effects.{effect.id}.{name}", x) for name, x in start.items()) for start in ({}, *effect.starts)]


def _not_testable(effect: Effect, robot: Robot, measurements: Measurements) -> str | None:
    if "time" in effect.needs and not np.isfinite(measurements.t).all():
        return "times are missing"
    if "order" in effect.needs and np.isfinite(measurements.t).all() and (np.diff(measurements.t) < 0).any():
        return "the rows are not in the order of time"
    if "gravity" in effect.needs and robot.gravity is None:
        return "the direction of gravity is not known"
    return None
