"""The robot's joints as a program uses them: a client of the process that owns the bus."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ctcr.arrays import Array, ArrayLike
from ctcr.bench.devices import bus_process, emergency_stop
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.process_client import CONNECT_S, ProcessClient
from ctcr.bench.shared.transmission import home_joints, transmission, turns_of_joints
from ctcr.robot.description import Robot

ANSWER_S = 2.0  # patience with the bus process, which answers within some bus cycles of 4 ms
POLL_S = 0.005  # about one bus cycle


class Motors(ProcessClient):
    """Starts the bus process; ends it when closed. Methods raise DeviceFault; none is real-time safe."""

    def __init__(self, bench: Bench, robot: Robot, folder: Path, one_by_one: bool = False):
        """`one_by_one`: as in JointLimits."""
        super().__init__("motors")
        self._robot, self._folder, self._number = robot, folder, 0
        axes = bench.axis_settings(robot)
        self.settings = bus_process.BusSettings(
            interface=bench.interface,
            positions=bench.positions,
            drive=bench.motors,
            axes=replace(axes, limits=replace(axes.limits, one_by_one=one_by_one)),
            ratios=transmission(robot),
            home=home_joints(robot),
            period=1e-3 * bench.motors.period_ms,
        )
        self.names: list[str] = []

    def connect(self) -> None:
        """Brings the bus up, motors off."""
        self.start(bus_process.run, self.settings, self._folder)
        self.names = self._answer(CONNECT_S)
        self._state = bus_process.state_record(self._folder)

    @property
    def state(self) -> np.void:
        """The newest state, with the fields of bus_process.STATE."""
        return self._state.read()

    @property
    def joints(self) -> Array:
        """(2N,) [m], [rad], from the encoders, as the controller that records knows them."""
        return self.state["joints"][: len(self.settings.home)]

    def move(self, joints: ArrayLike, speed: float = 1.0) -> None:
        """Starts a straight move of all joints (2N,) at a fraction of the highest speed."""
        self._ask("motion", "move", np.array(joints, float), speed)

    def jog(self, way: ArrayLike) -> None:
        """Starts a short move without limits, for homing."""
        self._ask("motion", "jog", np.array(way, float))

    def velocity(self, speeds: ArrayLike, valid_s: float = 0.1) -> None:
        """Joint speeds (2N,) for `valid_s`, or until the next request."""
        self._ask("motion", "velocity", np.array(speeds, float), valid_s)

    def halt(self) -> None:
        """Brakes to rest."""
        self._ask("halt")

    def set_joints(self, joints: ArrayLike) -> None:
        """Homing: the robot stands at these joints (2N,) now."""
        self._ask("home", turns_of_joints(self._robot, joints))
        self.wait()

    def check(self) -> None:
        """Raises DeviceFault where the motors are stopped."""
        if self.state["stopped"]:
            raise emergency_stop.stop_fault(self._folder)

    def wait(self, meanwhile: Callable[[], object] = lambda: time.sleep(POLL_S)) -> None:
        """Waits until the last request is done. Raises DeviceFault where the motors are stopped before."""
        while True:
            self.check()
            if self.state["done"] == self._number:
                return
            if not (self._process and self._process.is_alive()):
                raise self.gone()
            meanwhile()

    def _ask(self, name: str, *arguments) -> None:
        if not (self._process and self._process.is_alive()):
            raise self.gone()
        if emergency_stop.is_stopped(self._folder):
            raise emergency_stop.stop_fault(self._folder)
        self._number += 1
        self._answer(ANSWER_S, (self._number, name, arguments))

    def _answer(self, seconds: float, request: tuple | None = None):
        """The answer of the process to a request, or a message that it sends by itself."""
        try:
            if request:
                self._pipe.send(request)
            if not self._pipe.poll(seconds):
                raise self.gone()
            kind, content = self._pipe.recv()
        except (EOFError, OSError):
            raise self.gone() from None
        if kind == "fault":
            raise content
        return content
