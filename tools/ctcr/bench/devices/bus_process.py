"""The process that owns the bus: exchanges process data in a steady cycle and moves the joints on request.

Threads of one Python process share a lock, and a tracker's client in a thread beside the bus delayed a cycle by 376 ms;
so the bus has a process of its own. Requests come through a pipe, its state is in a shared record. When the other end
of the pipe closes, it stops the motors and ends.
"""

import gc
import json
import signal
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from ctcr.bench.devices import emergency_stop
from ctcr.bench.devices.axis_control import AxisControl, AxisSettings
from ctcr.bench.devices.bench_file import Motors
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.bus_lock import bus_lock
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.stepper_drive import DriveInputs
from ctcr.bench.shared.real_time import BUS, Lateness, real_time
from ctcr.bench.shared.shared_record import MOST_AXES, SharedRecord
from ctcr.errors import InputError
from ctcr.show.output import write_json

# Homing writes this count into the counters, which have 32 bits and a sign. After power on they count from 0, so a
# count within HOME_RANGE of it proves that the axis was homed since: no axis makes 7600 turns of the finest encoder.
HOME_COUNT, HOME_RANGE = 1_000_000_000, 500_000_000
SILENCE_S = 0.06  # of cycles without a good frame, before it is a fault; the terminals' watchdog waits for 0.1 s
STATE_CYCLES = 25  # between two checks of the terminals' states
READY_S = 0.5  # from enabling to ready
_FIELDS = {
    "f8": ("t", "p99_late", "worst_late"),  # [s]
    f"{MOST_AXES}f8": ("joints",),
    "i8": ("done", "cycles", "bad_cycles"),  # done: number of the last request once its motion has ended
    "?": ("moving", "homed", "limited", "stopped", "real_time"),
}
STATE = np.dtype([(name, kind) for kind, names in _FIELDS.items() for name in names])


@dataclass(frozen=True)
class BusSettings:
    """All that the process needs; joints are `ratios * turns + home`."""

    interface: str
    positions: list[int]
    drive: Motors
    axes: AxisSettings
    ratios: np.ndarray  # (2N,) [m] or [rad] per turn
    home: np.ndarray  # (2N,)
    period: float  # [s]


def state_record(folder: Path, writer: bool = False) -> SharedRecord:
    """The shared record of STATE, which this process writes every cycle."""
    return SharedRecord(folder / "bus", STATE, writer)


def last_bus(folder: Path) -> Bus | None:
    """The bus that a program drove last from this folder, for programs without a bench file."""
    try:
        known = json.loads((folder / "bus.json").read_text(encoding="utf-8"))
        return Bus(known["interface"], known["positions"], Motors.model_validate(known["drive"]))
    except (OSError, ValueError, LookupError, TypeError):  # none, or another version of this program wrote it
        return None


def _remember(settings: BusSettings, folder: Path) -> None:
    known = {"interface": settings.interface, "positions": settings.positions, "drive": settings.drive.model_dump()}
    write_json(known, str(folder / "bus.json"))


def run(settings: BusSettings, folder: Path, pipe: Connection) -> None:
    """The process: sends ("ready", names of devices) or ("fault", DeviceFault), then serves until the pipe closes."""
    for number in (signal.SIGINT, signal.SIGHUP):  # of the terminal: the other end of the pipe decides
        signal.signal(number, signal.SIG_IGN)
    bus = Bus(settings.interface, settings.positions, settings.drive)
    try:
        with bus_lock(folder), real_time(BUS) as granted, closing(bus):
            _remember(settings, folder)
            bus.connect()
            owner = _Owner(settings, folder, pipe, bus, granted)
            owner.publish(time.monotonic())
            pipe.send(("ready", bus.names))
            owner.serve()
    except DeviceFault as fault:
        with suppress(OSError):
            pipe.send(("fault", fault))


