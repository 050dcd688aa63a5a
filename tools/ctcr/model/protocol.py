"""The protocol of a residual model: all that a joint fit needs of a model of recorded readings."""

from collections.abc import Sequence
from typing import Any, Protocol

from ctcr.arrays import Array


class ResidualModel(Protocol):
    """Residuals of M readings, measured - predicted, as functions of n parameters (SI).

    A row holds the position [m] and the rotation vector [rad], tracker axes. The compiled Recording is such a model.
    Models in Python inherit from this class what holds of a model without distributed friction.
    """

    friction_is_solved = False  # whether the friction path was solved at some parameters

    def nominal(self) -> Array:
        """Parameters (n,) of the robot file."""
        raise NotImplementedError

    def activate(self, rows: Sequence[bool]) -> None:
        """Chooses the rows (M,) that are solved from now on; the residual of others is NaN."""

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        """(residual (6 M,), its derivative (6 M, n) or empty, whether the prediction is usable).

        NaN where nothing was measured, or the model has no solution.
        """
        raise NotImplementedError

    def unsolved(self) -> list[int]:
        """Active rows that could not be solved at the last call."""
        return []

    def predicted(self) -> tuple[Array, Array]:
        """Readings without noise at the last call: position (M, 3) [m], quaternion (M, 4); NaN where not solved."""
        raise NotImplementedError

    def solve_friction(self, x: Array) -> float:
        """Solves the friction path at x; returns the largest change of a relative torsion angle [rad]."""
        return 0.0

    def begin_at(self, other: Any) -> None:
        """Takes over the equilibria and the friction path of a compiled Recording of the same table."""


class LinearModel(ResidualModel):
    """A model linearised at parameters (n,): its residual (6 M,) there, and the derivative (6 M, n)."""

    def __init__(self, residual: Array, jacobian: Array, at: Array, nominal: Array):
        self._residual, self._jacobian, self._at, self._nominal = residual, jacobian, at, nominal

    def nominal(self) -> Array:
        return self._nominal

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        return self._residual + self._jacobian @ (x - self._at), self._jacobian, True
