"""The register of causes that can be hidden in a simulated bench, and what their generators share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from session import Setup

Truth = dict[str, object]  # what was really put in, for the answer
Generator = Callable[[Setup, float, np.random.Generator], Truth]


@dataclass(frozen=True)
class Cause:
    """`ids`: the effects of the catalogue that are a right answer; none when the cause is in no catalogue."""

    generate: Generator
    ids: tuple[str, ...]
    streamed: bool = False  # needs readings in motion
    absorbed: bool = False  # calibration swallows it: nothing is missing
    slow: bool = False  # the robot goes in small moves
    uneven: bool = False  # has a part that is chance, from reading to reading


CAUSES: dict[str, Cause] = {}


def cause(*ids: str, **properties: bool) -> Callable[[Generator], Generator]:
    """Registers a generator under its own name. It changes the setup and returns what it put in, in SI units."""

    def register(generate: Generator) -> Generator:
        CAUSES[generate.__name__] = Cause(generate, ids, **properties)
        return generate

    return register


def n_tubes(setup: Setup) -> int:
    return len(setup.mechanics.robot.tubes)


def signed(setup: Setup, rng: np.random.Generator, at_least: int = 1) -> np.ndarray:
    """(N,), or more, about 1 in size, either sign."""
    count = max(n_tubes(setup), at_least)
    return rng.choice([-1.0, 1.0], count) * rng.uniform(0.7, 1.3, count)


def unit(rng: np.random.Generator) -> np.ndarray:
    """(3,) a direction."""
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)
