"""The process that owns the bus: exchanges process data in a steady cycle and moves the joints as it is asked.

Python threads share one lock, and a tracker's client in a thread beside the bus held it up by 376 ms; so the bus has a
process of its own. It is asked through a pipe, and tells its state in a shared record. When the other end of the pipe
is gone it stops the motors and ends.
"""

import gc
import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from ctcr.bench.devices import emergency_stop
from ctcr.bench.devices.axis_control import AxisControl, AxisSettings
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.bus_lock import BusLock
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.lateness import Lateness
from ctcr.bench.devices.real_time import BUS, real_time
from ctcr.bench.devices.shared_record import SharedRecord
from ctcr.bench.devices.stepper_drive import DriveSettings

HOME_COUNT = 1_000_000  # what the counters show at home; terminals count from 0 after power on, so that is not home
HOME_RANGE = 500_000  # counts: more than any axis travels
MOST_AXES = 8
SILENCE_S = 0.06  # without a good frame, before it is a fault; the terminals themselves wait for 0.1 s
STATE_CYCLES = 25  # between two looks at the terminals' states
READY_S = 0.5  # from enabling to ready
STATE = np.dtype(
    [
        ("t", "f8"),
        ("joints", "f8", MOST_AXES),
        ("wanted", "f8", MOST_AXES),
        ("counters", "i8", MOST_AXES),
        ("done", "i8"),
        ("moving", "?"),
        ("homed", "?"),
        ("limited", "?"),
        ("stopped", "?"),
        ("real_time", "?"),
        ("cycles", "i8"),
        ("bad_cycles", "i8"),
        ("p99_late", "f8"),
        ("worst_late", "f8"),
    ]
)


@dataclass(frozen=True)
class BusSettings:
    """All that the process needs; joints are `ratios * turns + home`."""

    interface: str
    positions: list[int]
    drive: DriveSettings
    axes: AxisSettings
    ratios: np.ndarray  # (2N,) [m] or [rad] per turn
    home: np.ndarray  # (2N,)
    period: float  # [s]


def state_record(folder: Path, writer: bool = False) -> SharedRecord:
    """What the bus owner tells of itself every cycle."""
    return SharedRecord(folder / "bus", STATE, writer)


