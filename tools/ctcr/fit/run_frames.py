"""A fit with a tracker frame of its own for every run, as where the tracker or the robot was moved between runs.

The frames are profiled out: at any values of the other parameters each run takes the frame that fits it best, and the
fit sees the residual that remains. Frames move a little from the robot file's by its prior, many times widened, so that
a run that hardly determines its frame keeps it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask
from ctcr.errors import InputError, Problem
from ctcr.fit import folds, joint
from ctcr.fit.result import Fit, Priors, rms
from ctcr.frames import conjugate, product, quaternion_from_rotation_vector
from ctcr.model import recording, user_recording
from ctcr.model.noise import Noise
from ctcr.model.protocol import ResidualModel
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class RunFrames:
    """The pose of each run's frame against the one that the robot has after the fit, tracker axes."""

    run: Integers  # (R,)
    shift: Array  # (R, 3) [m] of the base frame's origin
    turn: Array  # (R, 3) [rad] rotation vector

    COLUMNS = ("run", "x, mm", "y, mm", "z, mm", "turn x, deg", "turn y, deg", "turn z, deg")

    def rows(self) -> list[list[str]]:
        numbers = np.hstack([1e3 * self.shift, np.degrees(self.turn)])
        return [[str(run), *(f"{x:+.2f}" for x in row)] for run, row in zip(self.run, numbers, strict=True)]

    def as_dict(self) -> list[dict[str, Any]]:
        return [
            {"run": int(run), "shift_mm": 1e3 * shift, "turn_deg": np.degrees(turn)}
            for run, shift, turn in zip(self.run, self.shift, self.turn, strict=True)
        ]


@dataclass(frozen=True, kw_only=True)
class FramedFit(Fit):
    """A fit of the parameters other than the frame, with a frame for each run."""

    frames: RunFrames
    common: tuple[Array, Array]  # shift [m] and turn [rad] of the robot file's frame to the typical one
    residual_before: Array  # (M, 6) at the robot file's values, with its one frame

    @property
    def nominal_residual(self) -> Array:
        return self.residual_before

    def apply(self, robot: Robot) -> Robot:
        """A copy of the robot with the fitted values and the typical frame of the runs."""
        changed = super().apply(robot)
        shift, turn = self.common
        tracker = changed.tracker
        tracker.position_mm = (1e3 * (tracker.position + shift)).tolist()
        rotation = Rotation.from_rotvec(turn) * Rotation.from_rotvec(tracker.rotation_vector_rad)
        tracker.rotation_vector_rad = rotation.as_rotvec().tolist()
        return changed


def fit_with_frames(
    robot: Robot,
    readings: Measurements,
    names: Sequence[str],
    rows: Mask,
    *,
    noise: Noise,
    sd: Mapping[str, float] | None = None,
    starts: int = settings.FRAME_STARTS,
    inflation: ArrayLike | None = None,
) -> FramedFit:
    """As `ctcr.fit.joint.fit`, with a frame for every run beside the named parameters, none of them of the frame."""
    if not names:
        raise InputError(Problem("--frame-per-run fits the frames by itself: name other parameters in --free too"))
    began = perf_counter()
    model = FramedRecording(robot, readings, names, noise)
    nominal = model.nominal()
    before = model.with_frames_fixed(nominal)
    model.align(nominal, settings.FRAME_ALIGNMENTS)
    rows = rows & model.solvable(nominal)
    # The gauges of a robot change its frame, too, which is profiled out.
    priors = replace(Priors.of(robot, names, readings.beta[rows], sd), gauges=())
    positions = joint.sensor_positions(robot, readings)
    few, start = folds.few_of(rows), np.clip(nominal, priors.low, priors.high)
    # Twice, as within a fit the frames act linearly.
    for chosen in (rows if few is None else few, rows):
        options = {"start": start, "starts": starts, "inflation": inflation, "few_first": False}
        fit = joint.fit_joint(model, priors, noise, positions, chosen, **options)
        start, starts = fit.values, 1
        model.align(start)
    frames, common = model.frames()
    found = {field.name: getattr(fit, field.name) for field in fields(Fit)} | {"seconds": perf_counter() - began}
    return FramedFit(**found, frames=frames, common=common, residual_before=before)


def error_with_frames(robot: Robot, readings: Measurements, noise: Noise) -> tuple[float, float]:
    """RMS position error [mm] with the robot's one frame, and with the frame for each run that fits best."""
    model = FramedRecording(robot, readings, [], noise)
    nominal = model.nominal()
    before = model.with_frames_fixed(nominal)
    model.align(nominal, settings.FRAME_ALIGNMENTS)
    after = model.with_frames_fixed(nominal)
    return 1e3 * rms(before[:, :3]), 1e3 * rms(after[:, :3])


