"""The model of a robot that is moving now: it remembers the path, as effects such as friction and backlash do."""

import numpy as np
from numpy.typing import ArrayLike

from ctcr.arrays import Array
from ctcr.model import user_recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

Row = tuple[float, Array, Array]  # t, joints (2N,), force (3,)

# Places where a joint turned back: newer motion has overwritten older ones (0.2 um of the tip when it tracks), and
# each is solved anew at every reading, which must keep up with the tracker.
REMEMBERED = 60
RECENT_S = 0.5  # longer than any delay between motion and reading
SMALLEST = 1e-7  # [m], [rad]: motion below it is none
SESSION_S = 1800.0  # after which effects that grow in a session are at their full size


class MovingModel:
    """`move` as often as joints are known, `reading` when the pose is wanted. Not real-time safe: some milliseconds.

    Joints are those of the controller, as in a table of measurements. Of the path only turning points and the last
    half second are kept: between them the joints move steadily.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self._turns: list[Row] = []  # where a joint turned back, and the newest row that is not recent
        self._recent: list[Row] = []
        self._start = 0.0

    def move(self, t: float, beta: ArrayLike, alpha: ArrayLike, force: ArrayLike) -> None:
        """The joints [m], [rad] and the known tip force [N] at the time t [s], later than the last."""
        row = t, np.concatenate([beta, alpha]), np.array(force, float)
        if not self._recent:
            self._start = t
        elif t <= self._recent[-1][0]:
            return
        self._recent.append(row)
        while t - self._recent[0][0] > RECENT_S:
            self._remember(self._recent.pop(0))

    def reading(self) -> tuple[Array, Array]:
        """The present reading of the tracker without noise: position (3,) [m], quaternion (4,); NaN where unsolved."""
        t, joints, force = (np.array(column) for column in zip(*self._turns, *self._recent, strict=True))
        end = max(SESSION_S + self._start, t[-1] + 1.0)  # the session goes on behind the last row
        joints, force = (np.vstack([column, column[-1:]]) for column in (joints, force))
        table = Measurements.of_joints(*np.hsplit(joints, 2), t=np.append(t, end), force=force, from_home=False)
        model = user_recording.recording_of(self.robot, table, threads=1)
        now = np.arange(len(table)) == len(table) - 2
        model.activate(now.tolist())
        model.residual(np.empty(0))
        position, quaternion = model.predicted()
        return position[-2], quaternion[-2]

    def _remember(self, row: Row) -> None:
        turns = self._turns
        if len(turns) >= 2 and not _turns_back(*turns[-2:], row):
            turns[-1] = row
        else:
            turns.append(row)
            del turns[: max(0, len(turns) - REMEMBERED)]


def _turns_back(first: Row, middle: Row, last: Row) -> bool:
    """Whether a joint turns back at the middle row, or the force changes after it."""
    came, goes = middle[1] - first[1], last[1] - middle[1]
    moved = (np.abs(came) > SMALLEST) & (np.abs(goes) > SMALLEST)
    return bool((moved & (came * goes < 0)).any()) or not np.array_equal(middle[2], last[2])
