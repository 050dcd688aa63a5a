"""The kinetostatic model of a robot: poses, derivatives and shapes from joints and tip loads."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ctcr import _core
from ctcr.errors import InputError, Problem
from ctcr.frames import product
from ctcr.model import effect_model
from ctcr.model import parameters as free_parameters
from ctcr.robot.description import Robot

Array = NDArray[np.float64]

INTEGRATORS = {
    "default": _core.Integrator.standard,
    "ssprk3": _core.Integrator.ssp_rk3,
    "rk4": _core.Integrator.classical_rk4,
    "rk8": _core.Integrator.prince_dormand8,
}


@dataclass(frozen=True)
class Prediction:
    """What the model says of M configurations, base frame. NaN where there is no solution."""

    position: Array  # (M, 3) [m], tip of the tube that carries the sensor
    quaternion: Array  # (M, 4), w first and not negative
    status: NDArray[np.uint8]  # (M,), 0: solved; `status_text` says what the others mean
    stability: Array  # (M,), 1 without interaction between tubes, 0 where the robot snaps; NaN with effects
    jacobian: Array | None  # (M, 6, 2N), rows: velocity [m], turn [rad]; columns: beta [m], alpha [rad]
    compliance: Array | None  # (M, 6, 6), rows as above; columns: force [N] and moment [N m] at the robot tip
    by_parameters: Array | None = None  # (M, 6, P), rows as above; columns: `Model.parameters`, SI

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Which rows have a trustworthy answer (M,)."""
        return self.status == 0


@dataclass(frozen=True)
class Shape:
    """The robot from the front plate to its tip at K places: uniform ones and every breakpoint.

    Frames do not twist along the robot: at the plate they are the base frame, and tube i stands at `tube_angle[i]`
    about their z axis, the tangent. Where curvatures jump the values are those of the base side.
    """

    arc_length: Array  # (K,) [m], from the front plate
    position: Array  # (K, 3) [m], base frame
    quaternion: Array  # (K, 4), w first and not negative
    internal_force: Array  # (K, 3) [N], of all tubes together, base frame
    internal_moment: Array  # (K, 3) [N m], the same
    tube_angle: Array  # (N, K) [rad]; this and what follows is NaN where the tube is not there
    tube_curvature: Array  # (N, K, 3) [1/m], bending x, y and twist z, in the tube's own frame
    tube_moment: Array  # (N, K, 3) [N m], in the tube's own frame

    def tube_quaternion(self, tube: int) -> Array:
        """Material frame of a tube (0: innermost) at each place (K, 4); NaN where it is not there."""
        half = self.tube_angle[tube] / 2
        about_z = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
        return product(self.quaternion, about_z)


def status_text(code: int) -> str:
    """What a status code of a prediction means, in plain words."""
    return _core.status_text(_core.Status(code))


