"""The process that reads the tracker: every frame once, to a pipe; connects again by itself after a fault."""

import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection

from ctcr.devices.aurora import Aurora
from ctcr.devices.bench_file import TrackerPort
from ctcr.devices.fault import DeviceFault
from ctcr.devices.lateness import wish_real_time
from ctcr.devices.ndi_protocol import system_troubles
from ctcr.devices.ndi_replies import ToolReading

PRIORITY = 50  # below that of the bus
AGAIN_S = 0.5  # from a fault to the next connection
PAUSE_S = 0.004  # between questions that brought no new frame


@dataclass(frozen=True)
class TrackedFrame:
    """One frame of the sensor as it came in at `t` [s] (`time.monotonic`); `missed` frames lie before it."""

    t: float
    reading: ToolReading
    missed: int


def run(port: str, section: TrackerPort, pipe: Connection) -> None:
    """The process: sends ("connected", version), TrackedFrame and DeviceFault until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other end of the pipe decides
    wish_real_time(PRIORITY)
    aurora = Aurora(port, section.baud, section.replies)
    try:
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
    last, status = None, 0
    while not pipe.poll(0):
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
            time.sleep(PAUSE_S)
            continue
        missed = 0 if last is None else reading.frame - last - 1
        last = reading.frame
        pipe.send(TrackedFrame(frame.t, reading, missed))
