"""What stands between the joints wanted and the joints had."""

import numpy as np


class Play:
    """Backlash: the output rests while the input crosses a gap, whose sides need not be equal."""

    def __init__(self, joint: np.ndarray, below: np.ndarray, above: np.ndarray) -> None:
        """Acts on the joints with these numbers; the input may lie `below` under or `above` over the output."""
        self._joint, self._below, self._above = joint, below, above
        self._output: np.ndarray | None = None

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        wanted = joints[self._joint]
        last = wanted if self._output is None else self._output
        self._output = np.clip(last, wanted - self._above, wanted + self._below)
        return _replaced(joints, self._joint, self._output)


class StickSlip:
    """The output sticks until the input is a gap away, then jumps to it."""

    def __init__(self, joint: np.ndarray, gap: np.ndarray) -> None:
        self._joint, self._gap = joint, gap
        self._output: np.ndarray | None = None

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        wanted = joints[self._joint]
        last = wanted if self._output is None else self._output
        self._output = np.where(np.abs(wanted - last) > self._gap, wanted, last)
        return _replaced(joints, self._joint, self._output)


class Periodic:
    """An error that returns with every turn of the drive: amplitudes of the first and second harmonic."""

    def __init__(
        self, joint: np.ndarray, per_turn: float, first: np.ndarray, second: np.ndarray, phase: np.ndarray
    ) -> None:
        """`per_turn` is how far the joint moves while the error comes back once."""
        self._joint, self._per_turn, self._first, self._second = joint, per_turn, first, second
        self._phase = phase

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        wanted = joints[self._joint]
        angle = 2 * np.pi * wanted / self._per_turn + self._phase
        error = self._first * np.sin(angle) + self._second * np.sin(2 * angle + 1.0)
        return _replaced(joints, self._joint, wanted + error)


class Coupling:
    """Rotation picked up with translation, as from a guide that is not straight."""

    def __init__(self, home: np.ndarray, gain: np.ndarray) -> None:
        """Grasp positions (N,) [m] without effect; gains (N,) [rad/m]."""
        self._home, self._gain = home, gain

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        n = self._home.size
        return np.concatenate([joints[:n], joints[n:] + self._gain * (joints[:n] - self._home)])


class Slipped:
    """A grip that slips once: after a number of calls the joint stays off."""

    def __init__(self, joint: int, offset: float, at: np.ndarray) -> None:
        """Slips by `offset` when the wanted joints first come to `at` (2N,)."""
        self._joint, self._offset, self._at, self._slipped = joint, offset, at, False

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        self._slipped = self._slipped or np.array_equal(joints, self._at)
        return _replaced(joints, self._joint, joints[self._joint] + self._offset * self._slipped)


class Ratio:
    """A transmission ratio that is not the described one."""

    def __init__(self, joint: np.ndarray, excess: np.ndarray) -> None:
        self._joint, self._excess = joint, excess

    def __call__(self, joints: np.ndarray) -> np.ndarray:
        wanted = joints[self._joint]
        return _replaced(joints, self._joint, (1 + self._excess) * wanted)


def _replaced(joints: np.ndarray, where: np.ndarray | int, values: np.ndarray | float) -> np.ndarray:
    joints = joints.copy()
    joints[where] = values
    return joints
