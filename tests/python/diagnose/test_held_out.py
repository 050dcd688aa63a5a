"""Prediction of runs that no fit has seen."""

from dataclasses import replace

import numpy as np
from ctcr.diagnose import held_out
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.residual import residual_of
from ctcr.fit import folds, joint
from ctcr.model import parameters, simulation
from ctcr.model.noise import noise_of_readings


def test_uncertain_parameters(robot, plan):
    """What the parameters may be off by, as few readings determine them, is no unexplained error: robots drawn from the
    stated uncertainty leave about as much as the scatter of their chi-square."""
    rng, found, as_if_known = np.random.default_rng(8), [], []
    for seed in range(16):
        names = parameters.expand("standard", robot)
        mean, sd, low, high = parameters.priors(robot, names)
        made = parameters.applied(robot, names, np.clip(mean + sd * rng.standard_normal(len(mean)), low, high))
        readings = simulation.simulate(made, plan, "jitter", seed=seed)
        fitted = np.arange(len(readings)) % 8 == 0
        fit = Engine(robot, readings, noise_of_readings(robot, readings), fitted, threads=1).fit()
        for each, to in ((fit, found), (replace(fit, covariance=0 * fit.covariance), as_if_known)):
            to.append(held_out.unexplained_of(each, ~fitted)(fit.residual) / np.sqrt(12 * np.sum(~fitted)))
    assert np.median(found) < 2 < np.median(as_if_known)


def test_errors_of_held_out_runs(robot, plan):
    """Noise that explains the fitted readings explains held-out ones as well, or the residual is more than noise."""
    readings = simulation.simulate(robot, plan, "realistic", seed=3)
    held_out_rows = folds.held_out_rows(robot, readings)
    more = np.random.default_rng(1).normal(0, 2e-3 * robot.tracker.jitter_mm, readings.position.shape)
    noisier = replace(readings, position=readings.position + more * held_out_rows[:, None])
    for measured, is_noise in ((readings, True), (noisier, False)):
        engine = Engine(robot, measured, noise_of_readings(robot, measured), ~held_out_rows, threads=1)
        fit = engine.fit_with_field([], {})
        assert not joint.rejects(fit)
        assert residual_of(engine, fit, fit, []).rejected != is_noise