class FramedRecording(ResidualModel):
    """Residuals of a table in which each run has the frame that fits it best."""

    def __init__(self, robot: Robot, readings: Measurements, names: Sequence[str], noise: Noise):
        self.robot, self.readings, self.names = robot, readings, names
        self.run, self.index = np.unique(readings.run, return_inverse=True)
        self.shift, self.turn = np.zeros((len(self.run), 3)), np.zeros((len(self.run), 3))
        u = robot.uncertainty
        width = [1e-3 * u.of("tracker_frame_mm", axis) for axis in range(3)]
        width += [np.radians(u.of("tracker_frame_deg", axis)) for axis in range(3)]
        self.prior = (
            1 / (settings.FRAME_PRIOR_WIDER * np.array(width)) ** 2
        )  # information on a shift [1/m^2] and a turn [1/rad^2]
        jitter = (noise.position_jitter, noise.rotation_jitter)
        field = (noise.position_field, noise.rotation_field)
        self.steps = recording.steps_for(robot, readings, noise)
        self.weight = 1 / np.repeat(np.hypot(jitter, field), 3) ** 2
        self._read()

    def nominal(self) -> Array:
        return self.table.nominal()

    def activate(self, rows: Sequence[bool]) -> None:
        self.table.activate(list(rows))

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        residual, jacobian, _ = self.table.residual(x, derivatives)
        columns = np.column_stack([residual, jacobian]) if derivatives else residual[:, None]
        columns = columns - self._frame_part(residual, columns)[0]
        return columns[:, 0], columns[:, 1:], bool(np.isfinite(residual).any())

    def solvable(self, values: Array) -> Mask:
        """Rows that the model solves (M,)."""
        self.with_frames_fixed(values)
        solved = np.ones(len(self.readings), bool)
        solved[self.table.unsolved()] = False
        return solved

    def with_frames_fixed(self, values: Array) -> Array:
        """Residuals (M, 6) where the frames stay as they are."""
        self.activate([True] * len(self.readings))
        return self.table.residual(values)[0].reshape(-1, 6)

    def align(self, values: Array, steps: int = 1) -> None:
        """Moves each run's frame to where it fits best at these values, by Gauss-Newton steps."""
        for _ in range(steps):
            residual = self.with_frames_fixed(values).ravel()
            moves = self._frame_part(residual, residual[:, None])[1]
            turn = Rotation.from_rotvec(self.turn)
            self.shift = self.shift + turn.apply(moves[:, :3])
            self.turn = (turn * Rotation.from_rotvec(moves[:, 3:])).as_rotvec()
            self._read()

    def frames(self) -> tuple[RunFrames, tuple[Array, Array]]:
        """The frames against the typical one, and that against the robot file's."""
        shift, turns = np.median(self.shift, axis=0), Rotation.from_rotvec(self.turn)
        turn = turns.mean()
        own = (turn.inv() * turns).as_rotvec()
        return RunFrames(self.run, self.shift - shift, own), (shift, turn.as_rotvec())

    def _read(self) -> None:
        """The table as seen from each run's own frame."""
        origin, turn = self.robot.tracker.position, Rotation.from_rotvec(self.turn[self.index])
        position = origin + turn.inv().apply(self.readings.position - self.shift[self.index] - origin)
        quaternion = self.readings.quaternion
        if quaternion is not None:
            quaternion = product(conjugate(quaternion_from_rotation_vector(turn.as_rotvec())), quaternion)
        seen = replace(self.readings, position=position, quaternion=quaternion)
        self.seen_position = position
        self.table = user_recording.recording_of(self.robot, seen, self.names, steps=self.steps)

    def _frame_part(self, residual: Array, columns: Array) -> tuple[Array, Array]:
        """The part of columns (6 M, k) that frames explain, and the frames' moves (R, 6) for the first column."""
        residual = residual.reshape(-1, 6)
        arm = self.seen_position - residual[:, :3] - self.robot.tracker.position
        taken, moves = np.zeros_like(columns), np.zeros((len(self.run), 6))
        for run in range(len(self.run)):
            rows = np.flatnonzero((self.index == run) & np.isfinite(residual[:, :3]).all(axis=1))
            if len(rows) == 0:
                continue
            effect = np.zeros((len(rows), 6, 6))
            effect[:, :3, :3] = effect[:, 3:, 3:] = -np.eye(3)
            effect[:, :3, 3:] = np.cross(np.eye(3), arm[rows, None])  # matrices of the product with the arm
            known = np.isfinite(residual[rows]).ravel()
            numbers = (6 * rows[:, None] + np.arange(6)).ravel()[known]
            effect = effect.reshape(-1, 6)[known]
            weighted = effect * np.tile(self.weight, len(rows))[known, None]
            solution = np.linalg.solve(weighted.T @ effect + np.diag(self.prior), weighted.T @ columns[numbers])
            taken[numbers] = effect @ solution
            moves[run] = -solution[:, 0]
        return taken, moves
