"""The catalogue of physical effects that the standard model leaves out, and their values in a robot.

Parameters are named as in the library: effects.softening.gamma.2 (tube 2), effects.delay.delay. SI units.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from math import inf

import numpy as np

from ctcr import _core
from ctcr.arrays import Array
from ctcr.errors import InputError, Problem, suggestion
from ctcr.robot import robot_file
from ctcr.robot.description import Robot

NEEDS = ("order", "time", "orientation", "loads", "gravity")  # that data must have for some effects
# What is taken from the library as it is.
KEPT_OF_EFFECTS = ("id", "title", "physics", "signature", "measure", "reference", "form_error")
KEPT_OF_PARAMETERS = ("name", "unit", "meaning", "neutral", "sigma", "per_tube", "kind", "quantity")


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Its kind: an amplitude changes nothing at its neutral value, nor does a detail, which is fitted after the
    amplitudes. A shape sets the form of an effect. A choice selects a constitutive law and is never fitted.
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
    look_alikes: tuple[str, ...]  # effects that look alike in the data
    reference: str
    form_error: float  # part of the amplitude of its signal after calibration by which its form errs, as an sd
    needs: frozenset[str]  # some of NEEDS
    acts_on: frozenset[str]  # some of joints, rod, tip, reading
    parameters: tuple[EffectParameter, ...]
    variants: tuple[tuple[str, ...], ...] = ()  # names of parameters of each way to act; none: all amplitudes
    starts: tuple[dict[str, float], ...] = ()  # values of further starting points, by name

    def names(self, *parameters: str) -> list[str]:
        """Full names of all its parameters, or of the given ones."""
        return [name for p in self.parameters if not parameters or p.name in parameters for name in p.full_names]

    def of_kind(self, *kinds: str) -> list[str]:
        """Full names of its parameters of some kinds."""
        return [name for p in self.parameters if p.kind in kinds for name in p.full_names]

    @property
    def amplitudes(self) -> list[str]:
        return self.of_kind("amplitude")

    @property
    def shapes(self) -> list[str]:
        """Shapes and details: parameters that are fitted after the amplitudes."""
        return self.of_kind("detail", "shape")

    def names_with(self, quantity: str) -> list[str]:
        """Full names of the parameters with this quantity, in the order that it defines."""
        return [name for p in self.parameters if p.quantity == quantity for name in p.full_names]

    @property
    def laws(self) -> list[str]:
        """Selectors of a constitutive law: its choices, but for a moment."""
        return [name for name in self.of_kind("choice") if name not in self.names_with("moment")]


def full_names(effect: str, parameter: str, per_tube: bool, n_tubes: int) -> tuple[str, ...]:
    """The full name of a parameter, or one for each tube."""
    name = f"effects.{effect}.{parameter}"
    return tuple(f"{name}.{i + 1}" for i in range(n_tubes)) if per_tube else (name,)


@cache
def catalogue(n_tubes: int = _core.TUBES[0]) -> dict[str, Effect]:
    """All effects of the library by id, in the order in which they act."""
    parameters: dict[str, list[EffectParameter]] = {}
    for p in _core.effect_parameters(n_tubes):
        kept = {name: getattr(p, name) for name in KEPT_OF_PARAMETERS}
        described = EffectParameter(
            **kept,
            soft=(p.soft_low, p.soft_high),
            hard=(p.hard_low, p.hard_high),
            full_names=full_names(p.effect, p.name, p.per_tube, n_tubes),
        )
        parameters.setdefault(p.effect, []).append(described)
    effects = {}
    for e in _core.effect_catalogue():
        kept = {name: getattr(e, name) for name in KEPT_OF_EFFECTS}
        effects[e.id] = Effect(
            **kept,
            look_alikes=tuple(e.look_alikes.split()),
            needs=frozenset(need for need in NEEDS if getattr(e, need)),
            acts_on=frozenset(e.acts_on),
            parameters=tuple(parameters[e.id]),
            variants=tuple(map(tuple, e.variants)),
            starts=tuple(e.starts),
        )
    return effects


def all_effects(n_tubes: int) -> dict[str, Effect]:
    """The effects of the library, then those of users' files."""
    return catalogue(n_tubes) | {e.id: e.described(n_tubes) for e in robot_file.user_effects.values()}


