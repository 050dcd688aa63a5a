"""When the tracker is asked, and how a frame gets from the process that asks to the one that controls."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr.bench.devices import bench_file, tracker_process
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.devices.tracker_process import PERIOD_S, FrameClock, TrackedFrame
from ctcr.bench.shared.ndi import ToolReading

SEEN = TrackedFrame(
    12.25, ToolReading(10, (0.1, -0.2, 0.3), (0.5, 0.5, -0.5, 0.5), 0.25, 0x1F, 4_000_000_000), 3, 1.5e-4
)
UNSEEN = replace(SEEN, reading=ToolReading(10, None, None, None, 0x100, 7))


@pytest.mark.parametrize("frame", [SEEN, UNSEEN])
def test_packed_frame(frame):
    """A frame is the same behind the pipe."""
    assert TrackedFrame.unpacked(frame.packed()) == frame


def test_frozen_frames(tmp_path):
    """A tracker that sends no new frame is not said to miss the sensor."""
    bench = bench_file.load(Path(__file__).parents[3] / "examples" / "data" / "bench" / "bench.yaml")
    tracker = Tracker(bench, tmp_path, 1.0)
    tracker.last = replace(SEEN, t=time.monotonic() - 2)
    assert "has sent no new frame for 2.0 s: switch it off" in str(tracker.unseen_fault())
    tracker.last = replace(UNSEEN, t=time.monotonic())
    assert "does not see the sensor" in str(tracker.unseen_fault())


class Time:
    """`time` of a computer that wakes up late now and then."""

    def __init__(self, random):
        self.now, self._random = 1000.0, random

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds + self._random.exponential(2e-4) * (self._random.random() < 0.2)


@pytest.mark.parametrize("answer_s", [0.001, 0.011, 0.014])
@pytest.mark.parametrize("drift", [-1e-4, 1e-4])
def test_frame_clock(monkeypatch, answer_s, drift):
    """Requests settle just behind the frames, from any phase and with any drift, as long as a reply is shorter than a
    period."""
    random = np.random.default_rng(3)
    for phase in random.uniform(0, PERIOD_S, 20):
        clock_of_computer = Time(random)
        monkeypatch.setattr(tracker_process, "time", clock_of_computer)
        clock, last, ages, seen = FrameClock(), None, [], []
        while len(seen) < 1000:
            due = max(clock.due, clock_of_computer.now)
            assert clock.wait() == clock_of_computer.now - due
            asked = (clock_of_computer.now - 1000.0 + phase) * (1 + drift)
            clock_of_computer.now += answer_s
            if (frame := int(asked / PERIOD_S)) == last:
                clock.was_early()
                continue
            clock.was_new()
            last = frame
            seen.append(frame)
            ages.append(asked - PERIOD_S * frame)
        settled = np.array(ages[300:])
        assert (np.diff(seen) == 1).all()  # none is missed
        assert np.quantile(settled, 0.9) < 0.004 and np.median(settled) < 0.0015
