"""The process that reads the tracker: sends every frame once through a pipe, reconnects by itself after a fault."""

import math
import signal
import struct
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.aurora import Aurora
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.shared.ndi import NOT_TRACKED, RATE_HZ, ToolReading, system_faults
from ctcr.bench.shared.real_time import TRACKER, real_time

AGAIN_S = 0.5  # from a fault to the next connection
PERIOD_S = 1 / RATE_HZ
BACK_S = 0.0015  # a request that came too early delays the next one by this,
AHEAD_S, FASTER = 1e-5, 1.03  # one that did not advances it by this, growing from one to the next


@dataclass(frozen=True)
class TrackedFrame:
    """One frame of the sensor, received at `t` [s] (`time.monotonic`), `missed` frames after the last one.

    The reader woke up `late` [s] to ask for it.
    """

    t: float
    reading: ToolReading
    missed: int
    late: float

    LAYOUT = struct.Struct("<d7d 2d 4q")
    MARK = b"F"  # no pickle begins so

    def packed(self) -> bytes:
        """For the pipe: a pickle would take the control loop longer than the rest of the way. NaN stands for None."""
        r, nan = self.reading, (math.nan,)
        pose = (*(r.position or 3 * nan), *(r.quaternion or 4 * nan))
        error = math.nan if r.error is None else r.error
        return self.MARK + self.LAYOUT.pack(self.t, *pose, error, self.late, r.handle, r.status, r.frame, self.missed)

    @classmethod
    def unpacked(cls, data: bytes) -> "TrackedFrame":
        t, *pose, error, late, handle, status, frame, missed = cls.LAYOUT.unpack_from(data, len(cls.MARK))
        position, quaternion = (None if math.isnan(part[0]) else tuple(part) for part in (pose[:3], pose[3:]))
        error = None if math.isnan(error) else error
        return cls(t, ToolReading(handle, position, quaternion, error, status, frame), missed, late)

    @property
    def pose(self) -> Array:
        """Position [m] and unit quaternion, w >= 0, of a sensor that is seen (7,), tracker frame."""
        quaternion = np.array(self.reading.quaternion)
        quaternion *= (1 if quaternion[0] >= 0 else -1) / np.linalg.norm(quaternion)
        return np.concatenate([self.reading.position, quaternion])


class FrameClock:
    """When to ask the tracker: just after it has a new frame, so that readings are as fresh as can be.

    Each request comes a little earlier in the period than the one before, until one is too early.
    """

    def __init__(self) -> None:
        self.due = time.monotonic()  # [s] next request
        self._ahead = AHEAD_S

    def wait(self) -> float:
        """Sleeps until the next request is due; how late [s] it woke up. An overdue request is due now."""
        due = max(self.due, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
        return time.monotonic() - due

    def was_new(self) -> None:
        """The request brought a new frame."""
        self.due += PERIOD_S - self._ahead
        self._ahead *= FASTER
        while self.due < time.monotonic() - PERIOD_S:  # the computer was busy elsewhere
            self.due += PERIOD_S

    def was_early(self) -> None:
        """The request brought the last frame again."""
        self._ahead = AHEAD_S
        self.due += BACK_S


def run(port: str, baud: int, replies: str, tool: int, pipe: Connection) -> None:
    """The process: sends ("connected", version), TrackedFrame and DeviceFault until the pipe closes.

    `tool`: handle of the sensor; the others are as in Aurora.
    """
    for number in (signal.SIGINT, signal.SIGHUP):  # of the terminal: the other end of the pipe decides
        signal.signal(number, signal.SIG_IGN)
    with Aurora(port, baud, replies) as aurora, real_time(TRACKER):
        try:
            while not pipe.poll(0):
                try:
                    aurora.connect()
                    pipe.send(("connected", aurora.version))
                    _read(aurora, tool, pipe)
                except DeviceFault as fault:
                    pipe.send(fault)
                    pipe.poll(AGAIN_S)
        except (EOFError, OSError):
            pass  # the client has gone


def _read(aurora: Aurora, handle: int, pipe: Connection) -> None:
    last, status, clock = None, 0, FrameClock()
    while not pipe.poll(0):
        late = clock.wait()
        frame = aurora.read()
        reading = next((r for r in frame.readings if r.handle == handle), None)
        if reading is None:
            raise _absent(aurora, handle)
        if frame.system_status != status:
            status = frame.system_status
            for what, remedy in system_faults(status):
                pipe.send(DeviceFault(f"tracker {aurora.port}", what, remedy, status))
        if reading.frame == last:
            clock.was_early()
            continue
        clock.was_new()
        missed = 0 if last is None else max(0, reading.frame - last - 1)  # a device that began anew counts from 0
        last = reading.frame
        pipe.send_bytes(TrackedFrame(frame.t, reading, missed, late).packed())


def _absent(aurora: Aurora, handle: int) -> DeviceFault:
    """Why a reply does not hold the tool."""
    known, device = [tool.handle for tool in aurora.tools], f"tracker {aurora.port}"
    if handle in known:
        return DeviceFault(device, f"the tool {handle:02X} is {NOT_TRACKED}", "look at its plug, then connect again")
    text = f"no tool has the handle {handle:02X} (there are {', '.join(f'{other:02X}' for other in known)})"
    return DeviceFault(device, text, "change `tool` in the bench file")