def names_with(quantity: str, n_tubes: int) -> list[str]:
    """Full names of all parameters with this quantity, in the order that it defines."""
    return [name for effect in all_effects(n_tubes).values() for name in effect.names_with(quantity)]


@cache
def names_of(n_tubes: int) -> tuple[str, ...]:
    """All parameters of all effects, in the order of the library."""
    return tuple(name for effect in catalogue(n_tubes).values() for name in effect.names())


def parameter_of(n_tubes: int) -> dict[str, EffectParameter]:
    """The parameter that a full name belongs to."""
    return {name: p for effect in all_effects(n_tubes).values() for p in effect.parameters for name in p.full_names}


def get(name: str, n_tubes: int = _core.TUBES[0]) -> Effect:
    """An effect by its id; raises InputError that says what may be meant."""
    effects = all_effects(n_tubes)
    if name not in effects:
        raise InputError(Problem(f"no effect is named {name}: {robot_file.unknown_effect(name, effects)}"))
    return effects[name]


def in_python(robot: Robot) -> list[Problem]:
    """A fault of each effect of the robot that a user wrote in Python, where only the compiled library runs."""
    own = [identity for identity in robot.effects if identity in robot_file.user_effects]
    return [Problem(f"{one} is written in Python: {robot_file.NO_PYTHON}", robot.file or None) for one in own]


def neutral(robot: Robot) -> dict[str, float]:
    """The neutral value of every parameter; periods follow from the robot's transmission."""
    values = {name: p.neutral for name, p in parameter_of(robot.n_tubes).items()}
    periods = {
        "screw_pitch": abs(robot.actuation.screw_pitch),
        "gear_ratio": 1 / abs(robot.actuation.rotation_rev_per_rev or inf),
    }
    for quantity, period in periods.items():
        values |= {name: period for name in names_with(quantity, robot.n_tubes) if period}
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
            names = known[name].full_names if name in known else ()
            numbers = value if isinstance(value, list) else [value]
            if not names:
                hint = suggestion(name, known, f"its parameters are {', '.join(known)}")
                problems.append(Problem(f"unknown parameter: {hint}", field=f"effects.{identity}.{name}"))
            elif len(numbers) != len(names):
                problems.append(Problem(f"needs {len(names)} number(s)", field=f"effects.{identity}.{name}"))
            else:
                found.update(zip(names, map(float, numbers), strict=True))
    if problems:
        raise InputError(problems)
    return found


def as_section(
    names: Iterable[str], fitted: Iterable[float], robot: Robot
) -> dict[str, dict[str, float | list[float]]]:
    """Values by full name as the `effects:` section of a robot file, over the robot's own."""
    changed = dict(zip(names, map(float, fitted), strict=True))
    now = value_of(robot) | changed
    section = {}
    for identity in dict.fromkeys([*robot.effects, *(name.split(".")[1] for name in changed)]):
        parameters = get(identity, robot.n_tubes).parameters
        numbers = {p.name: [float(now[name]) for name in p.full_names] for p in parameters}
        section[identity] = {p.name: numbers[p.name] if p.per_tube else numbers[p.name][0] for p in parameters}
    return section


def with_values(robot: Robot, ids: Iterable[str], given: Mapping[str, float]) -> Robot:
    """The robot with these effects too: neutral, but for the values `given` by full name (SI); errors as `get`."""
    added = {identity: robot.effects.get(identity, {}) for identity in ids}
    for identity in added:
        get(identity, robot.n_tubes)
    return robot.with_effects(as_section(given.keys(), given.values(), robot.with_effects(robot.effects | added)))


def priors(robot: Robot, names: Iterable[str]) -> tuple[Array, Array, Array, Array]:
    """Mean (neutral), standard deviation, lowest and highest value of parameters of effects."""
    known, mean = parameter_of(robot.n_tubes), neutral(robot)
    rows = [(mean[name], known[name].sigma, *known[name].hard) for name in names]
    mean, sigma, low, high = np.array(rows, float).reshape(-1, 4).T
    return mean, sigma, low, high
