"""Where in the space of joints a reading was taken, as one vector; or of joints and load."""

import numpy as np
from numpy.typing import NDArray

from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]

LEVER = 0.02  # [m] of insertion that moves the tip about as far as a radian
OTHER_LOAD = 1e-3  # [N] that makes another place


def joint_places(measurements: Measurements) -> Array:
    """(M, 2 N), in radians."""
    return np.column_stack([measurements.beta / LEVER, measurements.alpha])


def loaded_places(measurements: Measurements) -> Array:
    """(M, 2 N + 3): with the load, any change of which counts for much."""
    return np.column_stack([joint_places(measurements), measurements.force / OTHER_LOAD])
