"""Prediction of runs that no fit has seen."""

from dataclasses import replace

import numpy as np
from ctcr.diagnose import held_out
from ctcr.diagnose.engine import Engine
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
