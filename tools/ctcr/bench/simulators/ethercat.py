"""The simulated bus: a coupler and stepper terminals that answer the EtherCAT frames on a network interface."""

import errno
import random
import select
import socket
import time
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.bench.devices.real_time import SIMULATED_BUS, real_time
from ctcr.bench.simulators.control import ControlSocket
from ctcr.bench.simulators.faults import Faults, Scenario
from ctcr.bench.simulators.motors import MOST_AXES, shared_motors
from ctcr.bench.simulators.segment import ETHERTYPE, Segment
from ctcr.bench.simulators.slave_controller import SlaveController
from ctcr.bench.simulators.stepper_terminal import Coupler, StepperTerminal
from ctcr.errors import InputError, Problem

NAME = "ethercat"
TICK_S = 0.0005  # terminals work no more often
IDLE_S = 0.01  # and no less
SHARE_S = 0.004  # between two writings of the motors' turns
LARGEST_FRAME = 1600  # bytes
FAULTS = {
    "lost_frames": 0.0,  # share
    "late_frames": 0.0,  # share
    "late_ms": 3.0,  # by which these are late
    "unplugged": False,  # the cable to the coupler
    "lost_after": 0,  # terminals beyond so many devices do not answer; 0: all do
    "power_loss": False,  # of all terminals; afterwards they know nothing any more
    "stall": 0,  # number of the motor (from 1) that is jammed; 0: none
    "missed_steps": 0,  # number of the motor that slips
    "over_current": 0,  # number of the motor with a short circuit
    "under_voltage": 0,  # number of the terminal whose motor supply is off
    "encoder_jump": 0,  # number of the motor whose encoder jumps, once
}
JUMP_COUNTS = 2000


class EthercatSimulator:
    """Answers on `interface`; the control socket is `folder/ethercat.sock`. Needs the right to open raw sockets."""

    def __init__(
        self,
        interface: str,
        folder: Path,
        motors: int = 6,
        variant: str = "EL7041",
        scenario: str | Path | None = None,
        seed: int = 1,
    ):
        if not 1 <= motors <= MOST_AXES:
            raise InputError(Problem(f"{motors} motors: 1 to {MOST_AXES} can be simulated"))
        self.faults = Faults(FAULTS)
        self._scenario = Scenario.load(scenario, self.faults) if scenario else Scenario()
        self.terminals = [StepperTerminal(i, variant) for i in range(motors)]
        self.segment = Segment([SlaveController(device) for device in (Coupler(), *self.terminals)])
        self._socket = raw_socket(interface)
        self._control = ControlSocket(folder, NAME, self._asked)
        self._shared = shared_motors(folder, writer=True)
        self._random, self._late = random.Random(seed), []
        self._start = self._ticked = time.monotonic()
        self._shared_at = 0.0
        self.frames = 0

    def close(self) -> None:
        self._control.close()
        self._socket.close()

    def run(self, until=lambda: False) -> None:
        """Serves until `until()` is true."""
        with real_time(SIMULATED_BUS):
            while not until():
                self.step()

    def step(self) -> None:
        """Waits for the next thing to do, at most IDLE_S, and does it."""
        now = time.monotonic()
        wait = min([IDLE_S, *(max(0.0, t - now) for t, _ in self._late)])
        ready, _, _ = select.select([self._socket, self._control], [], [], wait)
        for changes in self._scenario.due(time.monotonic() - self._start):
            self._set(changes)
        if self._control in ready:
            self._control.answer()
        if self._socket in ready:
            self._receive()
        now = time.monotonic()
        while self._late and self._late[0][0] <= now:
            self._send(self._late.pop(0)[1])
        if now - self._ticked >= TICK_S and not self.faults.power_loss:
            self._ticked = now
            self.segment.tick(now)
        if now - self._shared_at >= SHARE_S:
            self._shared_at = now
            shafts = np.zeros(MOST_AXES)
            shafts[: len(self.terminals)] = self.turns()
            self._shared.write(t=now, turns=shafts)

    def turns(self) -> list[float]:
        """Where the motors' shafts stand."""
        return [terminal.motor.shaft for terminal in self.terminals]

    def _receive(self) -> None:
        frame = bytearray(LARGEST_FRAME)
        try:
            frame = frame[: self._socket.recv_into(frame)]
        except OSError as error:
            if error.errno not in (errno.ENETDOWN, errno.ENXIO, errno.EAGAIN):
                raise
            time.sleep(IDLE_S)  # the interface is down: its cable is pulled
            return
        if self.faults.unplugged or self.faults.power_loss or self._random.random() < self.faults.lost_frames:
            return
        if self.segment.pass_through(frame, time.monotonic()):
            self.frames += 1
            if self._random.random() < self.faults.late_frames:
                self._late.append((time.monotonic() + 1e-3 * self.faults.late_ms, frame))
            else:
                self._send(frame)

    def _send(self, frame: bytearray) -> None:
        try:
            self._socket.send(frame)
        except OSError:
            pass  # the interface is down: the frame is lost, as on a wire

    # ---- control

    def _asked(self, request: dict[str, Any]) -> dict[str, Any]:
        if "faults" in request:
            self._set(request["faults"])
        states = [slave.state for slave in self.segment.slaves]
        return {"faults": self.faults.as_dict(), "states": states, "turns": self.turns(), "frames": self.frames}

    def _set(self, changes: dict[str, Any]) -> None:
        without_power = self.faults.power_loss
        self.faults.set(changes)
        faults = self.faults
        if without_power and not faults.power_loss:
            for slave in self.segment.slaves:
                slave.application.power_on()
                slave.power_on()
        self.segment.connect(int(faults.lost_after) or len(self.segment.slaves))
        for number, terminal in enumerate(self.terminals, start=1):
            motor = terminal.motor
            motor.jammed = faults.stall == number
            motor.slipping = faults.missed_steps == number
            motor.shorted = faults.over_current == number
            motor.unpowered = faults.under_voltage == number
            if changes.get("encoder_jump") == number:
                motor.jump(JUMP_COUNTS)


def raw_socket(interface: str) -> socket.socket:
    """A socket for EtherCAT frames. Raises InputError where there is no such interface, or no right."""
    try:
        made = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        made.bind((interface, ETHERTYPE))
    except PermissionError:
        text = "raw frames need a right: see docs/hardware.md, or run under `ctcr sim bench`"
        raise InputError(Problem(text, interface)) from None
    except OSError as error:
        raise InputError(Problem(f"no such interface ({error.strerror})", interface)) from None
    return made
