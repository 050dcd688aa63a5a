"""A recording of a robot that also has effects of the user's own, written in Python: see `user_effects`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.effects import catalogue, user_effects
from ctcr.effects.user_effects import Effect, Rows
from ctcr.effects.user_hooks import PROFILES, Hooks
from ctcr.errors import InputError, Problem
from ctcr.frames import matrix_from_quaternion, matrix_from_rotation_vector
from ctcr.model import recording
from ctcr.model.protocol import ResidualModel
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def recording_of(robot: Robot, measurements: Measurements, names: Sequence[str] = (), **options: Any) -> Any:
    """As `recording.recording_of`, also where the robot or the names have effects of loaded files."""
    own = user_effects.used_by(robot, names)
    if own:
        return UserRecording(robot, measurements, names, own, **options)
    return recording.recording_of(robot, measurements, names, **options)


class UserRecording(ResidualModel):
    """The recording of a robot with `own_effects` of the user's.

    x holds the parameters `names`, of the robot, of the library's effects (effects.softening.gamma.2) and of
    `own_effects` (effects.<id>.<parameter>[.<tube>]); `fixed` gives others another value than the robot's. Derivatives
    by parameters of the library are exact, those by parameters of the user's come from central differences of the
    user's functions; that the joints they change also change what friction remembers is left out of derivatives alone.
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
        self._robot, self._table = robot, measurements
        self._effects, self._names = list(own_effects), list(names)
        self._hooks = Hooks(robot, Rows.of(measurements), own_effects)
        known = catalogue.names_of(robot.n_tubes)
        self._options = {"steps": max(steps, settings.PROFILE_STEPS) if self._hooks.has(*PROFILES) else steps}
        self._options["threads"] = threads
        self._options["fixed"] = {name: value for name, value in (fixed or {}).items() if name in known}
        self._own_sigma = {
            name: p.sigma
            for effect in self._effects
            for p in effect.described(robot.n_tubes).parameters
            for name in p.full_names
        }
        library = recording.names_of(robot.n_tubes)
        for name in self._names:
            if name not in self._own_sigma and name not in library:
                raise InputError(Problem(f"no parameter is named {name}"))
        self._nominal = self._nominal_values(library) | dict(fixed or {})
        n = robot.n_tubes
        homes = [f"actuation.home_{kind}.{i + 1}" for kind in ("translation", "rotation") for i in range(n)]
        forces = [f"effects.tip_load.force_{axis}" for axis in "xyz"]
        # What the user's functions change acts through these.
        self._joints = homes if self._hooks.has("joints") else []
        self._forces = forces if self._hooks.has("force", "base") else []
        given = [name for name in self._names if name in library]
        self._inner = list(dict.fromkeys([*given, *self._joints, *self._forces]))
        self._active = np.ones(len(measurements), bool)
        self._hooks.check_neutral(self._nominal)
        self._reference = self._references()
        self._recording, self._inputs = None, None
        self._measured_rotation = self._rotations(measurements.quaternion)
        self._left_out = ~self._solvable()

    # ---- as a Recording

    def nominal(self) -> Array:
        """The file's values of the parameters."""
        return np.array([self._nominal[name] for name in self._names])

    def activate(self, rows: Sequence[bool]) -> None:
        """Rows to solve from now on."""
        self._active = np.array(rows, bool)

    def wind_up(self, x: Array) -> float:
        """As Recording.wind_up."""
        values = self._values(x)
        return self._prepared(values).wind_up(np.array([values[name] for name in self._inner]))

    def unsolved(self) -> list[int]:
        """Active rows that could not be solved at the last call, and those that never can."""
        return np.flatnonzero(self._active & ~self._solved).tolist()

    def predicted(self) -> tuple[Array, Array]:
        """What the tracker would read, as at the last call: position (M, 3) [m], quaternion (M, 4); NaN: not solved."""
        position, rotation = self._reading
        quaternion = np.full((len(position), 4), nan)
        good = np.isfinite(position).all(axis=1)
        if good.any():
            xyzw = Rotation.from_matrix(rotation[good]).as_quat(canonical=True)
            quaternion[good] = xyzw[:, [3, 0, 1, 2]]
        return position, quaternion

    def residual(self, x: Array, derivatives: bool = False) -> tuple[Array, Array, bool]:
        """(residual (6 M,), its derivative (6 M, n) or empty, whether every row was solved that ever can be)."""
        values = self._values(x)
        inner = self._prepared(values)
        wanted = self._active & ~self._left_out
        inner.activate(wanted.tolist())
        start, slopes, _ = inner.residual(np.array([values[name] for name in self._inner]), derivatives)
        position, quaternion = inner.predicted()
        rotation = self._rotations(quaternion)
        self._solved = wanted & np.isfinite(position).all(axis=1)
        self._reading = self._outer(position, rotation, values)
        error = self._residual(*self._reading)
        solved = bool((self._solved | ~wanted).all())
        if not derivatives:
            return error.ravel(), np.empty((0, 0)), solved
        by_pose = np.linalg.solve(_by_prediction(start.reshape(-1, 6)), slopes.reshape(len(error), 6, -1))
        total = self._totals(by_pose, position, rotation, values)
        jacobian = _by_prediction(error) @ total
        jacobian[~np.isfinite(error).any(axis=1)] = 0.0
        return error.ravel(), np.nan_to_num(jacobian).reshape(error.size, -1), solved

    # ---- before and behind the model

    def _values(self, x: Array) -> dict[str, float]:
        """Of all parameters by name, these at x."""
        return self._nominal | dict(zip(self._names, map(float, x), strict=True))

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
        options = self._options | {"profiles": profiles}
        return recording.recording_of(self._library_robot, rows, self._inner, **options)

    def _outer(self, position: Array, rotation: Array, values: dict[str, float]) -> tuple[Array, Array]:
        return self._hooks.outer(position, rotation, values, self._tracker_frame(values), self._solved)

    def _tracker_frame(self, values: dict[str, float]) -> tuple[Array, Array]:
        """Origin and axes of the base frame in the tracker frame."""
        origin = np.array([values[f"tracker.position.{axis}"] for axis in "xyz"])
        turn = np.array([values[f"tracker.rotation.{axis}"] for axis in "xyz"])
        return origin, matrix_from_rotation_vector(turn) @ self._robot.tracker.rotation

    # ---- derivatives

    def _totals(self, by_pose: Array, position: Array, rotation: Array, values: dict[str, float]) -> Array:
        """Derivatives (M, 6, n) of the reading, position and rotation vector, tracker axes."""
        place = {name: k for k, name in enumerate(self._inner)}
        total = np.zeros((len(position), 6, len(self._names)))
        ratios = self._ratios(values)
        for k, name in enumerate(self._names):
            if name in place:
                total[:, :, k] = by_pose[:, :, place[name]]
                continue
            plus, minus, width = self._two_sides(self._hooks.inputs, values, name)
            beta, alpha, force = ((a - b) / width for a, b in zip(plus, minus, strict=True))
            motions = (self._joints, np.hstack([ratios[0] * beta, ratios[1] * alpha])), (self._forces, force)
            for through, motion in motions:
                if through:
                    slopes = by_pose[:, :, [place[other] for other in through]]
                    total[:, :, k] += np.einsum("mij,mj->mi", slopes, motion)
        if self._hooks.has(*PROFILES):
            self._add_profiles(total, values)
        if not self._hooks.has("base", "reading"):
            return total
        through = np.empty((len(position), 6, 6))
        for i in range(6):
            step = settings.POSITION_STEP if i < 3 else settings.ROTATION_STEP
            shift = step * np.eye(3)[i % 3]
            sides = [
                self._outer(position + sign * shift, rotation, values)
                if i < 3
                else self._outer(position, matrix_from_rotation_vector(sign * shift) @ rotation, values)
                for sign in (1, -1)
            ]
            through[:, :, i] = _difference(*sides, 2 * step)
        total = through @ total
        for k, name in enumerate(self._names):
            if name in self._own_sigma or (name.startswith("tracker.") and self._hooks.has("base")):
                sides = self._two_sides(lambda v: self._outer(position, rotation, v), values, name)
                total[:, :, k] += _difference(*sides)
        return total

    def _add_profiles(self, total: Array, values: dict[str, float]) -> None:
        """What the profiles do, by differences of whole predictions."""
        x = np.array([values[name] for name in self._inner])
        for k, name in enumerate(self._names):
            step, sides = settings.PROFILE_STEP * self._own_sigma.get(name, 0.0), []
            for sign in (1, -1):
                moved = self._hooks.profiles(values | {name: values[name] + sign * step})
                if np.array_equal(moved, self._inputs[3]):
                    break
                other = self._recording_of((*self._inputs[:3], moved))
                other.activate(self._solved.tolist())
                other.residual(x)
                position, quaternion = other.predicted()
                sides.append((position, self._rotations(quaternion)))
            else:
                total[:, :, k] += _difference(*sides, 2 * step)

    def _two_sides(self, function, values: dict[str, float], name: str):
        """function at one parameter a little more and a little less, and the distance between."""
        step = settings.DIFFERENCE_STEP * self._own_sigma.get(name, 1e-2)
        return (*(function(values | {name: values[name] + sign * step}) for sign in (1, -1)), 2 * step)

    def _ratios(self, values: dict[str, float]) -> list[float]:
        return [
            values[name] / self._nominal[name] for name in ("actuation.translation_ratio", "actuation.rotation_ratio")
        ]

    # ---- once

    def _nominal_values(self, library: Sequence[str]) -> dict[str, float]:
        robot = self._robot
        own = {effect.id for effect in self._effects}
        rest = {identity: given for identity, given in robot.effects.items() if identity not in own}
        self._library_robot = robot.model_copy(update={"effects": rest})
        self._library_robot._source = robot._source
        values = dict(zip(library, recording.values(self._library_robot).tolist(), strict=True))
        for effect in self._effects:
            given = robot.effects.get(effect.id, {})
            for p in effect.described(robot.n_tubes).parameters:
                numbers = np.atleast_1d(given.get(p.name, p.neutral))
                numbers = np.broadcast_to(numbers, len(p.full_names)) if len(numbers) == 1 else numbers
                if len(numbers) != len(p.full_names):
                    text = f"needs {len(p.full_names)} number(s)"
                    raise InputError(Problem(text, field=f"effects.{effect.id}.{p.name}"))
                values.update(zip(p.full_names, map(float, numbers), strict=True))
        return values

    def _references(self) -> tuple[Array, Array]:
        """Poses to count from: the measured positions (where missing their centre) and predicted orientations."""
        table = self._table
        plain = recording.recording_of(self._library_robot, table, (), **self._options)
        plain.residual(np.empty(0))
        quaternion = plain.predicted()[1]
        quaternion[~np.isfinite(quaternion).all(axis=1)] = (1.0, 0.0, 0.0, 0.0)
        position = np.full((len(table), 3), nan) if table.position is None else table.position.copy()
        missing = ~np.isfinite(position).all(axis=1)
        position[missing] = 0.0 if missing.all() else position[~missing].mean(axis=0)
        return position, quaternion

    def _solvable(self) -> Mask:
        """Rows with a solution at the file's values."""
        self._left_out = np.zeros(len(self._table), bool)
        self.residual(self.nominal())
        return self._solved

    # ---- poses

    def _residual(self, position: Array, rotation: Array) -> Array:
        error = np.full((len(position), 6), nan)
        good = np.isfinite(position).all(axis=1)
        if self._table.position is not None:
            error[:, :3] = self._table.position - position
        both = good & np.isfinite(self._measured_rotation).all(axis=(1, 2))
        if both.any():
            turn = self._measured_rotation[both] @ np.swapaxes(rotation[both], 1, 2)
            error[both, 3:] = Rotation.from_matrix(turn).as_rotvec()
        error[~good] = nan
        return error

    def _rotations(self, quaternion: Array | None) -> Array:
        missing = np.full((len(self._table), 3, 3), nan)
        return missing if quaternion is None else matrix_from_quaternion(quaternion)


def _by_prediction(error: Array) -> Array:
    """Derivative (M, 6, 6) of a residual (M, 6) by the predicted pose; 1 where it is not known."""
    turn = np.nan_to_num(error[:, 3:])
    square = np.sum(turn**2, axis=1)
    half = 0.5 * np.sqrt(np.maximum(square, 1e-3))
    far = (1 - half / np.tan(half)) / (4 * half**2)
    k = np.where(square < 1e-3, 1 / 12 + square / 720 + square**2 / 30240, far)
    x, y, z = turn.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    made = np.tile(-np.eye(6), (len(error), 1, 1))
    made[:, 3:, 3:] -= 0.5 * cross + k[:, None, None] * (cross @ cross)
    return made


def _difference(plus: tuple[Array, Array], minus: tuple[Array, Array], width: float) -> Array:
    """Derivative (M, 6) between two poses, position and rotation vector."""
    made = np.zeros((len(plus[0]), 6))
    good = np.isfinite(plus[0]).all(axis=1)
    if good.any():
        made[good, :3] = (plus[0][good] - minus[0][good]) / width
        turn = plus[1][good] @ np.swapaxes(minus[1][good], 1, 2)
        made[good, 3:] = Rotation.from_matrix(turn).as_rotvec() / width
    return made
