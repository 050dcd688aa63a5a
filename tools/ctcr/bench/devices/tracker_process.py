"""The process that reads the tracker: every frame once, to a pipe; connects again by itself after a fault."""

import math
import signal
import struct
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection

from ctcr.bench.devices.aurora import Aurora
from ctcr.bench.devices.bench_file import TrackerPort
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.ndi_protocol import system_troubles
from ctcr.bench.devices.ndi_replies import ToolReading
from ctcr.bench.devices.real_time import TRACKER, real_time

AGAIN_S = 0.5  # from a fault to the next connection
RATE_HZ = 40.0  # of the tracker
PERIOD_S = 1 / RATE_HZ
BACK_S = 0.0015  # a question that came too early is put later by
AHEAD_S, FASTER = 1e-5, 1.03  # and each that did not earlier, by more from one to the next


@dataclass(frozen=True)
class TrackedFrame:
    """One frame of the sensor as it came in at `t` [s] (`time.monotonic`); `missed` frames lie before it.

    The reader woke up `late` [s] to ask for it.
    """

    t: float
    reading: ToolReading
    missed: int
    late: float

    LAYOUT = struct.Struct("<d7d 2d 4q")
    MARK = b"F"  # no pickle begins so

    def packed(self) -> bytes:
        """For the pipe: a pickle would take the control loop longer than the rest of the way."""
        r, unseen = self.reading, (math.nan,)
        pose = (*(r.position or 3 * unseen), *(r.quaternion or 4 * unseen))
        error = math.nan if r.error is None else r.error
        return self.MARK + self.LAYOUT.pack(self.t, *pose, error, self.late, r.handle, r.status, r.frame, self.missed)

    @classmethod
    def unpacked(cls, data: bytes) -> "TrackedFrame":
        t, *pose, error, late, handle, status, frame, missed = cls.LAYOUT.unpack_from(data, len(cls.MARK))
        position, quaternion = (None if math.isnan(part[0]) else part for part in (tuple(pose[:3]), tuple(pose[3:])))
        error = None if math.isnan(error) else error
        return cls(t, ToolReading(handle, position, quaternion, error, status, frame), missed, late)


class FrameClock:
    """When to ask the tracker: just after it has a new frame, so that no reading is older than it must be.

    Each question comes a little earlier in the period than the one before, until one is too early.
    """

    def __init__(self) -> None:
        self.due = time.monotonic()  # [s] next question
        self._ahead = AHEAD_S

    def wait(self) -> float:
        """How late [s] it is then; what is overdue already is due now."""
        due = max(self.due, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
        return time.monotonic() - due

    def was_new(self) -> None:
        """The question that was due brought a new frame."""
        self.due += PERIOD_S - self._ahead
        self._ahead *= FASTER
        while self.due < time.monotonic() - PERIOD_S:  # the computer was busy elsewhere
            self.due += PERIOD_S

    def was_early(self) -> None:
        """It brought the frame before once more."""
        self._ahead = AHEAD_S
        self.due += BACK_S


def run(port: str, section: TrackerPort, pipe: Connection) -> None:
    """The process: sends ("connected", version), TrackedFrame and DeviceFault until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other end of the pipe decides
    aurora = Aurora(port, section.baud, section.replies)
    try:
        with real_time(TRACKER):
            while not pipe.poll(0):
                try:
                    aurora.connect()
                    pipe.send(("connected", aurora.version))
                    _read(aurora, int(section.tool, 16), pipe)
                except DeviceFault as fault:
                    pipe.send(fault)
                    pipe.poll(AGAIN_S)
    except (EOFError, OSError):
        pass  # who listened is gone
    finally:
        aurora.close()


def _read(aurora: Aurora, handle: int, pipe: Connection) -> None:
    last, status, clock = None, 0, FrameClock()
    while not pipe.poll(0):
        late = clock.wait()
        frame = aurora.read()
        reading = next((r for r in frame.readings if r.handle == handle), None)
        if reading is None:
            known = ", ".join(f"{tool.handle:02X}" for tool in aurora.tools)
            text = f"no tool has the handle {handle:02X} (there are {known})"
            raise DeviceFault(f"tracker {aurora.port}", text, "change `tool` in the bench file")
        if frame.system_status != status:
            status = frame.system_status
            for what, remedy in system_troubles(status):
                pipe.send(DeviceFault(f"tracker {aurora.port}", what, remedy, status))
        if reading.frame == last:
            clock.was_early()
            continue
        clock.was_new()
        missed = 0 if last is None else reading.frame - last - 1
        last = reading.frame
        pipe.send_bytes(TrackedFrame(frame.t, reading, missed, late).packed())
