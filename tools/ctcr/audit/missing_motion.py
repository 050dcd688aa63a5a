"""Motion that a table of measurements leaves out, seen by effects that remember it.

Whoever returns to joints to measure them again often drives past them first, to come from the same side as before, and
records the reading alone. By the table the robot came from the other side.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from ctcr import settings
from ctcr.robot.description import Robot
from ctcr.show.output import listed
from ctcr.table.joint_space import joint_places
from ctcr.table.measurements import Measurements

Array = NDArray[np.float64]

SHOWN = 6


def completed(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """The table with the joints that the robot must have passed, as rows without a pose, and what to say about them.

    A reading at the end of a long step that was visited from both sides before in its run agrees with one of these
    two visits, wherever they differ. If it is always the one from the other side than that of the recorded motion, the
    robot came on the way of that visit: straight from where it last turned. Compares readings, not a model.
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
    part = np.sum((p[here] - p[same]) * loop, axis=1)[visible] / size[visible]
    agree = int(np.sum(part > 0.5))
    if not visible.any() or binomtest(agree, len(part), alternative="greater").pvalue > settings.DETOUR_SIGNIFICANCE:
        return measurements, []
    apart = [1e3 * float(np.median(np.linalg.norm(p[here] - p[visit], axis=1)[visible])) for visit in (other, same)]
    rows = listed(measurements.row[here], SHOWN)
    said = (
        f"{len(here)} readings return to joints after a long step (rows {rows}). They agree with the "
        f"earlier visit from the other side than that of the recorded motion ({apart[0]:.2f} mm apart, the other one "
        f"{apart[1]:.2f} mm): the robot moved in between without a reading. They are taken as reached on the way of "
        "that visit"
    )
    return _with_way(measurements, dict(zip(here.tolist(), turn.tolist(), strict=True))), [said]


def _returns(m: Measurements) -> list[tuple[int, int, int, int]]:
    """Rows that return after a long step: themselves, the last visit from the same side, that from the other side, and
    where the robot turned before it."""
    q, found = joint_places(m), []
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
    """Where the straight way to a visit begins."""
    start = visit - 1
    while start > 0 and towards[start - 1] @ towards[visit - 1] > settings.STRAIGHT_ON:
        start -= 1
    return start


def _with_way(m: Measurements, past: dict[int, int]) -> Measurements:
    """The table with the joints of row past[k] before each row k, on the way to it."""
    added = np.array(sorted(past))
    joints = np.array([past[k] for k in added])
    fill = {
        "t": 0.5 * (m.t[added - 1] + m.t[added]),
        "run": m.run[added],
        "beta": m.beta[joints],
        "alpha": m.alpha[joints],
        "force": m.force[added],
        "position": np.full((len(added), 3), np.nan),
        "quaternion": np.full((len(added), 4), np.nan),
        "row": m.row[added - 1],
    }
    columns = {name: getattr(m, name) for name in fill}
    return replace(
        m, **{name: np.insert(old, added, fill[name], axis=0) for name, old in columns.items() if old is not None}
    )
