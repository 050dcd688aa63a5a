"""The residual of a table in which each run has a frame, or homes, of its own.

What a run has of its own is profiled out: at any values of the parameters each run takes what fits it best, and the fit
sees the residual that remains. The readings are near to that already (`ctcr.table.sessions`), so it acts linearly. It
stays near the robot file's by its prior, many times widened, so that a run that hardly determines it keeps it.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.model import parameters
from ctcr.model.noise import noise_of_readings
from ctcr.model.protocol import ResidualModel
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

FRAME = 6  # numbers of a frame


def told(names: Sequence[str], readings: Measurements) -> list[str]:
    """The names, less those of parameters that the readings cannot determine: of the common tracker frame where each
    run has its own, and of the sensor's rotation where no orientation was measured."""
    nothing = () if readings.sessions is None else parameters.OF_FRAME
    nothing += () if readings.oriented.any() else ("tracker.sensor_rotation.",)
    return [name for name in names if not name.startswith(nothing)]


def as_given(model: Any) -> Any:
    """A recording of the readings as they were taken."""
    return model.as_given() if isinstance(model, SessionRecording) else model


class SessionRecording(ResidualModel):
    """A recording of readings with sessions, beside which each run keeps what little of its own they left in it."""

    def __init__(self, robot: Robot, readings: Measurements, table: Any, as_given: Callable[[], Any], homes: Any):
        """table: the recording of the readings; as_given(): of these as they were taken; homes: as `table`, whose
        parameters are the homes, where each run has its own."""
        self.table, self.as_given, self.readings = table, as_given, readings
        self.index = np.searchsorted(readings.sessions.run, readings.run)
        own, self.by_homes = parameters.expand("tracker.frame", robot), None
        if homes is not None:
            own += parameters.expand("homes", robot)
            self.by_homes = np.nan_to_num(homes.residual(homes.nominal(), True)[1]).reshape(len(readings), 6, -1)
        width = settings.SESSION_PRIOR_WIDER * np.array([parameters.stated_sd(robot, name) for name in own])
        self.sd = np.maximum(width, np.finfo(float).tiny ** 0.5)  # (k,) of what a run has of its own
        noise = noise_of_readings(robot, readings)
        jitter, field = (noise.position_jitter, noise.rotation_jitter), (noise.position_field, noise.rotation_field)
        self.weight = 1 / np.repeat(np.hypot(jitter, field), 3) ** 2
        self.origin = readings.sessions.origin

    def nominal(self) -> Array:
        return self.table.nominal()

    def activate(self, rows: Sequence[bool]) -> None:
        self.table.activate(list(rows))

    def unsolved(self) -> list[int]:
        return self.table.unsolved()

    def predicted(self) -> tuple[Array, Array]:
        return self.table.predicted()

    @property
    def friction_is_solved(self) -> bool:
        return self.table.friction_is_solved

    def solve_friction(self, x: Array) -> float:
        return self.table.solve_friction(x)

    def begin_at(self, other: "SessionRecording") -> None:
        if type(other.table) is type(self.table):
            self.table.begin_at(other.table)

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        residual, jacobian, _ = self.table.residual(x, derivatives)
        columns = np.column_stack([residual, jacobian]) if derivatives else residual[:, None].copy()
        for _, numbers, own, weighted in self._runs(residual):
            left = np.linalg.solve(own.T @ weighted + np.diag(1 / self.sd**2), weighted.T @ columns[numbers])
            columns[numbers] -= own @ left
        return columns[:, 0], columns[:, 1:], bool(np.isfinite(residual).any())

    def moves(self, x: Array) -> Array:
        """The best changes (R, k) of each run's own values at these parameters, relative to its session."""
        self.activate([True] * len(self.readings))
        residual = self.table.residual(x)[0]
        moves = np.zeros((len(self.readings.sessions.run), len(self.sd)))
        for run, numbers, own, weighted in self._runs(residual):
            information = own.T @ weighted + np.diag(1 / self.sd**2)
            moves[run] = -np.linalg.solve(information, weighted.T @ residual[numbers])
        return moves

    def columns(self, residual: Array) -> Array:
        """Derivatives (6 M, R k) of the residual (6 M,) by what each run has of its own, in units of its prior sd."""
        made = np.zeros((len(residual), len(self.readings.sessions.run), len(self.sd)))
        for run, numbers, own, _ in self._runs(residual):
            made[numbers, run] = own * self.sd
        return made.reshape(len(residual), -1)

    def _runs(self, residual: Array) -> Iterator[tuple[int, Integers, Array, Array]]:
        """Of each run with known residuals: its index, their numbers in (6 M,), their derivatives (K, k) by what the
        run has of its own, and these weighted."""
        residual = residual.reshape(-1, 6)
        arm = self.readings.positions - residual[:, :3] - self.origin
        known = np.isfinite(residual)
        order = np.argsort(self.index, kind="stable")
        ends = np.searchsorted(self.index[order], np.arange(len(self.readings.sessions.run) + 1))
        for run in range(len(self.readings.sessions.run)):
            rows = order[ends[run] : ends[run + 1]]
            rows = rows[known[rows, :3].all(axis=1)]
            if not len(rows):
                continue
            own = np.zeros((len(rows), 6, len(self.sd)))
            own[:, :3, :3] = own[:, 3:, 3:FRAME] = -np.eye(3)
            own[:, :3, 3:FRAME] = np.cross(np.eye(3), arm[rows, None])  # matrices of the product with the arm
            if self.by_homes is not None:
                own[:, :, FRAME:] = self.by_homes[rows]
            finite = known[rows].ravel()
            numbers = (6 * rows[:, None] + np.arange(6)).ravel()[finite]
            own = own.reshape(-1, len(self.sd))[finite]
            yield run, numbers, own, own * np.tile(self.weight, len(rows))[finite, None]
