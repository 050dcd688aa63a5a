"""The simulated tracker: a pseudo-terminal that answers as an Aurora, looking at the simulated robot."""

import random
import select
import time
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.bench.devices import ndi_protocol as ndi
from ctcr.bench.devices.real_time import SIMULATED_TRACKER, real_time
from ctcr.bench.simulators.aurora_device import RATE_HZ, AuroraDevice, Sight
from ctcr.bench.simulators.control import ControlSocket
from ctcr.bench.simulators.faults import Faults, Scenario
from ctcr.bench.simulators.motors import shared_motors
from ctcr.bench.simulators.robot import SimulatedRobot
from ctcr.bench.simulators.serial_line import SerialLine
from ctcr.errors import InputError, Problem
from ctcr.frames import base_to_tracker

NAME = "aurora"
SENSOR = 0x0A  # the handle of the coil at the robot's tip
PROBE = 0x0C  # the handle of the coil in the probe
STILL = (np.array([0.05, 0.0, -0.2]), np.array([1.0, 0.0, 0.0, 0.0]))  # where the other coils lie
RESET_S = 0.2  # from a break to the device's message
BREAK_S = 0.3  # silence of a host that has just fallen back to the rate after a reset
FAULTS = {
    "missing": 0.0,  # share of the frames
    "out_of_volume": False,
    "latency_ms": 0.0,  # of every answer
    "latency_jitter_ms": 0.0,  # largest addition to it
    "garbage": 0.0,  # share of the answers of which a byte is damaged
    "wrong_crc": 0.0,  # share of the answers
    "wrong_baud": False,  # the device falls back to 9600 baud without being asked
    "hang": False,  # no answer to anything
    "unplugged": False,
}


class AuroraSimulator:
    """Serves `folder/aurora` (a link to the terminal) and the control socket `folder/aurora.sock`."""

    def __init__(self, robot: SimulatedRobot, folder: Path, scenario: str | Path | None = None, seed: int = 1):
        self.robot, self.faults = robot, Faults(FAULTS)
        self._scenario = Scenario.load(scenario, self.faults) if scenario else Scenario()
        self._random = random.Random(seed)
        self._device = AuroraDevice(self._see)
        self._probe = STILL
        self._control = ControlSocket(folder, NAME, self._asked)
        self.line = SerialLine(folder / NAME)
        self._motors, self._input = shared_motors(folder), b""
        self._start = self._slow_since = time.monotonic()
        self._next_look, self._frame = 0.0, -1

    def close(self) -> None:
        self._control.close()
        if self.line.plugged:
            self.line.unplug()

    def run(self, until=lambda: False) -> None:
        """Serves until `until()` is true."""
        with real_time(SIMULATED_TRACKER):
            while not until():
                self.step()

    def step(self) -> None:
        """Waits for the next thing to do, at most one frame, and does it."""
        waits = [self._device.frame_ends_in, self._next_look - time.monotonic(), self.line.send_due()]
        wait = max(0.0, min(wait for wait in waits if wait is not None))
        sources = [self._control, *([self.line] if self.line.plugged else [])]
        ready, _, _ = select.select(sources, [], [], wait)
        for changes in self._scenario.due(time.monotonic() - self._start):
            self._set(changes)
        self._follow_motors()
        if self._control in ready:
            self._control.answer()
        if self.line in ready and self.line.plugged:
            self._listen()
        self._guess_break()

    # ---- the line

    def _listen(self) -> None:
        self._slow_since = time.monotonic()
        self._input = (self._input + self.line.read())[-1024:]
        while b"\r" in self._input:
            line, _, self._input = self._input.partition(b"\r")
            if not self.faults.hang:
                self._reply(self._device.answer(line))

    def _reply(self, answer: bytes) -> None:
        if self._random.random() < self.faults.garbage:
            place = self._random.randrange(len(answer) - 1)
            answer = answer[:place] + bytes([answer[place] ^ 0x11]) + answer[place + 1 :]
        if self._random.random() < self.faults.wrong_crc:
            text = answer.endswith(b"\r")
            answer = answer[:-5] + b"0000\r" if text else answer[:-2] + b"\0\0"
        latency = self.faults.latency_ms + self._random.random() * self.faults.latency_jitter_ms
        self.line.write(answer, 1e-3 * latency)
        self._change_baud(self._device.next_baud)

    def _change_baud(self, baud: int) -> None:
        if baud != self.line.baud:
            while (wait := self.line.send_due()) is not None:  # the answer leaves at the old rate
                time.sleep(wait)
            self.line.baud = baud

    def _break(self) -> None:
        """What a break on the line does. A pseudo-terminal carries none: it is guessed, or asked for by control."""
        self._device.reset()
        self.line.baud = ndi.RESET_BAUD
        self.line.write(ndi.RESET_MESSAGE, RESET_S)

    def _guess_break(self) -> None:
        """A host that goes back to 9600 baud while the device is faster, and then waits, has sent a break."""
        now = time.monotonic()
        if not self.line.plugged or self.line.baud == ndi.RESET_BAUD or self.line.host_baud() != ndi.RESET_BAUD:
            self._slow_since = now
        elif now - self._slow_since > BREAK_S:
            self._break()

    # ---- what the tracker sees

    def _see(self, handle: int, _: int) -> Sight:
        if self._random.random() < self.faults.missing:
            return Sight(None)
        pose = self.robot.reading() if handle == SENSOR else STILL
        if handle == PROBE:
            pose = self.robot.as_read(*self._probe)
        return Sight(pose, self.faults.out_of_volume)

    def _follow_motors(self) -> None:
        """A pose is that of the moment at which its frame begins; the path to it is looked at twice as often."""
        now, frame = time.monotonic(), self._device.frame
        if frame == self._frame and now < self._next_look:
            return
        self._next_look = now + 0.5 / RATE_HZ
        motors = self._motors.read()
        axes = 2 * self.robot.robot.n_tubes
        self.robot.turn(now, np.zeros(axes) if motors is None else motors["turns"][:axes])
        if frame != self._frame:
            self._frame = frame
            self._device.acquire()

    # ---- control

    def _asked(self, request: dict[str, Any]) -> dict[str, Any]:
        if "faults" in request:
            self._set(request["faults"])
        if "force" in request:
            self.robot.force = _three(request, "force", "N")
        if "probe" in request:
            place = _three(request, "probe", "m, base frame")
            self._probe = base_to_tracker(self.robot.robot.tracker, place, STILL[1])
        if "fasten" in request:
            tube = request["fasten"]
            if tube is not None and tube not in range(self.robot.robot.n_tubes):
                raise InputError(Problem("needs the number of a tube from 0, or null", field="fasten"))
            self.robot.fasten(tube)
        if request.get("break"):
            self._break()
        return {
            "faults": self.faults.as_dict(),
            "force": self.robot.force.tolist(),
            "baud": self.line.baud,
            "frame": self._device.frame,
            "deployed": self.robot.deployed().tolist(),
        }

    def _set(self, changes: dict[str, Any]) -> None:
        self.faults.set(changes)
        if self.faults.unplugged and self.line.plugged:
            self.line.unplug()
            self._device.reset()  # a USB device loses its power with its plug
        elif not self.faults.unplugged and not self.line.plugged:
            self.line.plug()
            self.line.baud = ndi.RESET_BAUD
        if self.faults.wrong_baud:
            self.line.baud = ndi.RESET_BAUD


def _three(request: dict[str, Any], name: str, unit: str) -> np.ndarray:
    value = request[name]
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(Problem(f"needs three numbers [{unit}]", field=name))
    return np.array(value, dtype=float)
