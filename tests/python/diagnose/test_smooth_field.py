"""A field distorted by a piece of metal, alone and with more: the rest is smooth, and errors are corrected for it."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr.diagnose import diagnose, smooth_field
from ctcr.diagnose.engine import Engine
from ctcr.effects import catalogue
from ctcr.effects.catalogue import get
from ctcr.fit import joint
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings

NAMES = get("field_distortion").names_with("source")  # volume, position, coils
LENGTH, SIZE = 0.04, 1.5e-4  # of the smooth error [m]


@pytest.fixture(scope="module")
def piece(robot, recorded):
    """A small piece of metal beside the robot."""
    places = joint.sensor_positions(robot, simulation.simulate(robot, recorded, "none"))
    at = np.median(places, axis=0) + [0.06, -0.05, 0.06]
    return dict(zip(NAMES, [6e-6, *at, 0, 0, 0], strict=True))


@pytest.fixture(scope="module")
def by_metal(robot, recorded, piece):
    metal = catalogue.with_values(robot, ["field_distortion"], piece)
    return simulation.simulate(metal, recorded, "jitter", seed=3)


def smooth(places, length, size):
    """A random error of this standard deviation an axis that changes within this length, at places (M, 3)."""
    random = np.random.default_rng(4)
    error = np.zeros_like(places)
    for _ in range(200):
        wave = random.standard_normal(3) / length
        error += np.cos(places @ wave + random.uniform(0, 2 * np.pi))[:, None] * random.standard_normal(3)
    return size * error / 10  # of 200 waves of mean square 1/2


@pytest.fixture(scope="module")
def more(by_metal):
    """Readings beside that piece and something else."""
    return replace(by_metal, position=by_metal.position + smooth(by_metal.position, LENGTH, SIZE))


@pytest.fixture(scope="module")
def distorted_more(robot, more):
    return diagnose(robot, more)


def fitted(robot, readings, start):
    noise = noise_of_readings(robot, readings)
    engine = Engine(robot, readings, noise, np.ones(len(readings), bool), free=["tracker.position.*"])
    return engine, engine.fit(list(start), start=start)


def test_size_and_length(robot, more, piece):
    """The smooth error is estimated with its size and its length, in a fit with a distorted field alone."""
    noise = smooth_field.likeliest_noise(*fitted(robot, more, piece))
    assert noise.correlation_length == pytest.approx(LENGTH, rel=0.5)
    assert SIZE / 2 < noise.position_field < 2 * SIZE
    assert f"{1e3 * noise.position_field:.2g} mm" in smooth_field.message(noise)
    assert smooth_field.likeliest_noise(*fitted(robot, more, {})) is None


def test_correction(distorted_more):
    """Held-out readings are corrected by those nearby; then nothing seems to vary any more."""
    assert [a.ids for a in distorted_more.accepted] == [["field_distortion"]]
    assert distorted_more.verdict.word == "identified"
    assert smooth_field.CORRECTED in distorted_more.residual.messages
    rms = distorted_more.rms_mm
    plain = distorted_more.rms_mm_after(distorted_more.accepted[0])
    noise = rms["noise_floor"] ** 2
    assert not distorted_more.residual.structured and distorted_more.varying is None
    assert plain**2 - noise > 4 * (rms["with_effects"] ** 2 - noise)
    jitter = 1e3 * np.sqrt(3) * distorted_more.with_effects.noise.position_jitter
    assert rms["noise_floor"] == pytest.approx(jitter, rel=0.1)


def test_metal_alone(robot, by_metal, piece):
    """A piece of metal is found with its position and volume, and leaves nothing smooth."""
    found = diagnose(robot, by_metal)
    assert found.verdict.word == "identified"
    assert [a.ids for a in found.accepted] == [["field_distortion"]]
    values = found.parameters(found.accepted[0])
    volume, *at = (piece[name] for name in NAMES[:4])
    assert np.linalg.norm([values[f"metal_{axis}"] for axis in "xyz"] - np.array(at)) < 0.01
    assert values["metal_volume"] == pytest.approx(volume, rel=0.3)
    assert not any("more than the small piece" in line for line in found.residual.messages)
    assert found.rms_mm["with_effects"] < 1.15 * found.rms_mm["noise_floor"]
