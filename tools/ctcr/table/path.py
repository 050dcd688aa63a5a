"""The path of a table: the way of the joints from row to row."""

import numpy as np

from ctcr import settings
from ctcr.arrays import Mask
from ctcr.table.measurements import Measurements


def with_path(measurements: Measurements, rows: Mask) -> Mask:
    """Some rows (M,) and those that keep the path: where the joints turn, and where runs, loads and the session begin
    or end. From each of them to the next all joints move at constant speed, within settings.PATH_STRAIGHT. Of a dense
    recording one row in each settings.PATH_STEP is kept, too."""
    time, kept = measurements.clock, rows.copy()
    kept[[0, -1, np.argmin(time), np.argmax(time)]] = True
    changes = (np.diff(measurements.run) != 0) | np.any(np.diff(measurements.force, axis=0) != 0, axis=1)
    kept[1:] |= changes
    kept[:-1] |= changes
    way = np.hstack(
        [np.abs(np.diff(getattr(measurements, name), axis=0)) / most for name, most in settings.PATH_STEP.items()]
    )
    kept[1:] |= np.diff(np.floor(np.append(0.0, np.cumsum(way.max(axis=1))))) > 0
    passed = np.append(0.0, np.cumsum(np.maximum(np.diff(time), 0.0)))  # where the clock starts anew, it goes on
    joints = np.hstack([getattr(measurements, name) / slack for name, slack in settings.PATH_STRAIGHT.items()])
    while True:
        between = np.column_stack([np.interp(passed, passed[kept], joint[kept]) for joint in joints.T])
        off = np.where(kept, 0.0, np.max(np.abs(joints - between), axis=1))
        if not np.any(off > 1):
            return kept
        # Keep the row of the largest deviation between each two kept rows.
        segment = np.cumsum(kept)
        order = np.lexsort((off, segment))
        farthest = order[np.append(np.diff(segment[order]) > 0, True)]
        kept[farthest[off[farthest] > 1]] = True