class Model:
    """Model of a robot. `steps` integration steps per segment: more is finer and slower.

    `integrator` is one of INTEGRATORS; those beside the default serve to compare and give poses alone.
    Joints are `beta` [m], <= 0, where each tube is grasped, and `alpha` [rad], the angle of its base; innermost tube
    first. Loads act at the robot tip: `force` [N] and `moment` [N m], base frame. Arrays of other types than float64
    are converted. A robot's effects (see `effects.catalogue`) act on the poses, but for those of the tracker: poses are
    those of the tube. Raises ValueError where shapes do not fit, and InputError where a robot's effects cannot be used:
    those that depend on the path, of which single configurations know nothing.
    """

    def __init__(self, robot: Robot, *, steps: int = 1, integrator: str = "default"):
        if integrator not in INTEGRATORS:
            raise ValueError(f"integrator must be one of {', '.join(INTEGRATORS)}, not {integrator!r}")
        self.robot = robot
        self.steps = steps
        self._effects = effect_model.usable(robot, integrator) if robot.effects else {}
        self.integrator = integrator
        self._core = _core.Model(**robot.core_parameters())

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
        beta, alpha = _rows("beta", beta, n), _rows("alpha", alpha, n)
        rows = len(beta)
        derivatives = derivatives or by_parameters
        own = sum(name.startswith(("tubes.", "gravity.")) for name in self.parameters)
        answer = Prediction(
            position=np.empty((rows, 3)),
            quaternion=np.empty((rows, 4)),
            status=np.empty(rows, np.uint8),
            stability=np.empty(rows),
            jacobian=np.empty((rows, 6, 2 * n)) if derivatives else None,
            compliance=np.empty((rows, 6, 6)) if derivatives else None,
            by_parameters=np.empty((rows, 6, own)) if by_parameters else None,
        )
        if self._effects:
            if derivatives or moment is not None:
                text = (
                    f"with the effects {', '.join(self._effects)} a model gives poses under forces, neither "
                    "derivatives nor poses under moments"
                )
                raise InputError(Problem(text))
            loads = _load("force", force, rows)
            options = {"steps": self.steps, "threads": threads}
            effect_model.predict(self.robot, self._effects, beta, alpha, loads, answer, **options)
            return answer
        self._core.predict(
            beta=beta,
            alpha=alpha,
            force=_load("force", force, rows),
            moment=_load("moment", moment, rows),
            integrator=INTEGRATORS[self.integrator],
            steps=self.steps,
            tip_of=self.robot.tracker.sensor_on_tube - 1,
            threads=threads,
            **vars(answer),
        )
        return replace(answer, by_parameters=self._with_motors(answer, beta, alpha)) if by_parameters else answer

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that the pose depends on, base frame: tubes, gravity and motors."""
        names = free_parameters.names_of(self.robot.n_tubes)
        return tuple(name for name in names if not name.startswith("tracker."))

    def _with_motors(self, answer: Prediction, beta: Array, alpha: Array) -> Array:
        """Derivatives by all parameters (M, 6, P): q = rho theta + Delta, and theta stays."""
        columns = [answer.by_parameters]
        motions = ("translation", beta), ("rotation", alpha)
        for (kind, q), by in zip(motions, np.split(answer.jacobian, 2, axis=2), strict=True):
            names = [f"actuation.home_{kind}.{i + 1}" for i in range(self.robot.n_tubes)]
            *home, ratio = free_parameters.values(self.robot, [*names, f"actuation.{kind}_ratio"])
            columns.append(np.einsum("mij,mj->mi", by, (q - home) / ratio)[:, :, None])
        return np.concatenate([*columns, answer.jacobian], axis=2)

    def shape(
        self,
        beta: ArrayLike,
        alpha: ArrayLike,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        *,
        points: int = 200,
    ) -> Shape:
        """The shape at one configuration: `beta` and `alpha` (N,), loads (3,) or None; `points` uniform places.

        Integrated finely with the default integrator, whatever `steps`. Raises ValueError where there is no solution.
        """
        if self._effects:
            text = (
                "the shape along the robot is known of the standard model alone, and this robot has the effects "
                f"{', '.join(self._effects)}"
            )
            raise InputError(Problem(text))
        n = self.robot.n_tubes
        room = points + 2 * n  # there are two breakpoints a tube
        shape = Shape(
            arc_length=np.empty(room),
            position=np.empty((room, 3)),
            quaternion=np.empty((room, 4)),
            internal_force=np.empty((room, 3)),
            internal_moment=np.empty((room, 3)),
            tube_angle=np.empty((n, room)),
            tube_curvature=np.empty((n, room, 3)),
            tube_moment=np.empty((n, room, 3)),
        )
        status, count = self._core.shape(
            beta=_vector("beta", beta, n),
            alpha=_vector("alpha", alpha, n),
            force=_vector("force", (0, 0, 0) if force is None else force, 3),
            moment=_vector("moment", (0, 0, 0) if moment is None else moment, 3),
            points=points,
            steps=self.steps,
            **vars(shape),
        )
        if status not in (_core.Status.ok, _core.Status.singular):
            raise ValueError(f"no shape at these joints: {_core.status_text(status)}")
        used = {
            name: value[:, :count] if name.startswith("tube") else value[:count] for name, value in vars(shape).items()
        }
        return Shape(**used)


def _vector(name: str, values: ArrayLike, size: int) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != (size,):
        raise ValueError(f"{name} must have the shape ({size},), not {array.shape}")
    return array


def _rows(name: str, values: ArrayLike, columns: int) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} must have the shape (M, {columns}), not {array.shape}")
    return array


def _load(name: str, values: ArrayLike | None, rows: int) -> Array | None:
    if values is None:
        return None
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((3,), (rows, 3)):
        raise ValueError(f"{name} must have the shape ({rows}, 3) or (3,), not {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, (rows, 3)))