class _Owner:
    def __init__(self, settings: BusSettings, folder: Path, pipe: Connection, bus: Bus, granted: bool):
        self._settings, self._folder, self._pipe, self._bus = settings, folder, pipe, bus
        self._record = state_record(folder, writer=True)
        self._real_time, self._lateness = granted, Lateness()
        self._cycles = self._bad = 0
        self._silence = 0.0  # [s]
        self._counters = np.array([drive.counter for drive in bus.inputs()])
        homed = bool((np.abs(self._counters - HOME_COUNT) < HOME_RANGE).all())
        self._base = HOME_COUNT if homed else 0
        self._control = AxisControl(settings.axes, self._joints(), homed)
        self._enabled_at, self._new_counters = None, None
        self._number = 0  # of the last request
        self._open = True

    def _joints(self) -> np.ndarray:
        turns = (self._counters - self._base) / self._settings.drive.encoder_counts
        return self._settings.ratios * turns + self._settings.home

    def serve(self) -> None:
        gc.disable()  # a cycle leaves nothing to collect
        period, control = self._settings.period, self._control
        last = now = time.monotonic()
        due = now + period
        while self._open or (control.is_moving and self._silence < SILENCE_S):  # ends at rest, or without a bus
            wait = due - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            now = time.monotonic()
            self._lateness.add(now - due)
            due = due + period if now < due + period else now + period  # missed cycles are not made up for
            if self._cycle(now, min(now - last, 10 * period)):
                last = now
            if control.fault:
                self._stopped()
            self.publish(now)

    def _stopped(self) -> DeviceFault:
        """Latches the fault; what whoever asks for a motion is told, with the way to release it."""
        with suppress(InputError):  # this process brakes its motors also where the latch cannot be written
            emergency_stop.stop(self._folder, str(self._control.fault))
        return emergency_stop.stop_fault(self._folder)

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
            self._silence += self._settings.period  # by cycles: where this process is late, nobody has been asked
            if self._silence > SILENCE_S and not control.fault:
                lost = f"no frame came back whole for {1e3 * SILENCE_S:.0f} ms"
                control.stop(bus.check_states() or bus.frame_fault(lost))
            return False
        self._silence = 0.0
        self._counters = np.array([drive.counter for drive in inputs])
        if self._new_counters is not None:
            if not all(drive.counter_set for drive in inputs):
                return True
            self._base, self._new_counters = HOME_COUNT, None
            control.set_joints(self._joints())
        self._watch(now, inputs)
        speeds = control.cycle(dt, self._joints()) / self._settings.ratios
        enable = self._enabled_at is not None
        for drive, speed in zip(bus.drives, speeds, strict=True):
            drive.command(enable, speed if enable else 0.0)
        return True

    def _watch(self, now: float, inputs: list[DriveInputs]) -> None:
        """Stops where a terminal reports an error or has left OP."""
        control, bus = self._control, self._bus
        if control.fault:
            return
        for drive, said in zip(bus.drives, inputs, strict=True):
            if said.error:
                control.stop(drive.diagnosis())
            elif self._enabled_at and not said.ready and now - self._enabled_at > READY_S:
                off = drive.fault("does not enable its motor", "check the motor's cable and supply")
                control.stop(bus.check_states() or off)
        if self._cycles % STATE_CYCLES == 0 and (fault := bus.check_states(silence=False)):
            control.stop(fault)

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
                    self._pipe.send(("fault", self._stopped() if self._control.fault else fault))
        except (EOFError, OSError):  # the client has closed the pipe, or died
            self._open = False
            self._control.halt()

    def _on_motion(self, kind: str, *arguments) -> None:
        """move, jog or velocity of AxisControl."""
        getattr(self._control, kind)(*arguments)
        if self._enabled_at is None:
            self._enabled_at = time.monotonic()

    def _on_halt(self) -> None:
        self._control.halt()

    def _on_home(self, turns) -> None:
        """The motors stand so many turns from home: the counters show it from now on."""
        if self._control.is_moving:
            raise DeviceFault("joints", "they are still moving", "wait")
        counts = HOME_COUNT + np.round(np.asarray(turns) * self._settings.drive.encoder_counts)
        if not np.isfinite(counts).all():
            raise DeviceFault("joints", "a joint at home is not a number", "home again")
        self._new_counters = counts.astype(int).tolist()
        enable = self._enabled_at is not None
        for drive, count in zip(self._bus.drives, self._new_counters, strict=True):
            drive.command(enable, 0.0, counter=count)

    def publish(self, now: float) -> None:
        """Writes the state."""
        control = self._control
        if self._cycles % STATE_CYCLES == 0:
            self._p99 = self._lateness.quantile(0.99)
        self._record.write(
            t=now,
            joints=control.joints,
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
