"""The kinetostatic model of a robot: poses, derivatives and shapes from joints and tip loads."""

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr import _core
from ctcr.arguments import checked
from ctcr.arrays import Array, Mask
from ctcr.effects import catalogue
from ctcr.errors import ArgumentError, InputError, Problem, shown
from ctcr.frames import product
from ctcr.model import parameters as free_parameters
from ctcr.model import recording
from ctcr.model.effect_model import of_the_path, of_the_poses
from ctcr.robot.description import Robot
from ctcr.show.result import Glance, Shown, frame

if TYPE_CHECKING:
    from pandas import DataFrame

POSE_COLUMNS = ("pred_x_m", "pred_y_m", "pred_z_m", "pred_qw", "pred_qx", "pred_qy", "pred_qz")
SHOWN = 5  # rows at a glance
UNITS = {"beta": "m", "alpha": "rad", "force": "N", "moment": "N m"}
INTEGRATORS = {
    "default": _core.Integrator.standard,
    "ssprk3": _core.Integrator.ssp_rk3,
    "rk4": _core.Integrator.classical_rk4,
    "rk8": _core.Integrator.prince_dormand8,
}


@dataclass(frozen=True, repr=False)
class Prediction(Shown):
    """The predicted poses of M configurations, in the base frame unless asked for in another. NaN where there is no
    solution: `why` says why."""

    position: Array  # (M, 3) [m], tip of the tube that carries the sensor
    quaternion: Array  # (M, 4), w first and not negative
    status: NDArray[np.uint8]  # (M,), 0: solved; `status_text` says what the others mean
    stability: Array  # (M,), 1 without interaction between tubes, 0 where the robot snaps
    jacobian: Array | None  # (M, 6, 2N), rows: velocity [m], turn [rad]; columns: beta [m], alpha [rad]
    compliance: Array | None  # (M, 6, 6), rows as above; columns: force [N] and moment [N m] at the robot tip
    by_parameters: Array | None = None  # (M, 6, P), rows as above; columns: `Model.parameters`, SI

    @property
    def solved(self) -> Mask:
        """Which rows have a trustworthy answer (M,)."""
        return self.status == 0

    @property
    def why(self) -> list[str]:
        """Of each row: "ok", or why it has no answer."""
        text = {int(code): status_text(int(code)) for code in np.unique(self.status)}
        return [text[code] for code in self.status.tolist()]

    def to_frame(self) -> "DataFrame":
        """A row a configuration: the pose in the columns of `ctcr predict`, and in `status` why there is none."""
        poses = np.hstack([self.position, self.quaternion])
        return frame(dict(zip(POSE_COLUMNS, poses.T, strict=True)) | {"status": self.why})

    def glance(self) -> Glance:
        count, failed = len(self.status), Counter(text for text in self.why if text != SOLVED)
        line = f"Prediction: {count} configurations, {count - failed.total()} solved"
        rows = [
            [str(i + 1), *(f"{1e3 * x:.3f}" for x in self.position[i]), why] for i, why in enumerate(self.why[:SHOWN])
        ]
        notes = [f"not solved: {number}, {text}" for text, number in failed.most_common()]
        notes += [f"and {count - SHOWN} more configurations"] if count > SHOWN else []
        return Glance(line, ["", "x, mm", "y, mm", "z, mm", "status"], rows, notes)


@dataclass(frozen=True, repr=False)
class Shape(Shown):
    """The robot from the front plate to its tip at K arc lengths: uniform ones and every breakpoint.

    Frames do not twist along the robot: at the plate they are the base frame, and tube i stands at `tube_angle[i]`
    about their z axis, the tangent. Where curvatures jump the values are those of the base side.
    """

    stability: float  # 1 without interaction between tubes, 0 where the robot snaps
    arc_length: Array  # (K,) [m], from the front plate
    position: Array  # (K, 3) [m], base frame
    quaternion: Array  # (K, 4), w first and not negative
    internal_force: Array  # (K, 3) [N], of all tubes together, base frame
    internal_moment: Array  # (K, 3) [N m], the same
    tube_angle: Array  # (N, K) [rad]; this and all below: NaN where the tube is absent
    tube_curvature: Array  # (N, K, 3) [1/m], bending x, y and twist z, in the tube's own frame
    tube_moment: Array  # (N, K, 3) [N m], in the tube's own frame

    def position_at(self, arc_length: ArrayLike) -> Array:
        """Positions (..., 3) [m] in the base frame at arc lengths (...) [m], linear between the K."""
        return np.stack([np.interp(arc_length, self.arc_length, axis) for axis in self.position.T], axis=-1)

    def tube_quaternion(self, tube: int) -> Array:
        """Material frame of a tube (0: innermost) at each arc length (K, 4); NaN where it is not there."""
        half = self.tube_angle[tube] / 2
        about_z = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
        return product(self.quaternion, about_z)

    def glance(self) -> Glance:
        long = f"{1e3 * self.arc_length[-1]:.1f} mm long at {len(self.arc_length)} arc lengths"
        return Glance(f"Shape: {len(self.tube_angle)} tubes, {long}, stability {self.stability:.2f}")


