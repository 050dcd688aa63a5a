"""The catalogue of physical effects that the standard model leaves out, and the values of those that a robot has.

Parameters are named as in the library: effects.softening.gamma.2 (tube 2), effects.delay.delay. SI units.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ctcr import _core
from ctcr.errors import InputError, Problem, did_you_mean
from ctcr.robot.description import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Its kind: an amplitude changes nothing at its neutral value, nor does a detail, which is fitted after the
    amplitudes. A shape changes the form of an effect that acts. A choice selects one of several forms and is never
    fitted.
    """

    name: str
    unit: str
    meaning: str
    neutral: float
    sigma: float  # plausible standard deviation about it
    soft: tuple[float, float]  # beyond: hardly this physics
    hard: tuple[float, float]  # beyond: impossible
    per_tube: bool
    kind: str  # amplitude, detail, shape, choice
    full_names: tuple[str, ...]  # one, or one a tube
    quantity: str = "other"  # as Quantity in include/ctcr/effects/effect.hpp


@dataclass(frozen=True)
class Effect:
    id: str
    title: str
    physics: str
    signature: str
    measure: str
    look_alikes: tuple[str, ...]
    reference: str
    needs: frozenset[str]  # of order, time, orientation, loads, gravity
    acts_on: frozenset[str]  # of joints, rod, tip, reading
    parameters: tuple[EffectParameter, ...]
    variants: tuple[tuple[str, ...], ...] = ()  # names of parameters of each way to act; none: all amplitudes
    starts: tuple[dict[str, float], ...] = ()  # values of further starting points, by name

    def names(self, *parameters: str) -> list[str]:
        """Full names of all its parameters, or of the given ones."""
        return [name for p in self.parameters if not parameters or p.name in parameters for name in p.full_names]

    @property
    def amplitudes(self) -> list[str]:
        return [name for p in self.parameters if p.kind == "amplitude" for name in p.full_names]

    @property
    def shapes(self) -> list[str]:
        """Shapes and details: what is fitted once the amplitudes are."""
        return [name for p in self.parameters if p.kind in ("detail", "shape") for name in p.full_names]

    def names_with(self, quantity: str) -> list[str]:
        """Full names of the parameters with this quantity, in the order that it defines."""
        return [name for p in self.parameters if p.quantity == quantity for name in p.full_names]

    @property
    def choices(self) -> list[str]:
        """Which of several laws: none where it has one."""
        return [name for p in self.parameters if p.kind == "choice" for name in p.full_names]


@cache
def catalogue(n_tubes: int) -> dict[str, Effect]:
    """All effects of the library by id, in the order in which they act."""
    parameters: dict[str, list[EffectParameter]] = {}
    for p in _core.effect_parameters(n_tubes):
        stem = f"effects.{p.effect}.{p.name}"
        described = EffectParameter(
            name=p.name,
            unit=p.unit,
            meaning=p.meaning,
            neutral=p.neutral,
            sigma=p.sigma,
            soft=(p.soft_low, p.soft_high),
            hard=(p.hard_low, p.hard_high),
            per_tube=p.per_tube,
            kind="amplitude" if p.kind == "strength" else p.kind,  # a module built before the word changed
            full_names=tuple(f"{stem}.{i + 1}" for i in range(n_tubes)) if p.per_tube else (stem,),
            quantity=getattr(p, "quantity", "other"),
        )
        parameters.setdefault(p.effect, []).append(described)
    needs = ("order", "time", "orientation", "loads", "gravity")
    return {
        e.id: Effect(
            id=e.id,
            title=e.title,
            physics=e.physics,
            signature=e.signature,
            measure=e.measure,
            look_alikes=tuple(e.look_alikes.split()),
            reference=e.reference,
            needs=frozenset(name for name in needs if getattr(e, name)),
            acts_on=frozenset(getattr(e, "acts_on", ())),
            parameters=tuple(parameters[e.id]),
            variants=tuple(map(tuple, getattr(e, "variants", ()))),
            starts=tuple(getattr(e, "starts", ())),
        )
        for e in _core.effect_catalogue()
    }


_own: dict[str, Callable[[int], Effect]] = {}  # effects of the user's files, by id, for a number of tubes


def register(identity: str, described: Callable[[int], Effect]) -> None:
    """Makes an effect of a user's file known; see `user_effects.load`."""
    _own[identity] = described


