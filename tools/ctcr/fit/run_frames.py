"""A fit with a tracker frame of its own for every run, as where the tracker or the robot was moved between runs.

The frames are profiled out: at any values of the other parameters each run takes the frame that fits it best, and the
fit sees what is then left. Frames move a little from the robot file's by its prior, many times widened, so that a run
that hardly determines its frame keeps it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ctcr.errors import InputError, Problem
from ctcr.fit import folds, joint
from ctcr.frames import conjugate, product, quaternion_from_rotation_vector
from ctcr.model import parameters, recording, user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WIDER = 10.0  # the frames' prior against that of the robot file
ALIGNMENT_STEPS = 6  # before the first fit
STARTS = 4  # frames of their own make room for other minima


@dataclass(frozen=True)
class RunFrames:
    """The pose of each run's frame against the one that the robot has after the fit, tracker axes."""

    run: NDArray[np.int64]  # (R,)
    shift: Array  # (R, 3) [m] of the base frame's origin
    turn: Array  # (R, 3) [rad] rotation vector

    COLUMNS = ("run", "x, mm", "y, mm", "z, mm", "turn x, deg", "turn y, deg", "turn z, deg")

    @property
    def spread_mm(self) -> float:
        """RMS distance of the runs' origins from the common one."""
        return 1e3 * float(np.sqrt(np.mean(np.sum(self.shift**2, axis=1))))

    def rows(self) -> list[list[str]]:
        return [
            [str(run), *(f"{value:+.2f}" for value in (*(1e3 * shift), *np.degrees(turn)))]
            for run, shift, turn in zip(self.run, self.shift, self.turn, strict=True)
        ]

    def as_dict(self) -> list[dict[str, Any]]:
        return [
            {"run": int(run), "shift_mm": 1e3 * shift, "turn_deg": np.degrees(turn)}
            for run, shift, turn in zip(self.run, self.shift, self.turn, strict=True)
        ]


@dataclass(frozen=True)
class FramedFit:
    """A Fit of the parameters other than the frame, with the frames; the rest as in `ctcr.fit.joint.Fit`."""

    fit: Any
    frames: RunFrames
    common: tuple[Array, Array]  # shift [m] and turn [rad] of the robot file's frame to the typical one
    nominal_residual: Array  # with the robot file's one frame

    def __getattr__(self, name: str):
        return getattr(self.fit, name)

    def moved(self, values: Array) -> "FramedFit":
        """The same with other values of the parameters."""
        return replace(self, fit=replace(self.fit, values=values))

    def apply(self, robot: Robot) -> Robot:
        """A copy of the robot with the fitted values and the typical frame of the runs."""
        changed = self.fit.apply(robot)
        shift, turn = self.common
        tracker = changed.tracker
        tracker.position_mm = (1e3 * (tracker.position + shift)).tolist()
        tracker.rotation_vector_rad = (
            (Rotation.from_rotvec(turn) * Rotation.from_rotvec(tracker.rotation_vector_rad)).as_rotvec().tolist()
        )
        return changed


def fit_with_frames(
    robot: Robot,
    readings: Measurements,
    names: Sequence[str],
    rows: Mask,
    *,
    noise,
    sd: Mapping[str, float] | None = None,
    starts: int | None = None,
    inflation: Array | None = None,
) -> FramedFit:
    """As `ctcr.fit.joint.fit`, with a frame for every run beside the named parameters, none of them of the frame."""
    if not names:
        raise InputError(Problem("--frame-per-run fits the frames by itself: name other parameters in --free too"))
    began, priors = perf_counter(), parameters.priors(robot, names, sd)
    framed = _Framed(robot, readings, names, noise)
    nominal = framed.unprofiled(priors[0])
    for _ in range(ALIGNMENT_STEPS):
        framed.align(priors[0])
    rows = rows & framed.solvable(priors[0])
    few, fit = folds.few_of(rows), None
    # Twice, as within a fit the frames act linearly.
    for chosen in (rows if few is None else few, rows):
        framed.activate(chosen.tolist())
        fit = joint.identify_with(
            framed,
            names,
            *priors,
            noise,
            joint.places_of(robot, readings),
            start=fit and fit.values,
            starts=1 if fit else starts or STARTS,
            inflation=inflation,
            within=parameters.admissible(robot, readings.beta[rows], names),
        )
        framed.align(fit.values)
    fit = replace(fit, seconds=perf_counter() - began)
    frames, common = framed.frames()
    return FramedFit(fit, frames, common, nominal)


