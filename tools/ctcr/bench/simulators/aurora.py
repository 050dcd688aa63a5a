"""The simulated tracker: a pseudo-terminal that answers as an Aurora, looking at the simulated robot."""

import random
import time
from pathlib import Path

import numpy as np

from ctcr.bench.shared import ndi
from ctcr.bench.shared.folder import AURORA
from ctcr.bench.shared.real_time import SIMULATED_TRACKER
from ctcr.bench.shared.shared_record import shared_motors
from ctcr.bench.simulators.aurora_device import AuroraDevice, Sight
from ctcr.bench.simulators.robot import SimulatedRobot
from ctcr.bench.simulators.serial_line import SerialLine
from ctcr.bench.simulators.simulator import Settings, Simulator
from ctcr.errors import InputError, Problem
from ctcr.frames import points_to_tracker

SENSOR = 0x0A  # the handle of the coil at the robot's tip
PROBE = 0x0C  # the handle of the coil in the probe
STILL = (np.array([0.05, 0.0, -0.2]), np.array([1.0, 0.0, 0.0, 0.0]))  # pose of the other coils
RESET_S = 0.2  # from a break to the device's message
MOST = 1e3  # of a force [N] and a place [m]
BREAK_S = 0.3  # silence of a host that has just fallen back to the rate after a reset
FAULTS = {
    "missing": 0.0,  # fraction of the frames
    "out_of_volume": False,
    "latency_ms": 0.0,  # of every reply
    "latency_jitter_ms": 0.0,  # largest addition to it
    "garbage": 0.0,  # fraction of the replies with a damaged byte
    "wrong_crc": 0.0,  # fraction of the replies
    "wrong_baud": False,  # the device falls back to 9600 baud without being asked
    "hang": False,  # no reply to anything
    "unplugged": False,
}


class AuroraSimulator(Simulator):
    """Serves `folder/aurora`, a link to the pseudo-terminal."""

    ASKS = ("force", "probe", "fasten", "break")

    def __init__(self, robot: SimulatedRobot, folder: Path, scenario: str | Path | None = None, seed: int = 1):
        super().__init__(folder, AURORA, FAULTS, SIMULATED_TRACKER, scenario)
        self.robot = robot
        self._random = random.Random(seed)
        self._device = AuroraDevice(self._see)
        self._probe = STILL
        self.line = SerialLine(folder / AURORA)
        self._motors, self._input = shared_motors(folder), b""
        self._slow_since, self._met_at = time.monotonic(), ndi.RESET_BAUD  # the rate of both, when they last agreed
        self._next_look, self._frame = 0.0, -1

    def close(self) -> None:
        super().close()
        if self.line.plugged:
            self.line.unplug()

    def waits_for(self) -> tuple[list, float]:
        send = self.line.send_due()
        wait = min(self._device.frame_ends_in, self._next_look - time.monotonic())
        return [self.line] * self.line.plugged, wait if send is None else min(wait, send)

    def work(self, heard: bool) -> None:
        self._follow_motors()
        if heard and self.line.plugged:
            self._listen()
        self._guess_break()

    # ---- the line

    def _listen(self) -> None:
        self._slow_since = time.monotonic()
        self._input = (self._input + self.line.read())[-1024:]
        while b"\r" in self._input:
            line, _, self._input = self._input.partition(b"\r")
            if not self.faults.hang:
                self._answer(self._device.answer(line))

    def _answer(self, reply: bytes) -> None:
        if self._random.random() < self.faults.garbage:
            at = self._random.randrange(len(reply) - 1)
            reply = reply[:at] + bytes([reply[at] ^ 0x11]) + reply[at + 1 :]
        if self._random.random() < self.faults.wrong_crc:
            reply = reply[:-5] + b"0000\r" if reply.endswith(b"\r") else reply[:-2] + b"\0\0"
        latency = self.faults.latency_ms + self._random.random() * self.faults.latency_jitter_ms
        self.line.write(reply, 1e-3 * latency)
        if self._device.next_baud != self.line.baud:
            while (wait := self.line.send_due()) is not None:  # the reply leaves at the old rate
                time.sleep(wait)
            self.line.baud = self._device.next_baud

    def _break(self) -> None:
        """The effect of a break. A pseudo-terminal carries none: it is guessed, or comes through the control socket."""
        self._device.reset()
        self.line.baud = ndi.RESET_BAUD
        self.line.write(ndi.RESET_MESSAGE, RESET_S)

    def _guess_break(self) -> None:
        """A host that goes back to 9600 baud from the faster rate of the device, and then waits, has sent a break."""
        if not self.line.plugged:
            return
        now, host = time.monotonic(), self.line.host_baud()
        if host == self.line.baud:
            self._met_at = host
        if host != ndi.RESET_BAUD or self._met_at != self.line.baud or host == self.line.baud:
            self._slow_since = now
        elif now - self._slow_since > BREAK_S:
            self._break()

    # ---- the field of view

    def _see(self, handle: int) -> Sight:
        if self._random.random() < self.faults.missing:
            return Sight(None)
        pose = self.robot.reading() if handle == SENSOR else STILL
        if handle == PROBE:
            pose = self.robot.as_read(*self._probe)
        return Sight(pose, self.faults.out_of_volume)

    def _follow_motors(self) -> None:
        """A pose is that of the moment at which its frame begins; the motors are read twice a frame."""
        now, frame = time.monotonic(), self._device.frame
        if frame == self._frame and now < self._next_look:
            return
        self._next_look = now + 0.5 / ndi.RATE_HZ
        motors = self._motors.read()
        axes = 2 * self.robot.robot.n_tubes
        self.robot.turn(now, np.zeros(axes) if motors is None else motors["turns"][:axes])
        if frame != self._frame:
            self._frame = frame
            self._device.acquire()

    # ---- control

    def request(self, message: Settings) -> Settings:
        if "force" in message:
            self.robot.force = _three(message, "force", "N")
        if "probe" in message:
            point = _three(message, "probe", "m, base frame")
            self._probe = points_to_tracker(self.robot.robot.tracker, point), STILL[1]
        if "fasten" in message:
            tube = message["fasten"]
            if tube is not None and (type(tube) is not int or tube not in range(self.robot.robot.n_tubes)):
                raise InputError(Problem("needs the number of a tube from 0, or null", field="fasten"))
            self.robot.fasten(tube)
        if message.get("break"):
            self._break()
        return {
            "force": self.robot.force.tolist(),
            "baud": self.line.baud,
            "frame": self._device.frame,
            "deployed": self.robot.deployed().tolist(),
        }

    def set_faults(self, changes: Settings) -> None:
        super().set_faults(changes)
        if self.faults.unplugged and self.line.plugged:
            self.line.unplug()
            self._device.reset()  # a USB device loses its power with its plug
        elif not self.faults.unplugged and not self.line.plugged:
            self.line.plug()
            self.line.baud = ndi.RESET_BAUD
        if self.faults.wrong_baud:
            self.line.baud = self._device.next_baud = ndi.RESET_BAUD


def _three(message: Settings, name: str, unit: str) -> np.ndarray:
    value = message[name]
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 3 or not all(type(x) in (int, float) and abs(x) < MOST for x in numbers):
        raise InputError(Problem(f"needs three numbers [{unit}] below {MOST:g}", field=name))
    return np.array(numbers, dtype=float)
