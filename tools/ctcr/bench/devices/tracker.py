"""The tracked sensor as a program uses it: asks the process that reads the tracker."""

import multiprocessing
import pickle
import time
from pathlib import Path

from ctcr.bench.devices import tracker_process
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.lateness import Lateness
from ctcr.bench.devices.places import port_of
from ctcr.bench.devices.tracker_process import TrackedFrame

CONNECT_S = 20.0
PATIENCE_S = 3.0  # with faults, while the reader tries again


class Tracker:
    """Starts the reader; ends it when closed. Not real-time safe."""

    def __init__(self, bench: Bench, folder: Path):
        self.port, self._section = port_of(bench, folder), bench.tracker
        self.version = ""
        self.frames = self.missed = self.unseen = self.connections = 0
        self.lateness = Lateness()  # of the reader, from when it should ask to when it does
        self.faults: list[tuple[float, DeviceFault]] = []  # when, what
        self._pipe = self._process = None

    def connect(self) -> None:
        """Waits until the tracker tracks. Raises DeviceFault where it cannot be reached."""
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        arguments = (self.port, self._section, other)
        self._process = context.Process(target=tracker_process.run, args=arguments, name="tracker reader")
        self._process.start()
        other.close()
        start = time.monotonic()
        while not self.version and (waited := time.monotonic() - start) < CONNECT_S:
            self.next(0.1)
            if self.faults and waited > PATIENCE_S:
                raise self.faults[-1][1]
        if not self.version:
            text = f"does not track after {CONNECT_S:g} s"
            raise DeviceFault(f"tracker {self.port}", text, "switch it off and on")

    def close(self) -> None:
        if self._process:
            self._pipe.close()
            self._process.join(CONNECT_S)
        self._process = None

    def __enter__(self) -> "Tracker":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def next(self, seconds: float) -> TrackedFrame | None:
        """The next frame not yet asked for; None where none came in time, or a fault did (see `faults`)."""
        try:
            if not self._pipe.poll(seconds):
                return None
            data = self._pipe.recv_bytes()
        except (EOFError, OSError):
            raise DeviceFault("tracker", "the process that reads it is not there", "connect again") from None
        if data.startswith(TrackedFrame.MARK):
            frame = TrackedFrame.unpacked(data)
            self.frames += 1
            self.missed += frame.missed
            self.unseen += frame.reading.position is None
            self.lateness.add(frame.late)
            return frame
        message = pickle.loads(data)
        if isinstance(message, DeviceFault):
            self.faults.append((time.monotonic(), message))
        else:
            self.version, self.connections = message[1], self.connections + 1
        return None
