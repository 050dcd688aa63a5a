"""Real-time priority and core of every process of the bench, and how late its periodic loops wake up."""

import gc
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass

import numpy as np

BIN_S = 20e-6  # of the histogram of lateness
BINS = 5000  # up to 0.1 s; the last bin holds everything later


@dataclass(frozen=True)
class Duty:
    """Scheduling of a process.

    The bus and what answers it share the first core, what reads the tracker and what controls by it the last one:
    handing over to a sleeping process on the same core need not wake another core, and the cycle of the bus does not
    delay the control loop.
    """

    priority: int  # SCHED_FIFO, 1 to 99; the larger runs first
    core: int  # among those that the process may use; -1 is the last


SIMULATED_BUS = Duty(70, 0)  # terminals answer at once, whatever else the computer does
BUS = Duty(60, 0)
TRACKER = Duty(50, -1)
SIMULATED_TRACKER = Duty(40, 0)
CONTROLLER = Duty(30, -1)  # and recording: below those that serve the devices


@contextmanager
def real_time(duty: Duty) -> Iterator[bool]:
    """Runs this thread at the real-time priority and on the core of its duty until the block ends.

    Yields whether the priority was granted; docs/hardware.md says how to permit it. Without it no core is set. Objects
    that exist already are left out of garbage collections, which come at the worst moment.
    """
    gc.collect()
    with ExitStack() as undo:
        gc.freeze()
        undo.callback(gc.unfreeze)
        granted = False
        with suppress(OSError, AttributeError):
            cores, policy, parameters = os.sched_getaffinity(0), os.sched_getscheduler(0), os.sched_getparam(0)
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(duty.priority))
            granted = True
        if granted:
            undo.callback(os.sched_setscheduler, 0, policy, parameters)
            undo.callback(os.sched_setaffinity, 0, cores)
            os.sched_setaffinity(0, {sorted(cores)[duty.core]})
        yield granted


class Lateness:
    """Histogram of how late a periodic loop wakes up; `add` takes constant time and memory."""

    def __init__(self) -> None:
        self._counts = np.zeros(BINS, np.int64)
        self.worst = 0.0  # [s]

    def add(self, late: float) -> None:
        self._counts[min(BINS - 1, max(0, int(late / BIN_S)))] += 1
        self.worst = max(self.worst, late)

    def quantile(self, fraction: float) -> float:
        """The lateness [s] that this fraction stays below, rounded up to BIN_S; 0 before the first `add`."""
        total = int(self._counts.sum())
        return BIN_S * (1 + int(np.searchsorted(np.cumsum(self._counts), fraction * total))) if total else 0.0

    def as_dict(self) -> dict[str, float]:
        return {
            "count": int(self._counts.sum()),
            "p50_ms": 1e3 * self.quantile(0.5),
            "p99_ms": 1e3 * self.quantile(0.99),
            "worst_ms": 1e3 * self.worst,
        }