def own_effects(n_tubes: int) -> dict[str, Effect]:
    """Effects of the user's files by id."""
    return {identity: described(n_tubes) for identity, described in _own.items()}


def all_effects(n_tubes: int) -> dict[str, Effect]:
    """The effects of the library, then those of the user's files."""
    return catalogue(n_tubes) | own_effects(n_tubes)


def known_effects() -> list[str]:
    """Ids of all effects."""
    return list(all_effects(1))


@cache
def names_of(n_tubes: int) -> tuple[str, ...]:
    """All parameters of all effects, in the order of the library."""
    return tuple(name for effect in catalogue(n_tubes).values() for name in effect.names())


def parameter_of(n_tubes: int) -> dict[str, EffectParameter]:
    """The parameter that a full name belongs to."""
    return {name: p for effect in all_effects(n_tubes).values() for p in effect.parameters for name in p.full_names}


def get(name: str, n_tubes: int = 1) -> Effect:
    """An effect by its id; raises InputError that names the nearest."""
    effects = all_effects(n_tubes)
    if name not in effects:
        meant = did_you_mean(name, effects)
        hint = f": did you mean {meant}?" if meant else ": see `ctcr effects`"
        raise InputError([Problem(f"no effect is named {name}{hint}")])
    return effects[name]


def neutral(robot: Robot) -> dict[str, float]:
    """The value of every parameter that changes nothing; periods follow from the robot's transmission."""
    values = {name: p.neutral for name, p in parameter_of(robot.n_tubes).items()}
    if robot.actuation.translation_mm_per_rev:
        values["effects.periodic_translation.pitch"] = 1e-3 * abs(robot.actuation.translation_mm_per_rev)
    if robot.actuation.rotation_rev_per_rev:
        values["effects.periodic_rotation.turns"] = 1 / abs(robot.actuation.rotation_rev_per_rev)
    return values


def values(robot: Robot) -> Array:
    """The value of every parameter of the library's effects, in the order of `names_of`; errors as `value_of`."""
    found = value_of(robot)
    return np.array([found[name] for name in names_of(robot.n_tubes)])


def value_of(robot: Robot) -> dict[str, float]:
    """The value of every parameter by its full name: neutral but for the robot's effects.

    Raises InputError for effects and parameters that do not exist, and lists that do not hold one number a tube.
    """
    found, problems = neutral(robot), []
    for identity, given in robot.effects.items():
        effect = get(identity, robot.n_tubes)
        known = {p.name: p for p in effect.parameters}
        for name, value in given.items():
            where = f"effects.{identity}.{name}"
            if name not in known:
                meant = did_you_mean(name, known)
                hint = f"did you mean {meant}?" if meant else f"its parameters are {', '.join(known)}"
                problems.append(Problem(f"unknown parameter: {hint}", field=where))
                continue
            numbers = value if isinstance(value, list) else [value]
            if len(numbers) != len(known[name].full_names):
                problems.append(Problem(f"needs {len(known[name].full_names)} number(s)", field=where))
                continue
            found.update(zip(known[name].full_names, map(float, numbers), strict=True))
    if problems:
        raise InputError(problems)
    return found


def as_section(
    names: Iterable[str], fitted: Iterable[float], robot: Robot
) -> dict[str, dict[str, float | list[float]]]:
    """Values by full name as the `effects:` section of a robot file, over the robot's own."""
    now = value_of(robot)
    changed = dict(zip(names, map(float, fitted), strict=True))
    now |= changed
    ids = [*robot.effects, *(name.split(".")[1] for name in changed)]
    return {
        identity: {
            p.name: [float(now[name]) for name in p.full_names] if p.per_tube else float(now[p.full_names[0]])
            for p in get(identity, robot.n_tubes).parameters
        }
        for identity in dict.fromkeys(ids)
    }


def priors(robot: Robot, names: Iterable[str]) -> tuple[Array, Array, Array, Array]:
    """Mean (neutral), standard deviation, lowest and highest value of parameters of effects."""
    known, mean = parameter_of(robot.n_tubes), neutral(robot)
    chosen = [(name, known[name]) for name in names]
    return (
        np.array([mean[name] for name, _ in chosen]),
        np.array([p.sigma for _, p in chosen]),
        np.array([p.hard[0] for _, p in chosen]),
        np.array([p.hard[1] for _, p in chosen]),
    )
