"""Revisits, noise and directions: exact counts on stops, no false hysteresis on streams, honest uncertainties."""

import numpy as np
import pytest
from compare_bench import JITTER_MM, bench, stop_and_go, stream
from ctcr import settings
from ctcr.compare import compare
from ctcr.compare.noise import sensor_jitter
from ctcr.compare.sample import follow, take_sample
from ctcr.compare.visits import MIXED, OPPOSITE, SAME, find_revisits, find_stops


@pytest.mark.parametrize("stops", [5, 9, 12])
def test_stops(stops):
    """Out, back and one stop more: every stop but the turning point is met from both sides, one from the same.

    The first stop of a run has no known direction, so its revisit is not called opposite.
    """
    random = np.random.default_rng(stops)
    result = compare(*bench(random, stop_and_go(random, runs=7, stops=stops)))
    pairs = result.revisits
    assert np.sum(pairs.kind == SAME) == 7
    assert np.sum(pairs.kind == OPPOSITE) == 7 * (stops - 2) + 7
    assert np.sum(pairs.kind == MIXED) == 7
    assert pairs.miss.max() < 1e-9
    assert not pairs.between_runs.any()


def test_smooth_error_in_a_stream():
    """A linear function of the joints is no hysteresis, though no reading of the return falls on one of the way out."""
    random = np.random.default_rng(2)
    path = stream(random)

    def error(joints, t, run):
        return joints[:, :3] @ np.array([[0.3, 0, 0.1], [0, 0.2, 0.1], [0.002, 0.001, 0]])

    result = compare(*bench(random, path, error, noise_mm=0))
    spread = np.ptp(np.linalg.norm(result.sample.error, axis=1)) * 1e3
    assert result.direction.pairs > 200
    assert spread > 3
    assert result.direction.rms_mm < 0.01 * spread


def test_noise_in_a_stream():
    """Noise alone is no hysteresis; its size follows from the weights of interpolation."""
    random = np.random.default_rng(3)
    result = compare(*bench(random, stream(random)))
    d = result.direction
    assert d.p_against_quiet > 0.01
    weight = result.revisits.weight[result.revisits.kind == OPPOSITE]
    factor = np.mean(1 + (1 - weight) ** 2 + weight**2)
    assert d.rms_mm == pytest.approx(JITTER_MM * np.sqrt(3 * factor), rel=0.1)


def test_sensor_jitter():
    """About 95 in 100 floors lie within two standard errors of the truth; with 12 runs the errors are Student's t."""
    inside, floors = 0, []
    for seed in range(60):
        random = np.random.default_rng(seed)
        sample = take_sample(*bench(random, stop_and_go(random, runs=12, stops=5)))
        stops = find_stops(sample)
        noise = sensor_jitter(stops, find_revisits(stops, sample.lever), stated_mm=1.0)
        assert (noise.source, noise.pairs) == ("revisits", 12)
        inside += abs(noise.axis_mm - JITTER_MM) < 2.2 * noise.uncertainty_mm
        floors.append(noise.axis_mm**2)
    assert inside >= 51
    assert np.sqrt(np.mean(floors)) == pytest.approx(JITTER_MM, rel=0.03)


def test_rests():
    """Rows at rest are one visit and give the scatter."""
    random = np.random.default_rng(4)
    joints, run, t = stop_and_go(random, runs=1, stops=6)
    joints = np.repeat(joints[:6], 20, axis=0)
    path = joints, np.zeros(len(joints), int), 0.05 * np.arange(len(joints))
    result = compare(*bench(random, path, jitter_mm=0.2))
    assert len(result.stops.run) == 6
    assert result.stops.size.tolist() == [20] * 6
    assert len(result.revisits) == 0
    assert result.noise.source == "rest"
    assert abs(result.noise.axis_mm - JITTER_MM) < 4 * result.noise.uncertainty_mm
    assert result.noise.uncertainty_mm < 0.1 * JITTER_MM


def test_stated_jitter():
    """Without revisits and rests the floor is the stated jitter."""
    random = np.random.default_rng(5)
    joints, run, t = stop_and_go(random)
    once = np.concatenate([np.flatnonzero(run == number)[:9] for number in np.unique(run)])
    result = compare(*bench(random, (joints[once], run[once], t[once]), jitter_mm=0.07))
    assert result.noise.source == "stated"
    assert result.noise.axis_mm == 0.07
    assert result.direction is None


def test_thinned_search(monkeypatch):
    """A search with too many neighbours is thinned and still finds true pairs."""
    random = np.random.default_rng(6)
    measured = bench(random, stream(random))
    complete = compare(*measured)
    monkeypatch.setattr("ctcr.settings.MOST_NEIGHBOURS", 2000)
    result = compare(*measured)
    assert 10 < result.direction.pairs < min(400, complete.direction.pairs)
    sample = result.headline
    step = np.linalg.norm(np.diff(sample.motion.scaled, axis=0), axis=1)[np.diff(sample.run) == 0]
    assert result.revisits.miss.max() <= np.clip(settings.PASS_APART * np.median(step), *settings.PASS_APART_BOUNDS)


def test_thinned_periods(monkeypatch):
    """Where every run goes through the same stops, a thinned search sees all of them, and so the same hysteresis."""
    random = np.random.default_rng(8)
    joints, run, t = stop_and_go(random, runs=100, stops=10, shared=True)

    def error(joints, t, run):  # grows along each run
        return 5e-5 * (np.arange(len(run)) % 20)[:, None] * [1.0, 0.0, 0.0]

    measured = bench(random, (joints, run, t), error)
    complete = compare(*measured).direction
    near = 210  # visits that a search finds near each one
    for visits in (400, 200, 100, 101):  # every fifth, tenth and 20th: parts of the period of the runs
        monkeypatch.setattr("ctcr.settings.MOST_NEIGHBOURS", near * visits)
        thinned = compare(*measured).direction
        assert thinned.pairs < visits
        assert thinned.rms_mm == pytest.approx(complete.rms_mm, rel=0.1)


def test_directions():
    """Directions follow the joints and stay through rests."""
    random = np.random.default_rng(7)
    steps = random.choice([-1.0, 0.0, 1.0], (400, 2)) * 0.01
    joints = np.cumsum(steps, axis=0)
    run = np.repeat([0, 1], 200)
    motion = follow(np.arange(400.0), run, joints[:, :1], joints[:, 1:], lever=0.05)
    for column in range(2):
        expected = []
        for row in range(400):
            if row % 200 == 0:
                last = 0
            elif steps[row, column]:
                last = np.sign(steps[row, column])
            expected.append(last)
        assert motion.direction[:, column].tolist() == expected
    assert np.isnan(motion.rate[[0, 200]]).all()
    np.testing.assert_allclose(motion.rate[1:200], steps[1:200])


def test_encoder_noise():
    """Noise below the band does not reverse a direction."""
    random = np.random.default_rng(8)
    ramp = np.concatenate([np.linspace(0, 1, 300), np.linspace(1, 0, 300)])
    noisy = ramp + random.uniform(-8e-5, 8e-5, 600)
    quiet_rows = np.r_[5:295, 305:600]
    motion = follow(np.arange(600.0), np.zeros(600, int), noisy[:, None], noisy[:, None], lever=1.0)
    expected = np.where(np.arange(600) < 300, 1, -1)
    assert (motion.direction[quiet_rows, 0] == expected[quiet_rows]).all()
