"""Causes in the drives and in the clock."""

import numpy as np
from drives import Periodic, Play
from hidden_cause import Truth, cause, n_tubes, signed
from session import Setup


@cause("backlash_rotation")
def backlash_rotation(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    half = np.deg2rad(0.5) * size * np.abs(signed(setup, rng))
    return _add_play(setup, n_tubes(setup) + np.arange(n_tubes(setup)), half, rng)


@cause("backlash_translation")
def backlash_translation(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    return _add_play(setup, np.arange(n_tubes(setup)), 50e-6 * size * np.abs(signed(setup, rng)), rng)


def _add_play(setup: Setup, joint: np.ndarray, half: np.ndarray, rng: np.random.Generator) -> Truth:
    skew = rng.uniform(-0.15, 0.15, half.size)
    setup.drives.append(Play(joint, half * (1 - skew), half * (1 + skew)))
    return {"half_gap": half}


@cause("delay", streamed=True, uneven=True)
def delay(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    mean, smear = 0.05 * size, rng.uniform(0.0, 0.5)
    reading = np.random.default_rng(rng.integers(1 << 32))
    setup.lags = mean * np.array([1 - smear, 1 + smear])
    setup.lag_noise = lambda: 1 + 0.1 * reading.normal()
    return {"delay_s": mean}


@cause("periodic_rotation")
def periodic_rotation(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    first = np.deg2rad(0.5) * size * np.abs(signed(setup, rng))
    return add_periodic(setup, n_tubes(setup) + np.arange(n_tubes(setup)), 2 * np.pi, first, rng)


@cause("periodic_translation")
def periodic_translation(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    pitch = 1e-3 * setup.bench.description["actuation"]["translation_mm_per_rev"]
    return add_periodic(setup, np.arange(n_tubes(setup)), pitch, 30e-6 * size * np.abs(signed(setup, rng)), rng)


def add_periodic(
    setup: Setup, joint: np.ndarray, per_turn: float, first: np.ndarray, rng: np.random.Generator
) -> Truth:
    """An error of the drives of these joints that returns every `per_turn`, with the amplitudes `first`."""
    phase = rng.uniform(0, 2 * np.pi, first.size)
    setup.drives.append(Periodic(joint, per_turn, first, 0.1 * first, phase))
    return {"amplitude": first, "phase": phase}
