"""A recording of a robot that also has effects of the user's own, written in Python: see `user_effects`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array
from ctcr.effects import catalogue, user_effects
from ctcr.effects.user_effects import Effect, Rows
from ctcr.effects.user_hooks import PROFILES, Hooks
from ctcr.errors import InputError, Problem
from ctcr.frames import matrix_from_quaternion, matrix_from_rotation_vector
from ctcr.model import parameters, recording
from ctcr.model.protocol import ResidualModel
from ctcr.model.sessions import SessionRecording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


def recording_of(robot: Robot, measurements: Measurements, names: Sequence[str] = (), **options: Any) -> Any:
    """As `recording.recording_of`, also where runs are sessions, and the robot or the names have effects of loaded
    files."""
    if (sessions := measurements.sessions) is not None:
        one, tables = replace(measurements, sessions=None), [names]
        if sessions.homes is not None:
            tables.append(parameters.expand("homes", robot))
        table, *homes = (recording_of(robot, one, some, **options) for some in tables)
        return SessionRecording(
            robot,
            measurements,
            table,
            as_given=lambda: recording_of(robot, sessions.put_back(measurements), names, **options),
            homes=homes[0] if homes else None,
        )
    own = user_effects.used_by(robot, names)
    if own:
        return UserRecording(robot, measurements, names, own, **options)
    return recording.recording_of(robot, measurements, names, **options)


Poses = tuple[Array, Array]  # positions (M, 3) [m] and rotations (M, 3, 3)


class UserRecording(ResidualModel):
    """The recording of a robot with `own_effects` of the user's.

    x holds the parameters `names`, of the robot, of the library's effects (effects.softening.gamma.2) and of
    `own_effects` (effects.<id>.<parameter>[.<tube>]); `fixed` gives others another value than the robot's. Derivatives
    by parameters of the library are exact, those by parameters of the user's come from central differences of the
    user's functions; they neglect that the joints which these change also change the history of friction.
    Raises InputError where a name does not exist, and where a function of the user's fails, returns other than it
    should, or acts at its neutral values.
    """

    def __init__(
        self,
        robot: Robot,
        measurements: Measurements,
        names: Sequence[str],
        own_effects: Sequence[Effect],
        *,
        fixed: Mapping[str, float] | None = None,
        steps: int = settings.STEPS,
        threads: int = 0,
    ):
        self._robot, self._table, self._names = robot, measurements, list(names)
        self._hooks = hooks = Hooks(robot, Rows.of(measurements), own_effects)
        own = {effect.id for effect in own_effects}
        rest = {identity: given for identity, given in robot.effects.items() if identity not in own}
        self._library_robot = robot.with_effects(rest)
        library, known = recording.names_of(robot.n_tubes), catalogue.names_of(robot.n_tubes)
        self._nominal = dict(zip(library, recording.values(self._library_robot).tolist(), strict=True))
        self._own_sigma: dict[str, float] = {}
        for effect in own_effects:
            self._add_parameters(effect)
        self._nominal |= fixed or {}
        for name in self._names:
            if name not in self._nominal:
                raise InputError(Problem(f"no parameter is named {name}"))
        self._options = {
            "steps": max(steps, settings.PROFILE_STEPS) if hooks.has(*PROFILES) else steps,
            "threads": threads,
            "fixed": {name: value for name, value in (fixed or {}).items() if name in known},
        }
        # Joints and forces that the user's functions change act through these parameters of the compiled recording.
        self._joints = parameters.expand("homes", robot) if hooks.has("joints") else []
        self._forces = catalogue.names_with("tip_force", robot.n_tubes) if hooks.has("force", "base") else []
        given = [name for name in self._names if name in library]
        self._inner = list(dict.fromkeys([*given, *self._joints, *self._forces]))
        hooks.check_neutral(self._nominal)
        self._reference = self._reference_poses()
        self._recording, self._inputs = None, None
        self._measured = measurements.positions, matrix_from_quaternion(measurements.quaternions)
        self._active, self._solvable = np.ones((2, len(measurements)), bool)
        self.residual(self.nominal())
        self._solvable = self._solved

    # ---- as a compiled Recording

    def nominal(self) -> Array:
        return np.array([self._nominal[name] for name in self._names])

    def activate(self, rows: Sequence[bool]) -> None:
        self._active = np.array(rows, bool)

    def solve_friction(self, x: Array) -> float:
        values = self._values(x)
        return self._prepared(values).solve_friction(self._inner_x(values))

    def unsolved(self) -> list[int]:
        """Active rows that could not be solved at the last call, and those that never can."""
        return np.flatnonzero(self._active & ~self._solved).tolist()

    def predicted(self) -> tuple[Array, Array]:
        position, rotation = self._reading
        quaternion = np.full((len(position), 4), nan)
        good = np.isfinite(position).all(axis=1)
        if good.any():
            xyzw = Rotation.from_matrix(rotation[good]).as_quat(canonical=True)
            quaternion[good] = xyzw[:, [3, 0, 1, 2]]
        return position, quaternion

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        """Like ResidualModel.residual(); usable where every row was solved that is solvable at the file's values."""
        values = self._values(x)
        inner = self._prepared(values)
        wanted = self._active & self._solvable
        inner.activate(wanted.tolist())
        start, jacobian, _ = inner.residual(self._inner_x(values), derivatives)
        position, quaternion = inner.predicted()
        rotation = matrix_from_quaternion(quaternion)
        self._solved = wanted & np.isfinite(position).all(axis=1)
        self._reading = self._outer(position, rotation, values)
        error = _apart(self._measured, self._reading)
        usable = bool((self._solved | ~wanted).all())
        if not derivatives:
            return error.ravel(), np.empty((0, 0)), usable
        of_pose = np.linalg.solve(_by_prediction(start.reshape(-1, 6)), jacobian.reshape(len(error), 6, -1))
        jacobian = _by_prediction(error) @ self._of_reading(of_pose, position, rotation, values)
        jacobian[~np.isfinite(error).any(axis=1)] = 0.0
        return error.ravel(), np.nan_to_num(jacobian).reshape(error.size, -1), usable

    # ---- before and behind the compiled model

    def _values(self, x: Array) -> dict[str, float]:
        """All parameters by name, those of x among them."""
        return self._nominal | dict(zip(self._names, map(float, x), strict=True))

    def _inner_x(self, values: dict[str, float]) -> Array:
        """Parameters of the compiled recording."""
        return np.array([values[name] for name in self._inner])

    def _prepared(self, values: dict[str, float]):
        """The compiled recording of the rows as the user's effects change them."""
        inputs = (*self._hooks.inputs(values), self._hooks.profiles(values))
        if self._recording is None or not all(map(np.array_equal, inputs, self._inputs)):
            self._recording, self._inputs = self._recording_of(inputs), inputs
        return self._recording

    def _recording_of(self, inputs: tuple[Array | None, ...]):
        beta, alpha, force, profiles = inputs
        position, quaternion = self._reference
        rows = replace(self._table, beta=beta, alpha=alpha, force=force, position=position, quaternion=quaternion)
        return recording.recording_of(self._library_robot, rows, self._inner, **self._options | {"profiles": profiles})

    def _outer(self, position: Array, rotation: Array, values: dict[str, float]) -> tuple[Array, Array]:
        """The reading of the sensor's pose, for a tracker frame as `values` have it."""
        origin, turn = (np.array([values[f"tracker.{k}.{axis}"] for axis in "xyz"]) for k in ("position", "rotation"))
        frame = origin, matrix_from_rotation_vector(turn) @ self._robot.tracker.rotation
        return self._hooks.outer(position, rotation, values, frame, self._solved)

    # ---- derivatives

    def _of_reading(self, of_pose: Array, position: Array, rotation: Array, values: dict[str, float]) -> Array:
        """Derivatives (M, 6, n) of the reading, position and rotation vector, tracker axes; `of_pose` (M, 6, k): of the
        sensor's pose by the parameters of the compiled recording."""
        column = {name: k for k, name in enumerate(self._inner)}
        total = np.zeros((len(position), 6, len(self._names)))
        kinds = ("translation", "rotation")
        ratios = [values[name] / self._nominal[name] for name in (f"actuation.{kind}_ratio" for kind in kinds)]
        for k, name in enumerate(self._names):
            if name in column:
                total[:, :, k] = of_pose[:, :, column[name]]
                continue
            plus, minus, width = self._two_sides(self._hooks.inputs, values, name)
            beta, alpha, force = ((a - b) / width for a, b in zip(plus, minus, strict=True))
            motions = (self._joints, np.hstack([ratios[0] * beta, ratios[1] * alpha])), (self._forces, force)
            for through, motion in motions:
                if through:
                    chain = of_pose[:, :, [column[other] for other in through]]
                    total[:, :, k] += np.einsum("mij,mj->mi", chain, motion)
        if self._hooks.has(*PROFILES):
            self._add_profiles(total, values)
        if not self._hooks.has("base", "reading"):
            return total
        by_pose = np.empty((len(position), 6, 6))
        for i in range(6):
            step, axis = settings.POSITION_STEP if i < 3 else settings.ROTATION_STEP, np.eye(3)[i % 3]
            sides = []
            for shift in (step * axis, -step * axis):
                turned = rotation if i < 3 else matrix_from_rotation_vector(shift) @ rotation
                sides.append(self._outer(position + shift if i < 3 else position, turned, values))
            by_pose[:, :, i] = _difference(*sides, 2 * step)
        total = by_pose @ total
        for k, name in enumerate(self._names):
            if name in self._own_sigma or (name.startswith("tracker.") and self._hooks.has("base")):
                sides = self._two_sides(lambda v: self._outer(position, rotation, v), values, name)
                total[:, :, k] += _difference(*sides)
        return total

    def _add_profiles(self, total: Array, values: dict[str, float]) -> None:
        """Adds the derivatives by parameters of profiles, from differences of whole predictions."""
        for k, name in enumerate(self._names):
            step, sides = settings.PROFILE_STEP * self._own_sigma.get(name, 0.0), []
            for sign in (1, -1):
                moved = self._hooks.profiles(values | {name: values[name] + sign * step})
                if np.array_equal(moved, self._inputs[3]):
                    break
                other = self._recording_of((*self._inputs[:3], moved))
                other.activate(self._solved.tolist())
                other.residual(self._inner_x(values))
                position, quaternion = other.predicted()
                sides.append((position, matrix_from_quaternion(quaternion)))
            else:
                total[:, :, k] += _difference(*sides, 2 * step)

    def _two_sides(self, function, values: dict[str, float], name: str):
        """function at one parameter a little more and a little less, and the distance between."""
        step = settings.DIFFERENCE_STEP * self._own_sigma.get(name, 1e-2)
        return (*(function(values | {name: values[name] + sign * step}) for sign in (1, -1)), 2 * step)

    # ---- once

    def _add_parameters(self, effect: Effect) -> None:
        """Takes the values of an effect of the user's from the robot file, and their prior sd."""
        given = self._robot.effects.get(effect.id, {})
        for p in effect.described(self._robot.n_tubes).parameters:
            numbers, count = np.atleast_1d(given.get(p.name, p.neutral)).astype(float), len(p.full_names)
            if len(numbers) not in (1, count):
                raise InputError(Problem(f"needs {count} number(s)", field=f"effects.{effect.id}.{p.name}"))
            self._nominal |= zip(p.full_names, np.broadcast_to(numbers, count).tolist(), strict=True)
            self._own_sigma |= dict.fromkeys(p.full_names, p.sigma)

    def _reference_poses(self) -> tuple[Array, Array]:
        """Poses from which residuals of the compiled recording count: the measured positions (where missing their
        centre) and predicted orientations."""
        table = self._table
        plain = recording.recording_of(self._library_robot, table, (), **self._options)
        plain.residual(np.empty(0))
        quaternion = plain.predicted()[1]
        quaternion[~np.isfinite(quaternion).all(axis=1)] = (1.0, 0.0, 0.0, 0.0)
        position = table.positions.copy()
        missing = ~np.isfinite(position).all(axis=1)
        position[missing] = 0.0 if missing.all() else position[~missing].mean(axis=0)
        return position, quaternion


