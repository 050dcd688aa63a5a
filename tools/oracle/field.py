"""How a piece of metal misleads an electromagnetic tracker: an induced dipole, inverted as if it were not there."""

import numpy as np

_GENERATOR = np.array([0.0, 0.0, 0.05])  # [m] three crossed coils, behind the origin of the tracker's frame


def dipole_field(place: np.ndarray) -> np.ndarray:
    """(3, 3) field at a place (3,) [m] of unit dipoles along x, y, z at the origin; column = dipole. Scale left out."""
    r = np.linalg.norm(place)
    n = place / r
    return (3 * np.outer(n, n) - np.eye(3)) / r**3


def induced_dipole(place: np.ndarray, metal: np.ndarray, volume: float) -> tuple[np.ndarray, np.ndarray]:
    """Error of position (3,) [m] and rotation vector (3,) [rad] read at a place, to first order in the volume [m^3].

    The metal answers the field of each coil with a dipole against it. The tracker takes the sum for the field of its
    coils alone and looks for the pose that explains it best.
    """
    here, at_metal = place - _GENERATOR, metal - _GENERATOR
    extra = dipole_field(place - metal) @ (-volume * dipole_field(at_metal))
    field, step = dipole_field(here), 1e-6 * np.linalg.norm(here)
    columns = [
        (dipole_field(here + d) - dipole_field(here - d)).ravel() / (2 * step) for d in step * np.eye(3)
    ]
    # A sensor turned by w reads the field turned by -w.
    columns += [-np.cross(axis, field, axisb=0, axisc=0).ravel() for axis in np.eye(3)]
    solution = np.linalg.lstsq(np.column_stack(columns), extra.ravel(), rcond=None)[0]
    return solution[:3], solution[3:]
