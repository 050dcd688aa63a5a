"""The simulated bus: a coupler and stepper terminals that answer the EtherCAT frames on a network interface."""

import errno
import random
import socket
import time
from contextlib import suppress
from pathlib import Path

from ctcr.bench.shared.folder import ETHERCAT
from ctcr.bench.shared.real_time import SIMULATED_BUS
from ctcr.bench.shared.shared_record import MOST_AXES, shared_motors
from ctcr.bench.simulators.segment import ETHERTYPE, Segment
from ctcr.bench.simulators.simulator import Settings, Simulator
from ctcr.bench.simulators.slave_controller import SlaveController
from ctcr.bench.simulators.stepper_terminal import StepperTerminal, coupler
from ctcr.errors import InputError, Problem

TICK_S = 0.0005  # terminals work no more often
IDLE_S = 0.01  # and no less
SHARE_S = 0.004  # between two records of the motors' turns
LARGEST_FRAME = 1600  # bytes
JUMP_COUNTS = 2000
FAULTS = {  # those of a motor: its number from 1; 0: none
    "lost_frames": 0.0,  # fraction
    "late_frames": 0.0,  # fraction
    "late_ms": 3.0,  # delay of these
    "unplugged": False,  # the cable to the coupler
    "lost_after": 0,  # terminals beyond so many devices do not answer; 0: all do
    "power_loss": False,  # of all terminals, which forget everything
    "stall": 0,  # the motor is jammed
    "missed_steps": 0,  # the motor slips
    "over_current": 0,  # the motor has a short circuit
    "under_voltage": 0,  # the supply of the motor is off
    "encoder_jump": 0,  # the encoder of the motor jumps, once
    "internal_error": 0,  # the terminal of the motor fails, once, and keeps its error until its power was off
}
OF_MOTORS = ("stall", "missed_steps", "over_current", "under_voltage", "encoder_jump", "internal_error")


class EthercatSimulator(Simulator):
    """Answers on `interface`. Needs the right to open raw sockets."""

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
        self.terminals = [StepperTerminal(i, variant) for i in range(motors)]
        self.segment = Segment([SlaveController(device) for device in (coupler(), *self.terminals)])
        self._alone, self._socket = alone_on(interface), raw_socket(interface)
        most = dict.fromkeys(OF_MOTORS, motors) | {"lost_after": len(self.segment.slaves)}
        super().__init__(folder, ETHERCAT, FAULTS, SIMULATED_BUS, scenario, most)
        self._record = shared_motors(folder, writer=True)
        self._random, self._late = random.Random(seed), []
        self._ticked, self._recorded = time.monotonic(), 0.0
        self.frames = 0

    def close(self) -> None:
        super().close()
        self._socket.close()
        self._alone.close()

    def waits_for(self) -> tuple[list, float]:
        return [self._socket], min([IDLE_S, *(due - time.monotonic() for due, _ in self._late)])

    def work(self, heard: bool) -> None:
        if heard:
            self._receive()
        now = time.monotonic()
        while self._late and self._late[0][0] <= now:
            self._send(self._late.pop(0)[1])
        if now - self._ticked >= TICK_S and not self.faults.power_loss:
            self._ticked = now
            self.segment.tick(now)
        if now - self._recorded >= SHARE_S:
            self._recorded = now
            self._record.write(t=now, turns=self._turns())

    def _turns(self) -> list[float]:
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
        faults = self.faults
        if faults.unplugged or faults.power_loss or self._random.random() < faults.lost_frames:
            return
        if self.segment.pass_through(frame, time.monotonic()):
            self.frames += 1
            if self._random.random() < faults.late_frames:
                self._late.append((time.monotonic() + 1e-3 * faults.late_ms, frame))
            else:
                self._send(frame)

    def _send(self, frame: bytearray) -> None:
        with suppress(OSError):  # the interface is down: the frame is lost, as on a wire
            self._socket.send(frame)

    # ---- control

    def request(self, message: Settings) -> Settings:
        states = [slave.state for slave in self.segment.slaves]
        return {"states": states, "turns": self._turns(), "frames": self.frames}

    def set_faults(self, changes: Settings) -> None:
        without_power = self.faults.power_loss
        super().set_faults(changes)
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
            if changes.get("internal_error") == number:
                terminal.fail()


def alone_on(interface: str) -> socket.socket:
    """A name that one simulator of an interface can hold, whatever its folder: two would answer each frame twice."""
    held = socket.socket(socket.AF_UNIX)
    try:
        held.bind(f"\0ctcr sim ethercat {interface}")  # a name of the network namespace, no file
    except OSError:
        held.close()
        text = "another simulator answers there: end it, use another --interface, or `ctcr sim bench`"
        raise InputError(Problem(text, interface)) from None
    return held


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
