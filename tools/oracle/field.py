"""How metal misleads an electromagnetic tracker: dipoles induced in it, read as if they were not there."""

import numpy as np

# Six coils on a plate behind the origin of the tracker's frame: places (6, 3) [m], and axes that lean different ways.
_TURN = np.deg2rad(np.arange(0, 360, 60))
_COILS = 0.06 * np.column_stack([np.cos(_TURN), np.sin(_TURN), np.full(6, 0.5)])
_LEAN = _TURN + np.tile([0.0, 2.1], 3)
_AXES = np.column_stack([np.cos(_LEAN), np.sin(_LEAN), np.full(6, 0.7)])
_AXES /= np.linalg.norm(_AXES, axis=1, keepdims=True)


def dipole_field(place: np.ndarray) -> np.ndarray:
    """(3, 3) field at a place (3,) [m] of unit dipoles along x, y, z at the origin; column = dipole. Scale left out."""
    r = np.linalg.norm(place)
    n = place / r
    return (3 * np.outer(n, n) - np.eye(3)) / r**3


def coil_fields(place: np.ndarray) -> np.ndarray:
    """(3, 6) field at a place (3,) [m] of each coil of the tracker. Scale left out."""
    return np.column_stack([dipole_field(place - coil) @ axis for coil, axis in zip(_COILS, _AXES, strict=True)])


def induced_fields(place: np.ndarray, metal: np.ndarray, volume: float) -> np.ndarray:
    """(3, 6) what metal of a volume [m^3], in pieces at (K, 3) [m], adds: a dipole in each against the field there."""
    parts = [dipole_field(place - piece) @ coil_fields(piece) for piece in metal]
    return -volume * np.mean(parts, axis=0)


def misread(place: np.ndarray, metal: np.ndarray, volume: float) -> tuple[np.ndarray, np.ndarray]:
    """Error of position (3,) [m] and rotation vector (3,) [rad] read at a place, to first order in the volume [m^3].

    The tracker takes the sum of the fields for that of its coils alone and looks for the pose that explains it best.
    """
    own, step = coil_fields(place), 1e-7
    columns = [(coil_fields(place + d) - coil_fields(place - d)).ravel() / (2 * step) for d in step * np.eye(3)]
    # A sensor turned by w reads the field turned by -w.
    columns += [-np.cross(axis, own, axisb=0, axisc=0).ravel() for axis in np.eye(3)]
    added = induced_fields(place, metal, volume)
    solution = np.linalg.lstsq(np.column_stack(columns), added.ravel(), rcond=None)[0]
    return solution[:3], solution[3:]
