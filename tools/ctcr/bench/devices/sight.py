"""What the tracker sees of the sensor, frame by frame, and what is wrong where it sees nothing for too long."""

import time

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.lateness import Lateness
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.devices.tracker_process import RATE_HZ, TrackedFrame

STALE_S = 0.25  # without a new frame: the pose is no longer that of now


class Sight:
    """`patience_s`: with a tracker that does not see the sensor, before `seen` raises DeviceFault."""

    def __init__(self, tracker: Tracker, patience_s: float):
        self.tracker, self.patience_s = tracker, patience_s
        self.last: TrackedFrame | None = None
        self.lateness = Lateness()  # of frames, from the tracker's answer to here

    def next(self) -> TrackedFrame | None:
        """The next frame, seen or not; None where it does not come within one and a half of its periods."""
        frame = self.tracker.next(1.5 / RATE_HZ)
        if frame:
            self.last = frame
            self.lateness.add(time.monotonic() - frame.t)
        return frame

    def forget(self) -> None:
        """Frames that came while nobody asked are not waited for."""
        while self.tracker.next(0):
            pass

    def seen(self) -> TrackedFrame:
        """The newest frame that shows the sensor, waited for. Raises DeviceFault."""
        end = time.monotonic() + self.patience_s
        while True:
            frame = self.next()
            while frame and (later := self.tracker.next(0)):
                frame = self.last = later
            if frame and is_seen(frame):
                return frame
            if time.monotonic() > end:
                raise self.blind()

    @property
    def is_now(self) -> bool:
        """Whether the tracker saw the sensor just now."""
        return bool(self.last and time.monotonic() - self.last.t < STALE_S and is_seen(self.last))

    def blind(self) -> DeviceFault:
        """Why nothing is seen."""
        faults = self.tracker.faults
        if faults and (not self.last or faults[-1][0] > self.last.t):
            return faults[-1][1]
        out = self.last and self.last.reading.out_of_volume
        what = "the sensor is outside of the tracker's volume" if out else "the tracker does not see the sensor"
        remedy = "look at the sensor, its cable and the field generator, then run the same command again: it goes on"
        return DeviceFault("tracker", f"{what} for {self.patience_s:g} s", remedy)


def pose_of(frame: TrackedFrame) -> NDArray[np.float64]:
    """Position [m] and unit quaternion, w >= 0, of a frame that is seen (7,), tracker frame."""
    quaternion = np.array(frame.reading.quaternion)
    quaternion *= (1 if quaternion[0] >= 0 else -1) / np.linalg.norm(quaternion)
    return np.concatenate([frame.reading.position, quaternion])


def is_seen(frame: TrackedFrame) -> bool:
    return frame.reading.position is not None and not frame.reading.out_of_volume
