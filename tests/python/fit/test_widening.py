"""Scales on stated uncertainties: their evidence is that of the linear model, honest sheets stay, lies are found."""

import numpy as np
import pytest
from ctcr.fit import joint
from ctcr.fit.result import Priors
from ctcr.fit.widening import Likelihood, Widened
from ctcr.model.noise import Noise
from ctcr.model.protocol import LinearModel
from scipy.stats import multivariate_normal

NAMES = [
    *(f"tubes.{i}.curvature" for i in (1, 2, 3)),
    *(f"actuation.home_rotation.{i}" for i in (1, 2, 3)),
    *(f"tracker.position.{axis}" for axis in "xyz"),
]
GROUPS = [*3 * ["curvature_percent"], *3 * ["rotation_offset_deg"], *3 * ["tracker_frame_mm"]]
STATED = np.repeat([0.5, 0.02, 5e-4], 3)
NOISE = Noise(position_jitter=1.0, rotation_jitter=1.0)


def fitted(
    random: np.random.Generator, scale: np.ndarray | float, rows: int = 30, correlations: np.ndarray | None = None
) -> joint.Fit:
    """A fit of readings of a random linear model whose parameters differ by `scale` (n,) stated deviations."""
    jacobian = random.normal(size=(6 * rows, len(NAMES))) / STATED
    truth = scale * STATED * random.normal(size=len(NAMES))
    # Residual: measured - predicted, so that parameters enter with a minus.
    residual = jacobian @ truth + random.normal(size=6 * rows)
    zero, far = np.zeros(len(NAMES)), np.full(len(NAMES), np.inf)
    model = LinearModel(residual, -jacobian, zero, zero)
    priors = Priors(NAMES, zero, STATED, -far, far, groups=GROUPS, correlations=correlations)
    return joint.fit_joint(model, priors, NOISE, np.zeros((rows, 3)), weights=np.ones((rows, 2)), inflation=np.ones(2))


def some_correlations(random: np.random.Generator) -> np.ndarray:
    covariance = np.cov(random.normal(size=(len(NAMES), 2 * len(NAMES))))
    sd = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sd, sd)


@pytest.mark.parametrize("correlated", [False, True])
def test_evidence(correlated):
    """The log evidence of scales is that of the readings under their marginal distribution, and so are derivatives; the
    fit is that of Bayes' formula for a normal prior."""
    random, rows = np.random.default_rng(1), 4
    correlations = some_correlations(random) if correlated else np.eye(len(NAMES))
    fit = fitted(random, 1.0, rows, correlations if correlated else None)
    likelihood, left = Likelihood.of(fit), fit.nominal_residual.ravel()
    scales = {"curvature_percent": 1.7, "tracker_frame_mm": 3.0}

    def prior(scale: np.ndarray) -> np.ndarray:
        return correlations * np.outer(STATED * scale, STATED * scale)

    def marginal(scale: np.ndarray) -> float:
        covariance = np.eye(6 * rows) + fit.jacobian_all @ prior(scale) @ fit.jacobian_all.T
        return multivariate_normal(np.zeros(6 * rows), covariance).logpdf(left)

    covariance = np.linalg.inv(fit.jacobian_all.T @ fit.jacobian_all + np.linalg.inv(prior(np.ones(9))))
    np.testing.assert_allclose(
        fit.covariance / np.outer(STATED, STATED), covariance / np.outer(STATED, STATED), atol=1e-9
    )
    np.testing.assert_allclose(fit.values / STATED, -covariance @ fit.jacobian_all.T @ left / STATED, atol=1e-6)
    assert fit.log_evidence == pytest.approx(marginal(np.ones(9)), abs=1e-6)
    by_marginal = marginal(np.repeat([1.7, 1.0, 3.0], 3)) - marginal(np.ones(9))
    assert likelihood.log_evidence(scales)[0] - likelihood.log_evidence({})[0] == pytest.approx(by_marginal, abs=1e-6)
    _, slope = likelihood.log_evidence(scales, ["curvature_percent"])
    h = 1e-5
    sides = [likelihood.log_evidence(scales | {"curvature_percent": 1.7 * np.exp(s)})[0] for s in (h, -h)]
    assert slope[0] == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-4)


def test_honest():
    """Parameters that differ as the file says widen nothing, but for rare chance."""
    random = np.random.default_rng(2)
    assert sum(bool(fitted(random, 1.0).priors.scales) for _ in range(150)) <= 2


def test_lies():
    """A group that is off by far more than stated is found, and it alone; the fit is that of the wider prior."""
    random = np.random.default_rng(4)
    scale = np.repeat([1.0, 10.0, 1.0], 3)
    found = [fitted(random, scale) for _ in range(30)]
    assert sum(fit.priors.scales.keys() == {"rotation_offset_deg"} for fit in found) >= 25
    assert 5 < np.median([fit.priors.scales.get("rotation_offset_deg", 1.0) for fit in found]) < 20
    assert np.max([np.abs(fit.shift[3:6]).max() for fit in found]) < 3


def test_frozen():
    """Scales that are given stay, so that evidences can be compared."""
    fit = fitted(np.random.default_rng(5), np.repeat([1.0, 10.0, 1.0], 3))
    again = joint.linear_fit(fit, weights=fit.weights, inflation=np.ones(2))
    assert again.priors.scales == fit.priors.scales and again.log_evidence == pytest.approx(fit.log_evidence, abs=1e-6)


@pytest.mark.parametrize("factor, words", [(1.26, "1.3 times."), (17.2, "17 times."), (173.2, "170 times.")])
def test_factor_in_words(factor, words):
    """A factor has two digits and no exponent, however large it is."""
    assert Widened("length_mm[1]", 0.5, factor).sentence.endswith(f"widened {words}")