def error_with_frames(robot: Robot, readings: Measurements, noise) -> tuple[float, float]:
    """RMS position error [mm] with the robot's one frame, and with the frame for each run that fits best."""
    names = ["tubes.1.length"]
    framed, values = _Framed(robot, readings, names, noise), parameters.priors(robot, names)[0]
    before = framed.unprofiled(values)
    for _ in range(ALIGNMENT_STEPS):
        framed.align(values)
    after = framed.unprofiled(values)
    return tuple(1e3 * float(np.sqrt(np.nanmean(np.sum(r[:, :3] ** 2, axis=1)))) for r in (before, after))


class _Framed:
    """Residuals of a table in which each run has the frame that fits it best; what `identify_with` takes."""

    def __init__(self, robot: Robot, readings: Measurements, names: Sequence[str], noise):
        self.robot, self.readings, self.names = robot, readings, names
        self.run, self.index = np.unique(readings.run, return_inverse=True)
        self.shift, self.turn = np.zeros((len(self.run), 3)), np.zeros((len(self.run), 3))
        u = robot.uncertainty
        self.prior = 1 / (WIDER * np.repeat([1e-3 * u.tracker_frame_mm, np.radians(u.tracker_frame_deg)], 3)) ** 2
        jitter = (noise.position_jitter, noise.rotation_jitter)
        field = (noise.position_field, noise.rotation_field)
        self.steps = recording.steps_for(robot, readings, noise)
        self.weight = 1 / np.repeat(np.hypot(jitter, field), 3) ** 2
        self._read()

    def activate(self, rows: Sequence[bool]) -> None:
        self.table.activate(list(rows))

    def solvable(self, values: Array) -> Mask:
        """Rows that the model solves (M,)."""
        self.activate([True] * len(self.readings))
        self.table.residual(values)
        solved = np.ones(len(self.readings), bool)
        solved[self.table.unsolved()] = False
        return solved

    def residual(self, values: Array) -> tuple[Array]:
        answer = self(values, False)
        return (np.full(6 * len(self.readings), np.nan) if answer is None else answer[0],)

    def unprofiled(self, values: Array) -> Array:
        """Residuals (M, 6) with the one frame of the robot file."""
        self.activate([True] * len(self.readings))
        return self.table.residual(values)[0].reshape(-1, 6)

    def __call__(self, values: Array, derivatives: bool) -> tuple[Array, Array] | None:
        residual, jacobian, solved = self.table.residual(values, derivatives)
        if not solved and np.isnan(residual).all():
            return None
        columns = np.column_stack([residual, jacobian]) if derivatives else residual[:, None]
        columns = columns - self._frame_part(residual, columns)[0]
        return columns[:, 0], columns[:, 1:]

    def align(self, values: Array) -> None:
        """Moves each run's frame to where it fits best at these values."""
        self.activate([True] * len(self.readings))
        residual = self.table.residual(values)[0]
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
        """What the frames take of columns (6 M, k), and the frames' moves (R, 6) for the first column."""
        residual = residual.reshape(-1, 6)
        arm = self.seen_position - residual[:, :3] - self.robot.tracker.position
        taken, moves = np.zeros_like(columns), np.zeros((len(self.run), 6))
        for run in range(len(self.run)):
            rows = np.flatnonzero((self.index == run) & np.isfinite(residual[:, :3]).all(axis=1))
            if len(rows) == 0:
                continue
            effect = np.zeros((len(rows), 6, 6))
            effect[:, :3, :3] = effect[:, 3:, 3:] = -np.eye(3)
            effect[:, :3, 3:] = _cross(arm[rows])
            known = np.isfinite(residual[rows]).ravel()
            places = (6 * rows[:, None] + np.arange(6)).ravel()[known]
            effect = effect.reshape(-1, 6)[known]
            weighted = effect * np.tile(self.weight, len(rows))[known, None]
            solution = np.linalg.solve(weighted.T @ effect + np.diag(self.prior), weighted.T @ columns[places])
            taken[places] = effect @ solution
            moves[run] = -solution[:, 0]
        return taken, moves


def _cross(vectors: Array) -> Array:
    """Matrices (K, 3, 3) of the cross product with vectors (K, 3) from the left."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], axis=-2)