def status_text(code: int) -> str:
    """The meaning of a prediction's status code, in plain words."""
    return _core.status_text(_core.Status(code))


SOLVED = status_text(0)


class Model:
    """Model of a robot. `steps` is a factor on the integration steps of every segment: more is finer and slower.

    `integrator` is one of INTEGRATORS; those beside the default serve to compare, give poses alone and take `steps` in
    every segment.
    Joints are `beta` [m], <= 0, where each tube is grasped, and `alpha` [rad], the angle of its base; innermost tube
    first. Loads act at the robot tip: `force` [N] and `moment` [N m], base frame. Arrays of other types than float64
    are converted. A robot's effects (see `effects.catalogue`) act on poses, derivatives and shapes, but for those
    of the tracker: poses are those of the tube. Raises ValueError where shapes do not fit, and InputError where the
    robot has effects that depend on the path, which single configurations do not have: see `table_poses.predict`.
    """

    @checked
    def __init__(self, robot: Robot, *, steps: int = 1, integrator: str = "default"):
        if integrator not in INTEGRATORS:
            raise ValueError(f"integrator must be one of {', '.join(INTEGRATORS)}, not {integrator!r}")
        self.robot = robot
        self.steps = steps
        self.integrator = integrator
        acting = _acting(robot, integrator)
        self._effects = [name for identity in acting for name in catalogue.get(identity, robot.n_tubes).names()]
        own = [name for name in free_parameters.names_of(robot.n_tubes) if name.startswith(("tubes.", "gravity."))]
        self._core = _core.Model(
            robot.n_tubes,
            free_parameters.values(robot, own),
            catalogue.values(robot.with_effects(acting)) if acting else None,
        )

    def predict(
        self,
        beta: ArrayLike,
        alpha: ArrayLike,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        *,
        derivatives: bool = False,
        by_parameters: bool = False,
        threads: int = 0,
    ) -> Prediction:
        """Solves M configurations: `beta` and `alpha` (M, N); loads (M, 3), or (3,) for all, or None.

        Neighbouring rows that differ little (a path) are solved faster. The answers do not depend on `threads`
        (0: all cores). `derivatives` adds the Jacobian and the compliance of the pose; `by_parameters` these and the
        derivatives by the `parameters`, for motors that stand still. All are exact derivatives of the poses returned.
        """
        n = self.robot.n_tubes
        beta, alpha = (_array(name, q, n, rows=True) for name, q in (("beta", beta), ("alpha", alpha)))
        rows = len(beta)
        if len(alpha) != rows:
            raise _wrong_shape("alpha", f"({rows}, {n})", alpha)
        own = [name for name in self.parameters if not name.startswith("actuation.")] if by_parameters else []
        known = recording.names_of(n)
        *pose, jacobian, compliance, by_own = self._core.predict(
            beta=beta,
            alpha=alpha,
            force=_load("force", force, rows),
            moment=_load("moment", moment, rows),
            integrator=INTEGRATORS[self.integrator],
            steps=self.steps,
            tip_of=self.robot.tracker.sensor_on_tube - 1,
            threads=threads,
            derivatives=derivatives or by_parameters,
            by_parameters=[known.index(name) for name in own],
        )
        if not (derivatives or by_parameters):
            return Prediction(*pose, jacobian=None, compliance=None)
        jacobian = jacobian.reshape(rows, 6, 2 * n)
        by = self._with_motors(by_own.reshape(rows, 6, len(own)), jacobian, beta, alpha) if by_parameters else None
        return Prediction(*pose, jacobian, compliance.reshape(rows, 6, 6), by)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that the pose depends on, base frame: tubes, gravity, motors and effects."""
        names = free_parameters.names_of(self.robot.n_tubes)
        return (*(name for name in names if not name.startswith("tracker.")), *self._effects)

    def _with_motors(self, by_own: Array, jacobian: Array, beta: Array, alpha: Array) -> Array:
        """Derivatives by all parameters (M, 6, P): q = rho theta + Delta, and theta stays."""
        by_robot, by_effects = np.split(by_own, [by_own.shape[2] - len(self._effects)], axis=2)
        columns = [by_robot]
        motions = ("translation", beta), ("rotation", alpha)
        for (kind, q), by in zip(motions, np.split(jacobian, 2, axis=2), strict=True):
            names = [f"actuation.home_{kind}.{i + 1}" for i in range(self.robot.n_tubes)]
            *home, ratio = free_parameters.values(self.robot, [*names, f"actuation.{kind}_ratio"])
            columns.append(np.einsum("mij,mj->mi", by, (q - home) / ratio)[:, :, None])
        return np.concatenate([*columns, jacobian, by_effects], axis=2)

    def shape(
        self,
        beta: ArrayLike,
        alpha: ArrayLike,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        *,
        points: int = 200,
    ) -> Shape:
        """The shape at one configuration: `beta` and `alpha` (N,), loads (3,) or None; `points` uniform arc lengths.

        Integrated finely with the default integrator, whatever `steps`. Raises ValueError where there is no solution.
        """
        [shape] = self._shapes(beta, alpha, force, moment, points, every=False)
        return shape

    def all_shapes(
        self,
        beta: ArrayLike,
        alpha: ArrayLike,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        *,
        points: int = 200,
    ) -> list[Shape]:
        """The shapes in which the robot may rest at one configuration, as `shape`: that one first, then those of the
        other stable equilibria that starts scattered over all angles reach. Empty where none is found."""
        return self._shapes(beta, alpha, force, moment, points, every=True)

    def _shapes(self, beta, alpha, force, moment, points: int, *, every: bool) -> list[Shape]:
        n = self.robot.n_tubes
        found = self._core.shapes(
            beta=_array("beta", beta, n)[None],
            alpha=_array("alpha", alpha, n)[None],
            force=None if force is None else _array("force", force, 3)[None],
            moment=None if moment is None else _array("moment", moment, 3)[None],
            points=points,
            steps=self.steps,
            all=every,
        )
        shapes = []
        for status, stability, arc_length, *along_the_robot, curvature, tube_moment in found:
            if status not in (_core.Status.ok, _core.Status.singular):
                raise ValueError(f"no shape at these joints: {_core.status_text(status)}")
            by_tube = (n, len(arc_length), 3)
            tubes = curvature.reshape(by_tube), tube_moment.reshape(by_tube)
            shapes.append(Shape(stability, arc_length, *along_the_robot, *tubes))
        return shapes


def _acting(robot: Robot, integrator: str) -> dict[str, Any]:
    """The effects of a robot that act on single poses. Raises InputError where a model cannot take them."""
    if robot.effects and integrator != "default":
        raise InputError(Problem(f"effects are integrated with the default integrator, not with {integrator}"))
    if path := of_the_path(robot):
        text = (
            f"a model solves configurations one by one, but the effects {', '.join(path)} need the rows in their "
            "order: use `ctcr predict`, or ctcr.predict(robot, table)"
        )
        raise InputError(Problem(text))
    return of_the_poses(robot)


def _array(name: str, values: ArrayLike, last: int, rows: bool = False) -> Array:
    """The values as an array (last,), or with `rows` (M, last)."""
    array = _numbers(name, values)
    if array.ndim != 1 + rows or array.shape[-1] != last:
        raise _wrong_shape(name, f"(M, {last})" if rows else f"({last},)", array)
    return np.ascontiguousarray(array)


def _load(name: str, values: ArrayLike | None, rows: int) -> Array | None:
    if values is None:
        return None
    array = _numbers(name, values)
    if array.shape not in ((3,), (rows, 3)):
        raise _wrong_shape(name, f"({rows}, 3) or (3,)", array)
    return np.ascontiguousarray(np.broadcast_to(array, (rows, 3)))


def _numbers(name: str, values: ArrayLike) -> Array:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        text = f"{shown(values)} is no array of numbers in {UNITS[name]}"
        raise ArgumentError(Problem(text, field=name)) from None


def _wrong_shape(name: str, wanted: str, array: Array) -> ArgumentError:
    return ArgumentError(Problem(f"must have the shape {wanted}, in {UNITS[name]}, not {array.shape}", field=name))
