"""Who runs before whom while devices are served, and on which core: the one list of it."""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Duty:
    """What a process does for the bench.

    The bus and what answers it share the first core, what reads the tracker and what controls by it the last one:
    who hands over to a sleeping process on the same core need not wake another core, and the cycle of the bus does
    not stand in the way of the control loop.
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
    """Asks for real-time priority of this thread on the core of its duty; both are given back at the end.

    Yields whether the priority was granted; docs/hardware.md says how to permit it. Without it no core is kept. What
    lives already is left out of garbage collections, which come at the worst moment.
    """
    gc.collect()
    gc.freeze()
    try:
        with _scheduled(duty) as granted:
            yield granted
    finally:
        gc.unfreeze()


@contextmanager
def _scheduled(duty: Duty) -> Iterator[bool]:
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(duty.priority))
    except (OSError, AttributeError):
        yield False
        return
    policy, parameters, cores = before
    os.sched_setaffinity(0, {sorted(cores)[duty.core]})
    try:
        yield True
    finally:
        os.sched_setaffinity(0, cores)
        os.sched_setscheduler(0, policy, parameters)
