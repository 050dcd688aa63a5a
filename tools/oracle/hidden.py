"""Hides causes in a simulated bench. Each changes a `Setup`; size 1 is what a real bench may well have.

They take other forms than a fit would: a bilinear fibre section instead of a smooth law, gaps instead of saturating
curves, splines with random knots instead of Legendre polynomials, induced dipoles instead of polynomials in space.
"""

import hidden_drives  # noqa: F401  importing registers
import hidden_sensor  # noqa: F401
import hidden_strange  # noqa: F401
import hidden_surroundings  # noqa: F401
import hidden_tubes  # noqa: F401
import numpy as np
from hidden_cause import CAUSES, Truth
from session import Setup


def hide(setup: Setup, name: str, size: float, rng: np.random.Generator) -> Truth:
    """Put a cause of some size into the bench; size 0 leaves it as it is. What was put in, in SI units."""
    return CAUSES[name].generate(setup, size, rng) if size else {}
