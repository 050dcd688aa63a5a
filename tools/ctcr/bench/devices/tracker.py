"""The tracked sensor as a program uses it: a client of the process that reads the tracker, frame by frame."""

import pickle
import time
from pathlib import Path

from ctcr.bench.devices import tracker_process
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.process_client import CONNECT_S, ProcessClient
from ctcr.bench.devices.tracker_process import RATE_HZ, TrackedFrame
from ctcr.bench.shared.real_time import Lateness

RETRY_S = 3.0  # with faults during the connection, while the reader tries again
STALE_S = 0.25  # without a new frame: the last pose is no longer the present one


class Tracker(ProcessClient):
    """Starts the reader; ends it when closed. Not real-time safe."""

    def __init__(self, bench: Bench, folder: Path, patience_s: float):
        """`patience_s`: with a sensor that is not seen, before `seen` raises DeviceFault."""
        super().__init__("tracker")
        self.port, self.patience_s, self._section = bench.port(folder), patience_s, bench.tracker
        self.version = ""
        self.frames = self.missed = self.unseen = self.connections = 0
        self.asked_late, self.frames_late = Lateness(), Lateness()  # of the reader; of frames, from the reply to here
        self.faults: list[tuple[float, DeviceFault]] = []  # when, what
        self.last: TrackedFrame | None = None

    def connect(self) -> None:
        """Waits until the tracker tracks. Raises DeviceFault where it cannot be reached."""
        section = self._section
        self.start(tracker_process.run, self.port, section.baud, section.replies, int(section.tool, 16))
        start = time.monotonic()
        while not self.version and (waited := time.monotonic() - start) < CONNECT_S:
            self._receive(0.1)
            if self.faults and waited > RETRY_S:
                raise self.faults[-1][1]
        if not self.version:
            text = f"does not track after {CONNECT_S:g} s"
            raise DeviceFault(f"tracker {self.port}", text, "switch it off and on")

    def next(self) -> TrackedFrame | None:
        """The next frame, seen or not; None where none comes within one and a half periods."""
        frame = self._receive(1.5 / RATE_HZ)
        if frame:
            self.frames_late.add(time.monotonic() - frame.t)
        return frame

    def discard(self) -> None:
        """Drops the frames that wait in the pipe."""
        while self._receive(0):
            pass

    def seen(self) -> TrackedFrame:
        """Waits for a frame that shows the sensor, the newest there is. Raises DeviceFault."""
        end = time.monotonic() + self.patience_s
        while True:
            frame = self.next()
            while frame and (later := self._receive(0)):
                frame = later
            if frame and frame.reading.is_seen:
                return frame
            if time.monotonic() > end:
                raise self.unseen_fault()

    @property
    def sees_now(self) -> bool:
        """Whether the last frame is fresh and shows the sensor."""
        return bool(self.last and time.monotonic() - self.last.t < STALE_S and self.last.reading.is_seen)

    def unseen_fault(self) -> DeviceFault:
        """Why the sensor is not seen."""
        if self.faults and (not self.last or self.faults[-1][0] > self.last.t):
            return self.faults[-1][1]
        if self.last and time.monotonic() - self.last.t > STALE_S:
            text = f"the tracker has sent no new frame for {time.monotonic() - self.last.t:.1f} s"
            return DeviceFault("tracker", text, "switch it off and on, then run the same command again: it resumes")
        out = self.last and self.last.reading.out_of_volume
        what = "the sensor is outside of the tracker's volume" if out else "the tracker does not see the sensor"
        remedy = "look at the sensor, its cable and the field generator, then run the same command again: it resumes"
        return DeviceFault("tracker", f"{what} for {self.patience_s:g} s", remedy)

    def _receive(self, seconds: float) -> TrackedFrame | None:
        """The next frame in the pipe; None where none came in time, or a fault did (see `faults`)."""
        try:
            if not self._pipe.poll(seconds):
                return None
            data = self._pipe.recv_bytes()
        except (EOFError, OSError):
            raise self.gone() from None
        if data.startswith(TrackedFrame.MARK):
            self.last = frame = TrackedFrame.unpacked(data)
            self.frames += 1
            self.missed += frame.missed
            self.unseen += frame.reading.position is None
            self.asked_late.add(frame.late)
            return frame
        message = pickle.loads(data)
        if isinstance(message, DeviceFault):
            self.faults.append((time.monotonic(), message))
        else:
            self.version, self.connections = message[1], self.connections + 1
        return None
