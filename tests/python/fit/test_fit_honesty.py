"""Whether the standard deviations of a fit hold what they promise, where the usual covariance does not."""

import sys
from pathlib import Path

import numpy as np
import pytest
from ctcr import settings
from ctcr.fit import joint, one_sided
from ctcr.fit.result import Priors
from ctcr.model import recording
from ctcr.model.noise import Noise
from ctcr.model.protocol import ResidualModel
from ctcr.robot import robot_file
from ctcr.table import measurements as tables

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
DATA = ROOT / "examples" / "data" / "calibration"
NAMES = ["tubes.1.curved_length", "tracker.position.z"]
NOISE = Noise(position_jitter=1e-4, rotation_jitter=1e-3)


class Kinked(ResidualModel):
    """Readings of a curved length `c` that shows only where a tube is deployed further, and of an offset `o`."""

    REACH = np.linspace(0.03, 0.05, 21)

    def __init__(self, curved_length: float, offset: float, random: np.random.Generator):
        self.measured = np.full((len(self.REACH), 6), np.nan)
        self.measured[:, :3] = self._model(curved_length, offset) + 1e-4 * random.standard_normal((21, 3))

    def _model(self, curved_length, offset):
        straight = np.maximum(self.REACH - curved_length, 0.0)
        return np.column_stack([0.3 * straight, 0 * straight, offset + 0 * straight])

    def residual(self, x, derivatives=False):
        residual = self.measured.copy()
        residual[:, :3] -= self._model(*x)
        slope = np.zeros((len(self.REACH), 6, 2))
        slope[:, 0, 0] = 0.3 * (self.REACH > x[0])
        slope[:, 2, 1] = -1.0
        return residual.ravel(), slope.reshape(-1, 2), True


def fit_of(curved_length, offset, random, offset_sd=1e-3):
    mean, sd = np.array([0.0493, 0.0]), np.array([2.5e-3, offset_sd])
    priors = Priors(NAMES, mean, sd, mean - 0.05, mean + 0.05)
    return joint.fit_joint(Kinked(curved_length, offset, random), priors, NOISE, np.zeros((21, 3)))


def test_one_sided_coverage():
    """The widened standard deviation of a length bounded on one side has the right coverage."""
    random = np.random.default_rng(4)
    truths = random.normal([0.0493, 0.0], [2.5e-3, 1e-3], (300, 2))
    plain, honest = np.empty((2, 300, 2))
    for i, truth in enumerate(truths):
        fit = fit_of(*truth, random)
        plain[i] = (fit.values - truth) / fit.sd
        fit = one_sided.widened(fit)
        honest[i] = (fit.values - truth) / fit.sd
    assert np.mean(np.abs(honest) < 2, axis=0) == pytest.approx(0.96, abs=0.03)
    assert np.mean(honest[:, 0] ** 2) < 2.5 < 8 < np.mean(plain[:, 0] ** 2)  # the guard has something to guard
    np.testing.assert_allclose(honest[:, 1], plain[:, 1], rtol=1e-12)


def test_one_sided_told():
    """A length bounded on both sides keeps its sd; a flat side widens it, with a warning."""
    random = np.random.default_rng(5)
    inside = fit_of(0.042, 0.0, random)
    assert one_sided.widened(inside) is inside
    outside = [fit_of(0.054, 0.0, random) for _ in range(40)]
    told = [(fit, wide) for fit in outside if (wide := one_sided.widened(fit)) is not fit]
    assert len(told) > 5
    shown = 0
    for fit, wide in told:
        slope = wide.jacobian_all.reshape(len(Kinked.REACH), 6, 2)[:, :3, 0]
        open_to = np.sum(slope**2, axis=1) * (wide.sd[0] ** 2 - fit.sd[0] ** 2)
        np.testing.assert_allclose(wide.expected_square[:, 0], fit.expected_square[:, 0] + open_to)
        shown += wide.expected_mm() > 1.1 * fit.expected_mm()
        assert "how much longer" in wide.warnings[-1] and wide.ratio[0] > 0.3
        assert wide.covariance[0, 0] == pytest.approx(wide.sd[0] ** 2)
    assert shown > 5


def test_one_sided_no_prior():
    """Without a prior the ratio of posterior to prior sd is NaN."""
    random, told = np.random.default_rng(5), 0
    for _ in range(40):
        fit = one_sided.widened(fit_of(0.052, 0.0, random, offset_sd=np.inf))
        told += any("one side only" in text for text in fit.warnings)
        assert np.isfinite(fit.ratio[0]) and np.isnan(fit.ratio[1])
    assert told > 5


def test_kink_restart():
    """From the flat side no slope leads to the truth; a truth on that side stays there."""
    random = np.random.default_rng(6)
    for truth in random.uniform(0.046, 0.054, 40):
        model = Kinked(truth, 0.0, random)

        def fitted_from(start, like=None, model=model):
            frozen = {} if like is None else {"weights": like.weights, "inflation": like.inflation}
            mean, sd = np.array([0.0515, 0.0]), np.array([2.5e-3, 1e-3])
            priors = Priors(NAMES, mean, sd, mean - 0.05, mean + 0.05)
            return joint.fit_joint(model, priors, NOISE, np.zeros((21, 3)), start=start, **frozen)

        stuck = fitted_from(np.array([0.0515, 0.0]))
        found = one_sided.restarted(stuck, fitted_from)
        assert stuck.values[0] == pytest.approx(0.0515) and stuck.ratio[0] > 0.99
        if truth < 0.047:  # shows in enough readings not to look like outliers
            assert abs(found.values[0] - truth) < 4 * found.sd[0] < 1e-3
        if truth > 0.051:
            assert found is stuck


@pytest.mark.parametrize(("finer", "more"), [(1, False), (40, True)])
def test_integration_steps(finer, more):
    """Readings of a finer tracker take more steps of soft tubes under a weight, those of a coarser one fewer."""
    robot = robot_file.load(DATA / "robot.yaml")
    for tube in robot.tubes:
        tube.youngs_modulus_GPa *= 0.1
    table = tables.load(DATA / "measurements.csv", robot.n_tubes)
    table.force[:] = [0.0, -0.1, 0.0]
    noise = Noise(position_jitter=3.5e-5 / finer, rotation_jitter=5e-4 / finer)
    steps = recording.steps_for(robot, table, noise)
    assert (steps > settings.STEPS) == more
    fine = recording.recording_of(robot, table, steps=16).residual(np.empty(0))[0].reshape(-1, 6)
    scale = np.repeat([noise.position_jitter, noise.rotation_jitter], 3)

    def missed(steps):
        coarse = recording.recording_of(robot, table, steps=steps).residual(np.empty(0))[0].reshape(-1, 6)
        return np.nansum(((coarse - fine) / scale) ** 2)

    assert missed(steps) < 2 * settings.INTEGRATION_ERROR
    assert not more or missed(steps - 1) > 0.5 * settings.INTEGRATION_ERROR
    coarse = Noise(position_jitter=1e-2, rotation_jitter=1e-1)
    assert recording.steps_for(robot, table, coarse) == settings.STEPS


@pytest.mark.slow
def test_oracle_coverage():
    """True values are within two deviations on random robots of the oracle."""
    import calibration_study as study

    answers = study.study(200)
    for noise in study.NOISES:
        hits, count = study.within(answers, noise)
        assert 0.90 < hits / count < 0.98
        held_out, floor = study.errors_mm(answers, noise)
        assert held_out < 1.1 * floor
