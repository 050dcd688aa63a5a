"""Runs as sessions: what each run of a table has of its own, as where the tracker was moved or tubes were homed anew.

The readings are seen from one frame and with one set of homes, those of the robot file; `Sessions` holds what was taken
out of each run to get there.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr.arrays import Array, Integers
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.robot.description import Robot

Readings = Any  # Measurements, whose module imports this one


@dataclass(frozen=True)
class Sessions:
    """The pose of each run's frame against that of the robot file, and its homes against those of the file."""

    run: Integers  # (R,)
    origin: Array  # (3,) [m] of the file's frame, tracker axes: frames turn about it
    shift: Array  # (R, 3) [m] of the frame's origin, tracker axes
    turn: Array  # (R, 3) [rad] rotation vector, tracker axes
    homes: Array | None = None  # (R, 2 N) [m], then [rad]; None: the runs share them

    TITLE = "What each run has of its own, against the typical run"

    @classmethod
    def alike(cls, robot: Robot, readings: Readings, homes: bool = False) -> "Sessions":
        """All runs as in the robot file."""
        run = np.unique(readings.run)
        own = np.zeros((len(run), 2 * robot.n_tubes)) if homes else None
        return cls(run, np.array(robot.tracker.position), *np.zeros((2, len(run), 3)), own)

    def moved(self, moves: Array) -> "Sessions":
        """After further moves (R, k) of each run: shift, turn, and where the runs have them, homes."""
        turn = Rotation.from_rotvec(self.turn)
        return replace(
            self,
            shift=self.shift + turn.apply(moves[:, :3]),
            turn=(turn * Rotation.from_rotvec(moves[:, 3:6])).as_rotvec(),
            homes=None if self.homes is None else self.homes + moves[:, 6:],
        )

    def taken_out(self, readings: Readings) -> Readings:
        """Readings, given as they were taken, as seen from one frame and with one set of homes."""
        index = np.searchsorted(self.run, readings.run)
        turn = Rotation.from_rotvec(self.turn[index]).inv()
        position = self.origin + turn.apply(readings.positions - self.shift[index] - self.origin)
        return replace(self._turned(readings, position, turn, 1.0), sessions=self)

    def put_back(self, readings: Readings) -> Readings:
        """The inverse of `taken_out`."""
        index = np.searchsorted(self.run, readings.run)
        turn = Rotation.from_rotvec(self.turn[index])
        position = self.origin + turn.apply(readings.positions - self.origin) + self.shift[index]
        return replace(self._turned(readings, position, turn, -1.0), sessions=None)

    def _turned(self, readings: Readings, position: Array, turn: Rotation, sign: float) -> Readings:
        quaternion, beta, alpha = readings.quaternion, readings.beta, readings.alpha
        if quaternion is not None:
            quaternion = product(quaternion_from_rotation_vector(turn.as_rotvec()), quaternion)
        if self.homes is not None:
            of_beta, of_alpha = np.split(self.homes[np.searchsorted(self.run, readings.run)], 2, axis=1)
            beta, alpha = beta + sign * of_beta, alpha + sign * of_alpha
        position = None if readings.position is None else position
        return replace(readings, position=position, quaternion=quaternion, beta=beta, alpha=alpha)

    @property
    def typical(self) -> tuple[Array, Array, Array | None]:
        """Shift [m], turn [rad] and homes [m, rad] of the typical run."""
        homes = None if self.homes is None else np.median(self.homes, axis=0)
        return np.median(self.shift, axis=0), Rotation.from_rotvec(self.turn).mean().as_rotvec(), homes

    @property
    def columns(self) -> dict[str, str]:
        """The columns of `rows`, with what they mean."""
        tubes = [] if self.homes is None else range(1, self.homes.shape[1] // 2 + 1)
        return (
            {"run": ""}
            | {f"{axis}, mm": f"shift of the run's tracker frame along {axis}" for axis in "xyz"}
            | {f"turn {axis}, deg": f"its rotation vector, {axis}" for axis in "xyz"}
            | {f"beta{i}, mm": f"shift of the home of tube {i}" for i in tubes}
            | {f"alpha{i}, deg": f"turn of the home of tube {i}" for i in tubes}
        )

    def rows(self) -> list[list[str]]:
        """The runs against the typical one, for people."""
        return [
            [str(one["run"]), *(f"{x:+.2f}" for name, part in one.items() if name != "run" for x in part)]
            for one in self.as_dict()
        ]

    def as_dict(self) -> list[dict[str, Any]]:
        """The runs against the typical one, for JSON."""
        shift, turn, homes = self.typical
        own = (Rotation.from_rotvec(turn).inv() * Rotation.from_rotvec(self.turn)).as_rotvec()
        found: list[dict[str, Any]] = [
            {"run": int(run), "shift_mm": 1e3 * away, "turn_deg": np.degrees(turned)}
            for run, away, turned in zip(self.run, self.shift - shift, own, strict=True)
        ]
        if self.homes is not None:
            for one, away in zip(found, self.homes - homes, strict=True):
                of_beta, of_alpha = np.split(away, 2)
                one |= {"home_translation_mm": 1e3 * of_beta, "home_rotation_deg": np.degrees(of_alpha)}
        return found
