"""A field distorted by more than a small piece of metal: what that leaves is smooth, and errors allow for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr.diagnose import add, diagnose, distorted, varying
from ctcr.diagnose.candidates import METAL
from ctcr.diagnose.engine import Engine
from ctcr.fit import joint
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file

ROOT = Path(__file__).parents[3]
NAMES = [distorted.EFFECT + name for name in METAL]
LENGTH, SIZE = 0.04, 1.5e-4  # of the smooth error [m]


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROOT / "examples" / "robots" / "table2.yaml")


@pytest.fixture(scope="module")
def piece(robot, recorded):
    """A small piece of metal beside the robot."""
    places = joint.places_of(robot, simulation.simulate(robot, recorded, "none"))
    at = np.median(places, axis=0) + [0.06, -0.05, 0.06]
    return dict(zip(NAMES, [6e-6, *at, 0, 0, 0], strict=True))


@pytest.fixture(scope="module")
def by_metal(robot, recorded, piece):
    metal = add.with_values(robot, ["field_distortion"], piece)
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


def test_a_smooth_error_is_seen_as_large_and_as_long_as_it_is(robot, more, piece):
    noise = distorted.noise_of(*fitted(robot, more, piece))
    assert noise.correlation_length == pytest.approx(LENGTH, rel=0.5)
    assert SIZE / 2 < noise.position_field < 2 * SIZE
    assert f"{1e3 * noise.position_field:.2g} mm" in distorted.in_words(noise)
    # Of another cause it is no distortion of the field.
    assert distorted.noise_of(*fitted(robot, more, {})) is None


def test_runs_that_no_fit_saw_are_corrected_by_those_nearby(distorted_more):
    assert [a.ids for a in distorted_more.accepted] == [["field_distortion"]]
    assert distorted_more.verdict.word == "identified"
    assert distorted.FOLLOWED in distorted_more.leftover.in_words
    rms = distorted_more.rms_mm
    plain = distorted_more.reached_mm(distorted_more.accepted[0])
    noise = rms["noise_floor"] ** 2
    assert plain**2 - noise > 4 * (rms["with_effects"] ** 2 - noise)
    jitter = 1e3 * np.sqrt(3) * distorted_more.with_effects.noise.position_jitter
    assert rms["noise_floor"] == pytest.approx(jitter, rel=0.1)


def test_what_seemed_to_vary_before_it_was_allowed_for_is_not_told(robot, by_metal, monkeypatch):
    more = replace(by_metal, position=by_metal.position + smooth(by_metal.position, 0.025, 3e-4))
    seen = []

    def found(_engine, fit, _sample):
        seen.append(fit)
        return varying.Varying([], 0.5, fit.residual)

    monkeypatch.setattr(varying, "may_outdo", lambda *_: True)
    monkeypatch.setattr(varying, "found", found)
    told = diagnose(robot, more)
    assert seen, "no more than noise was left before it was allowed for"
    assert not told.leftover.structured and told.varying is None


def test_what_a_piece_of_metal_does_leaves_nothing_smooth(robot, by_metal):
    found = diagnose(robot, by_metal)
    assert [a.ids for a in found.accepted] == [["field_distortion"]]
    assert not any("more than the small piece" in line for line in found.leftover.in_words)
    assert found.rms_mm["with_effects"] < 1.15 * found.rms_mm["noise_floor"]
