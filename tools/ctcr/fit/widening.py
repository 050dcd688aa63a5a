"""How far the readings contradict what the robot file says of its own uncertainty: a scale on each of its numbers.

Each number of the file's `uncertainty` is the prior standard deviation of a group of parameters, such as the curvatures
of all tubes, or in a list of one parameter. Its scale, 1 or larger, maximises the log evidence (empirical Bayes), which
follows from the Gaussian posterior of a fit alone. A scale beyond 1 must gain DECISIVE, so that chance widens nothing.
Ref: MacKay, "Bayesian Interpolation", 1992.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.show.wording import times

WORDS = {
    "tracker_frame_mm": "the position of the tracker frame",
    "tracker_frame_deg": "the rotation of the tracker frame",
    "rotation_offset_deg": "the home rotations",
    "translation_offset_mm": "the home translations",
    "length_mm": "the lengths of the tubes",
    "curved_length_mm": "the curved lengths of the tubes",
    "sensor_position_mm": "the sensor's position",
    "sensor_rotation_deg": "the sensor's rotation",
    "curvature_percent": "the curvatures",
    "youngs_modulus_percent": "the stiffnesses of the tubes",
}
NEARLY_NONE = 1e-9  # precision of a prior that is not stated: keeps sums of information positive definite
Scales = Mapping[str, float]  # on the standard deviations of a group, by its key in `uncertainty`; 1 where absent


@dataclass(frozen=True)
class Widened:
    """A number of the file's `uncertainty` that the readings contradict."""

    uncertainty: str  # its key; in a list, with its index
    stated: float  # in the unit of the key
    factor: float  # by which it was widened

    @property
    def sentence(self) -> str:
        key, index = key_and_index(self.uncertainty)
        axes = key.startswith(("tracker", "sensor"))
        which = "" if index is None else f" ({'xyz'[index] if axes else f'tube {index + 1}'})"
        unit = key.rsplit("_", 1)[-1].replace("percent", "%")
        of = f"The stated uncertainty of {WORDS[key]}{which}, {self.stated:g} {unit}"
        return f"{of}, is contradicted by the data: widened {times(self.factor)}."


def widened(robot: Robot, scales: Scales) -> list[Widened]:
    """The numbers of the robot file's `uncertainty` that a fit had to scale."""
    places = {group: key_and_index(group) for group in scales}
    stated = {group: robot.uncertainty.of(key, index or 0) for group, (key, index) in places.items()}
    return [Widened(group, stated[group], factor) for group, factor in scales.items()]


def key_and_index(group: str) -> tuple[str, int | None]:
    """length_mm[1] as ("length_mm", 1), length_mm as ("length_mm", None)."""
    key, _, index = group.rstrip("]").partition("[")
    return key, int(index) if index else None


def log_prior(scales: Scales) -> float:
    """Log probability of the scales, up to a constant: each that differs from 1 is as unlikely as DECISIVE says."""
    return -settings.DECISIVE * len(scales)


@dataclass(frozen=True)
class Likelihood:
    """Quadratic log likelihood of n shifts z from the prior mean, in stated prior sd (where none is stated, in the sd
    that the readings give it): linear @ z - z @ information @ z / 2."""

    information: Array  # (n, n)
    linear: Array  # (n,)
    known: Mask  # (n,) whether a prior sd is stated
    prior: Array  # (n, n) precision of the prior, in stated prior sd; 0 without
    members: Mapping[str, Mask]  # (n,) the parameters of each group

    @classmethod
    def of(cls, fit: Any, more: Array | None = None) -> "Likelihood":
        """Of the readings of a fit; with `more` (K, k), also of parameters at their prior mean by which its whitened
        residual has these derivatives, in prior sd."""
        residual, jacobian = fit.whitened()
        stated = fit.priors.stated
        known = np.isfinite(stated)
        unit = np.where(known, stated, 1 / np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny))
        shift = (fit.values - fit.priors.mean) / unit
        if more is not None:
            one = np.ones(more.shape[1])
            jacobian, known = np.hstack([jacobian, more]), np.append(known, one > 0)
            unit, shift = np.append(unit, one), np.append(shift, 0 * one)
        information = jacobian.T @ jacobian * np.outer(unit, unit)
        groups = [*fit.priors.groups, *[None] * (len(shift) - len(fit.priors.groups))]
        members = {key: known & [group == key for group in groups] for key in dict.fromkeys(groups) if key}
        members = {key: own for key, own in members.items() if own.any()}
        prior = np.eye(len(shift))
        n = len(fit.names)
        prior[:n, :n] = replace(fit.priors, scales={}).precision * np.outer(unit[:n], unit[:n])
        return cls(information, information @ shift - unit * (jacobian.T @ residual), known, prior, members)

    def log_evidence(self, scales: Scales, derivatives: Collection[str] = ()) -> tuple[float, Array]:
        """Up to a constant, and its derivatives by the logarithms of some scales."""
        scale = np.ones(len(self.linear))
        for key, value in scales.items():
            scale[self.members[key]] = value
        prior = self.prior / np.outer(scale, scale)
        factor = cho_factor(self.information + prior + np.diag(np.where(self.known, 0.0, NEARLY_NONE)))
        z = cho_solve(factor, self.linear)
        value = 0.5 * self.linear @ z - np.log(np.diag(factor[0])).sum() - np.log(scale[self.known]).sum()
        if not derivatives:
            return float(value), np.zeros(0)
        each = z * (prior @ z) + np.sum(cho_solve(factor, np.eye(len(z))) * prior, axis=1) - 1
        return float(value), np.array([each[self.members[key]].sum() for key in derivatives])

    def posterior(self, scales: Scales) -> float:
        """Log evidence and prior of the scales, up to a constant."""
        return self.log_evidence(scales)[0] + log_prior(scales)

    def likeliest(self) -> dict[str, float]:
        """The scales of largest posterior that differ from 1: of all groups, those are dropped that gain too little."""
        choices = [[key for key in self.members if key_and_index(key)[0] != no] for no in parameters.CONFOUNDED]
        best = max(map(self._maximum, choices), key=self.posterior)
        if self.log_evidence(best)[0] - self.log_evidence({})[0] < settings.DECISIVE:
            return {}
        while best:
            others = [self._maximum([other for other in best if other != key]) for key in best]
            without = max(others, key=self.posterior)
            if self.posterior(without) <= self.posterior(best):
                return best
            best = without
        return best

    def _maximum(self, groups: Collection[str]) -> dict[str, float]:
        """The scales of these groups of largest log evidence; those that stay 1 are left out."""

        def cost(log_scales: Array) -> tuple[float, Array]:
            value, slope = self.log_evidence(dict(zip(groups, np.exp(log_scales), strict=True)), groups)
            return -value, -slope

        if not groups:
            return {}
        bounds = [(0.0, np.log(settings.WIDEST))] * len(groups)
        found = minimize(cost, np.ones(len(groups)), jac=True, method="L-BFGS-B", bounds=bounds)
        return {key: float(np.exp(x)) for key, x in zip(groups, found.x, strict=True) if x > 0}
