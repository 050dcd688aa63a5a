"""Motion that a table of measurements leaves out, which matters to effects with history.

To measure at the same joints again, a robot is often driven past them first, so that it comes from the same side as
before, and only the reading is recorded. By the table it came from the other side.
"""

from dataclasses import replace

import numpy as np
import scipy  # not scipy.stats, which takes half a second: scipy loads it when it is asked for

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.robot.description import Robot
from ctcr.show.wording import listed
from ctcr.table.measurements import Measurements


def completed(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table with rows without a pose for motion that it leaves out, and a notice if there are any.

    A reading at the end of a long step, whose joints were visited from both sides before in its run, agrees with one
    of these two visits, wherever they differ. If the readings agree with the visits from the other side than that of
    the recorded motion, the robot followed the path of these visits from its last turn on. This compares
    readings, not a model; by a signed-rank test, as a reading that fits neither visit well says little.
    """
    jitter, returns = robot.tracker.jitter_mm, _returns(measurements)
    if measurements.position is None or not jitter or not returns:
        return measurements, []
    here, same, other, turn = np.array(returns).T
    p = measurements.position
    noise = np.sqrt(6) * 1e-3 * jitter
    loop = p[other] - p[same]
    size = np.sum(loop**2, axis=1)
    visible = (np.sqrt(size) > settings.VISITS_DIFFER * noise) & np.isfinite(p[here]).all(axis=1)
    nearer = (np.linalg.norm(p[here] - p[same], axis=1) - np.linalg.norm(p[here] - p[other], axis=1))[visible]
    if 2 * np.count_nonzero(nearer > 0) <= len(nearer):  # the usual case needs no test
        return measurements, []
    if scipy.stats.wilcoxon(nearer, alternative="greater").pvalue > settings.SIGNIFICANCE:
        return measurements, []
    apart = [1e3 * float(np.median(np.linalg.norm(p[here] - p[visit], axis=1)[visible])) for visit in (other, same)]
    notice = (
        f"{len(here)} readings return to joints after a long step (rows {listed(measurements.row[here])}). They are "
        f"{apart[0]:.2f} mm from the earlier visit that came from the opposite direction, and {apart[1]:.2f} mm from "
        "the one that came from the recorded direction: the robot moved in between without a reading. They get the "
        "path of the former"
    )
    return _with_detours(measurements, here, turn), [notice]


def _returns(m: Measurements) -> list[tuple[int, int, int, int]]:
    """Rows that return after a long step, with three earlier rows for each.

    These are the last visit from the same side, the last one from the other side, and the turn before the latter.
    """
    q, found = m.joint_space, []
    for run in np.unique(m.run):
        rows = np.flatnonzero(m.run == run)
        step, pause = np.diff(q[rows], axis=0), np.diff(m.t[rows])
        length = np.linalg.norm(step, axis=1)
        if not (length > 0).any():
            continue
        usual = np.median(length[length > 0])
        towards = step / np.maximum(length, 1e-12)[:, None]
        long = (length > settings.LONG_STEP * usual) | (pause > settings.LONG_STEP * np.median(pause))
        for n in np.flatnonzero(long & (length > 0)) + 1:
            near = np.linalg.norm(q[rows[1:n]] - q[rows[n]], axis=1) < settings.SAME_JOINTS * usual
            visits = np.flatnonzero(near) + 1
            cosine = towards[visits - 1] @ towards[n - 1]
            same, other = visits[cosine > settings.SAME_SIDE], visits[cosine < -settings.SAME_SIDE]
            if len(same) and len(other):
                found.append((rows[n], rows[same[-1]], rows[other[-1]], rows[_turn(towards, other[-1])]))
    return found


def _turn(towards: Array, visit: int) -> int:
    """Where the straight path to a visit begins."""
    start = visit - 1
    while start > 0 and towards[start - 1] @ towards[visit - 1] > settings.STRAIGHT_ON:
        start -= 1
    return start


def _with_detours(m: Measurements, rows: Integers, turn: Integers) -> Measurements:
    """The table with a row in front of each of `rows` that has the joints of the row `turn` and no pose."""
    columns = {
        "t": 0.5 * (m.t[rows - 1] + m.t[rows]),
        "run": m.run[rows],
        "beta": m.beta[turn],
        "alpha": m.alpha[turn],
        "force": m.force[rows],
        "position": np.nan,
        "quaternion": np.nan,
        "row": m.row[rows - 1],
    }
    old = {name: getattr(m, name) for name in columns if getattr(m, name) is not None}
    return replace(m, **{name: np.insert(values, rows, columns[name], axis=0) for name, values in old.items()})