def _by_prediction(error: Array) -> Array:
    """Derivative (M, 6, 6) of a residual (M, 6) by the predicted pose; 1 where it is not known."""
    turn = np.nan_to_num(error[:, 3:])
    square = np.sum(turn**2, axis=1)
    half = 0.5 * np.sqrt(np.maximum(square, 1e-3))
    far = (1 - half / np.tan(half)) / (4 * half**2)
    k = np.where(square < 1e-3, 1 / 12 + square / 720 + square**2 / 30240, far)
    cross = np.cross(np.eye(3), turn[:, None])  # matrices (M, 3, 3) of the product with `turn`
    made = np.tile(-np.eye(6), (len(error), 1, 1))
    made[:, 3:, 3:] -= 0.5 * cross + k[:, None, None] * (cross @ cross)
    return made


def _difference(plus: Poses, minus: Poses, width: float) -> Array:
    """Derivative (M, 6) between two poses, position and rotation vector; 0 where either is not solved."""
    return np.nan_to_num(_apart(plus, minus)) / width


def _apart(first: Poses, second: Poses) -> Array:
    """Position and rotation vector (M, 6) from the second poses to the first; NaN where not known."""
    made = np.full((len(first[0]), 6), nan)
    solved = np.isfinite(second[0]).all(axis=1)
    made[solved, :3] = (first[0] - second[0])[solved]
    both = solved & np.isfinite(first[1]).all(axis=(1, 2))
    if both.any():
        made[both, 3:] = Rotation.from_matrix(first[1][both] @ np.swapaxes(second[1][both], 1, 2)).as_rotvec()
    return made
