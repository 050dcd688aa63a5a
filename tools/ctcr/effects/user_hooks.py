"""The functions of users' effects, called together, with checks of their answers: see `user_effects`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ctcr.arrays import Array, Mask
from ctcr.effects.user_effects import Effect, Rows
from ctcr.errors import InputError, Problem
from ctcr.frames import matrix_from_rotation_vector
from ctcr.robot.description import Robot

Values = Mapping[str, float]  # of all parameters by full name

PROFILES = ("curvature", "stiffness")
NODES = 201  # of a profile along a tube, linear between them
NOTHING = 1e-12  # largest change by an effect at its neutral values [m], [rad], [N]


class Hooks:
    """All functions of some effects together, on the rows of one table.

    Raises InputError where one fails, returns a wrong shape or kind, or acts at its neutral values.
    """

    def __init__(self, robot: Robot, rows: Rows, own_effects: Sequence[Effect]):
        self.robot, self.rows, self.effects = robot, rows, list(own_effects)

    def has(self, *hooks: str) -> bool:
        return any(hook in effect.hooks for effect in self.effects for hook in hooks)

    def inputs(self, values: Values) -> tuple[Array, Array, Array]:
        """Joints (M, N) [m], [rad] and force (M, 3) [N] for the model."""
        rows, shape = self.rows, self.rows.beta.shape
        beta, alpha, force = rows.beta.copy(), rows.alpha.copy(), rows.force.copy()
        for effect, given in self._with("joints", values):
            new = _pair(effect, "joints", effect.call("joints", rows, given), shape, shape)
            beta += new[0] - rows.beta
            alpha += new[1] - rows.alpha
        for effect, given in self._with("force", values):
            force += _array(effect, "force", effect.call("force", rows, given), force.shape)
        for _, turn in self._bases(values):
            force = np.einsum("mji,mj->mi", turn, force)
        return beta, alpha, force

    def profiles(self, values: Values) -> Array | None:
        """Profiles (NODES, 3 N) along the tubes, as `recording.recording_of` takes them; None without any."""
        if not self.has(*PROFILES):
            return None
        made = np.zeros((NODES, self.robot.n_tubes, 3))
        for i, tube in enumerate(self.robot.tubes):
            along = np.linspace(0.0, tube.length, NODES)
            for effect, given in self._with("curvature", values):
                answer = effect.call("curvature", i + 1, along.copy(), given)
                made[:, i, :2] += _array(effect, "curvature", answer, (NODES, 2))
            for effect, given in self._with("stiffness", values):
                answer = effect.call("stiffness", i + 1, along.copy(), given)
                factor = _array(effect, "stiffness", answer, (NODES,))
                if (factor <= 0).any():
                    raise InputError(Problem("returned a factor that is not above 0", field=f"{effect.id}.stiffness"))
                made[:, i, 2] = (1 + made[:, i, 2]) * factor - 1
        return made.reshape(NODES, -1)

    def outer(
        self, position: Array, rotation: Array, values: Values, frame: tuple[Array, Array], solved: Mask
    ) -> tuple[Array, Array]:
        """Pose (M, 3) [m], (M, 3, 3) that the tracker reads; `frame`: origin and axes of the base frame."""
        origin, axes = frame
        for shift, turn in self._bases(values):
            turning = axes @ turn @ axes.T
            position = np.einsum("mij,mj->mi", turning, position - origin) + shift @ axes.T + origin
            rotation = turning @ rotation
        for effect, given in self._with("reading", values):
            answer = effect.call("reading", position.copy(), rotation.copy(), self.rows, given)
            position, rotation = _pair(effect, "reading", answer, position.shape, rotation.shape, ~solved)
        return position, rotation

    def check_neutral(self, values: Values) -> None:
        """Raises InputError for an effect that acts at neutral amplitudes."""
        count = len(self.rows.run)
        position, rotation = np.full((count, 3), 0.1), np.tile(np.eye(3), (count, 1, 1))
        frame, everywhere = (np.zeros(3), np.eye(3)), np.ones(count, bool)
        before = (self.rows.beta, self.rows.alpha, self.rows.force, position, rotation, 0.0)
        names = ("beta", "alpha", "the force", "the position", "the orientation", "a tube")
        for effect in self.effects:
            alone = Hooks(self.robot, self.rows, [effect])
            amplitudes = [p for p in effect.described(self.robot.n_tubes).parameters if p.kind == "amplitude"]
            neutral = dict(values) | {name: p.neutral for p in amplitudes for name in p.full_names}
            profiles = alone.profiles(neutral)
            outer = alone.outer(position, rotation, neutral, frame, everywhere)
            after = (*alone.inputs(neutral), *outer, 0.0 if profiles is None else profiles)
            for what, old, new in zip(names, before, after, strict=True):
                change = float(np.max(np.abs(new - old), initial=0.0))
                if change > NOTHING:
                    text = f"changes {what} by {change:.2g} at its neutral values, where it must change nothing"
                    raise InputError(Problem(text, field=effect.id))

    def _with(self, hook: str, values: Values):
        """The effects that have a hook, with the values for it."""
        for effect in self.effects:
            if hook in effect.hooks:
                yield effect, effect.values(self.robot.n_tubes, values)

    def _bases(self, values: Values) -> list[tuple[Array, Array]]:
        """Position (M, 3) and rotation (M, 3, 3) that each effect gives the base."""
        shape, found = self.rows.force.shape, []
        for effect, given in self._with("base", values):
            position, turn = _pair(effect, "base", effect.call("base", self.rows, given), shape, shape)
            found.append((position, matrix_from_rotation_vector(turn)))
        return found


def _pair(effect: Effect, hook: str, answer: Any, first: tuple, second: tuple, free: Mask | None = None):
    if not isinstance(answer, tuple | list) or len(answer) != 2:
        raise InputError(Problem(f"must return two arrays, of shape {first} and {second}", field=f"{effect.id}.{hook}"))
    return _array(effect, hook, answer[0], first, free), _array(effect, hook, answer[1], second, free)


def _array(effect: Effect, hook: str, answer: Any, shape: tuple, free: Mask | None = None) -> Array:
    """The answer of a hook as numbers of this shape, finite but in `free` rows."""
    where = f"{effect.id}.{hook}"
    try:
        array = np.asarray(answer, dtype=float)
    except (TypeError, ValueError):
        raise InputError(Problem("must return arrays of numbers", field=where)) from None
    if array.shape != shape:
        raise InputError(Problem(f"returned an array of shape {array.shape}, but it must be {shape}", field=where))
    bad = ~np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    bad = bad if free is None else bad & ~free
    if bad.any():
        which = int(np.flatnonzero(bad)[0])
        first = f"sample {which + 1} along the tube" if hook in PROFILES else f"row {which + 2}"
        raise InputError(Problem(f"returned a number that is not finite, first in {first}", field=where))
    return array
