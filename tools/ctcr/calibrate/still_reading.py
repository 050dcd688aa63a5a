"""A reading of a sensor at rest: the mean of some frames, and how far they scatter."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.tracker import RATE_HZ, Tracker


@dataclass(frozen=True)
class StillReading:
    """`scatter`: standard deviation of one frame, per axis [m]."""

    position: NDArray[np.float64]  # (3,) [m], tracker frame
    scatter: float
    frames: int


def still_reading(tracker: Tracker, frames: int, within: float) -> StillReading:
    """The first `frames` frames in a row that all lie `within` [m] of their mean.

    Raises DeviceFault where the tracker does not see the sensor, or it does not rest, for its patience.
    """
    tracker.discard()
    seen: list[tuple[float, float, float]] = []
    end = time.monotonic() + tracker.patience_s
    while True:
        seen = [*seen, tracker.seen().reading.position][-frames:]
        places = np.array(seen)
        off = places - places.mean(axis=0)
        if len(seen) == frames and np.linalg.norm(off, axis=1).max() <= within:
            scatter = float(np.sqrt((off**2).sum() / (3 * max(1, frames - 1))))
            return StillReading(places.mean(axis=0), scatter, frames)
        if time.monotonic() > end + frames / RATE_HZ:
            text = f"it has not rested within {1e3 * within:g} mm for {tracker.patience_s:g} s"
            raise DeviceFault("tracker", text, "hold it still, or look for what shakes it")