def run(settings: BusSettings, folder: Path, pipe: Connection) -> None:
    """The process: says ("ready", names of devices) or ("fault", DeviceFault), then serves until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other end of the pipe decides
    bus = Bus(settings.interface, settings.positions, settings.drive)
    try:
        with BusLock(folder), real_time(BUS) as granted:
            try:
                bus.connect()
                owner = _Owner(settings, folder, pipe, bus, granted)
                owner.tell(time.monotonic())
                pipe.send(("ready", bus.names))
                owner.serve()
            finally:
                bus.close()
    except DeviceFault as fault:
        try:
            pipe.send(("fault", fault))
        except OSError:
            pass


class _Owner:
    def __init__(self, settings: BusSettings, folder: Path, pipe: Connection, bus: Bus, granted: bool):
        self._settings, self._folder, self._pipe, self._bus = settings, folder, pipe, bus
        self._record = state_record(folder, writer=True)
        self._real_time, self._lateness = granted, Lateness()
        self._cycles = self._bad = 0
        inputs = self._first_inputs()
        self._counters = np.array([drive.counter for drive in inputs])
        homed = bool((np.abs(self._counters - HOME_COUNT) < HOME_RANGE).all())
        self._base = HOME_COUNT if homed else 0
        self._control = AxisControl(settings.axes, self._joints(), homed)
        self._enabled_at, self._new_counters = None, None
        self._doubted = False  # the last look at the states found a fault
        self._number = 0  # of the last request
        self._open = True

    def _first_inputs(self):
        for _ in range(20):
            if inputs := self._bus.exchange():
                return inputs
        raise self._bus.check_states() or DeviceFault(
            f"bus {self._settings.interface}", "frames come back damaged", "check the cable, then connect again"
        )

    def _joints(self) -> np.ndarray:
        turns = (self._counters - self._base) / self._settings.drive.encoder_counts
        return self._settings.ratios * turns + self._settings.home

    def serve(self) -> None:
        gc.disable()  # a cycle leaves nothing to collect
        period, control = self._settings.period, self._control
        self._good_at = now = time.monotonic()
        last, due = now, now + period
        while self._open or (control.is_moving and now - self._good_at < SILENCE_S):  # ends at rest, or without a bus
            wait = due - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            now = time.monotonic()
            self._lateness.add(now - due)
            due = due + period if now < due + period else now + period  # what was missed is not made up for
            if self._cycle(now, min(now - last, 10 * period)):
                last = now
            if control.fault:
                emergency_stop.stop(self._folder, str(control.fault))
            self.tell(now)

    def _cycle(self, now: float, dt: float) -> bool:
        """One exchange; whether it was good."""
        self._cycles += 1
        self._listen()
        control, bus = self._control, self._bus
        inputs = bus.exchange()
        if emergency_stop.is_stopped(self._folder) and not control.fault:
            control.stop(emergency_stop.stop_fault(self._folder))
        if inputs is None:
            self._bad += 1
            if now - self._good_at > SILENCE_S and not control.fault:
                control.stop(bus.check_states() or self._frames_lost())
            return False
        self._good_at = now
        self._counters = np.array([drive.counter for drive in inputs])
        if self._new_counters is not None:
            if not all(drive.counter_set for drive in inputs):
                return True
            self._base, self._new_counters = HOME_COUNT, None
            control.place(self._joints())
        self._watch(now, inputs)
        speeds = control.cycle(dt, self._joints()) / self._settings.ratios
        enable = self._enabled_at is not None
        for drive, speed in zip(bus.drives, speeds, strict=True):
            drive.command(enable, speed if enable else 0.0)
        return True

    def _watch(self, now: float, inputs) -> None:
        """Stops where a terminal reports an error or has left OP."""
        control, bus = self._control, self._bus
        if control.fault:
            return
        for drive, said in zip(bus.drives, inputs, strict=True):
            if said.error:
                control.stop(drive.diagnosis())
            elif self._enabled_at and not said.ready and now - self._enabled_at > READY_S:
                off = drive.fault("does not switch its motor on", "check the motor's cable and supply")
                control.stop(bus.check_states() or off)
        if self._cycles % STATE_CYCLES == 0:
            fault = bus.check_states()
            if fault and self._doubted:  # one lost frame is no fault
                control.stop(fault)
            self._doubted = fault is not None

    def _frames_lost(self) -> DeviceFault:
        what = f"no frame came back whole for {1e3 * SILENCE_S:.0f} ms"
        return DeviceFault(f"bus {self._settings.interface}", what, "check the cables, then connect again")

    # ---- requests

    def _listen(self) -> None:
        try:
            while self._open and self._pipe.poll(0):
                number, name, arguments = self._pipe.recv()
                try:
                    getattr(self, f"_on_{name}")(*arguments)
                    self._number = number
                    self._pipe.send(("ok", None))
                except DeviceFault as fault:
                    self._pipe.send(("fault", fault))
        except (EOFError, OSError):
            self._open = False  # who asked is gone
            self._control.halt()

    def _enable(self) -> None:
        if self._enabled_at is None:
            self._enabled_at = time.monotonic()

    def _on_move(self, target, speed: float) -> None:
        self._control.move(target, speed)
        self._enable()

    def _on_jog(self, way, speed: float) -> None:
        self._control.jog(way, speed)
        self._enable()

    def _on_velocity(self, speeds, valid_s: float) -> None:
        self._control.velocity(speeds, valid_s)
        self._enable()

    def _on_halt(self) -> None:
        self._control.halt()

    def _on_home(self, turns) -> None:
        """The motors stand so many turns from home: the counters show it from now on."""
        if self._control.is_moving:
            raise DeviceFault("joints", "they are still moving", "wait")
        counts = HOME_COUNT + np.round(np.asarray(turns) * self._settings.drive.encoder_counts)
        self._new_counters = counts.astype(int).tolist()
        enable = self._enabled_at is not None
        for drive, count in zip(self._bus.drives, self._new_counters, strict=True):
            drive.command(enable, 0.0, counter=count)

    def _on_close(self) -> None:
        self._open = False
        self._control.halt()

    # ---- telling

    def tell(self, now: float) -> None:
        """Writes the state."""
        control, axes = self._control, len(self._counters)

        def padded(values):
            return np.concatenate([values, np.zeros(MOST_AXES - axes)])

        if self._cycles % STATE_CYCLES == 0:
            self._p99 = self._lateness.quantile(0.99)
        self._record.write(
            t=now,
            joints=padded(control.joints),
            wanted=padded(control.wanted),
            counters=padded(self._counters),
            done=-1 if control.is_moving or self._new_counters else self._number,
            moving=control.is_moving,
            homed=control.homed,
            limited=control.limited,
            stopped=control.fault is not None,
            real_time=self._real_time,
            cycles=self._cycles,
            bad_cycles=self._bad,
            p99_late=self._p99,
            worst_late=self._lateness.worst,
        )
