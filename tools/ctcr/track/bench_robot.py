"""The robot on the bench as a controller sees it: tracker readings in, motor velocities out, all on the disk."""

from collections.abc import Callable
from dataclasses import dataclass
from math import tau

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.shared.transmission import turns_of_joints
from ctcr.frames import matrix_from_quaternion
from ctcr.robot.description import Robot
from ctcr.track.recording import control_row

Array = NDArray[np.float64]

VALID_PERIODS = 3  # that a velocity is driven before the motors come to rest by themselves


@dataclass
class BenchRobot:
    """A ctcr.track.device.Device for one run, whose pace is that of the tracker.

    A tracker that does not see the sensor holds the path; the motors then rest. Raises DeviceFault where that lasts
    longer than the patience of `tracker`, where the tip strays, a limit of the bench is met, or anything stops.
    """

    robot: Robot
    motors: Motors
    tracker: Tracker
    clock: Callable[[float], float]  # t_s of the rows from a time of `time.monotonic`
    measurements: RowFile
    control: RowFile
    run: int
    force: Array  # (3,) [N] that hangs at the tip
    most_error: float  # [m] between tip and reference
    advance: Callable[[float], None]  # is told each period as a share of the run

    def measure(self) -> tuple[Array, Array, Array]:
        frame = self.tracker.seen()
        self.motors.check()
        if self.motors.state["limited"]:
            raise DeviceFault("joints", "a limit of the bench file ended the motion", "change the path or the start")
        joints, pose = self.motors.joints, frame.pose
        self._t = self.clock(frame.t)
        self.measurements.append([[self._t, self.run, *joints, *self.force, *pose]])
        return tau * turns_of_joints(self.robot, joints), pose[:3], matrix_from_quaternion(pose[3:])

    def record(self, so_far, row: int) -> None:
        self.control.append([control_row(self._t, self.run, so_far, row)])
        self.advance(1 / len(so_far.time))
        error = float(np.linalg.norm(so_far.tip[row] - so_far.wanted[row]))
        if error > self.most_error:
            remedy = "compare transmission, homes and tracker frame of the robot file with the bench"
            raise DeviceFault("robot", f"its tip is {1e3 * error:.1f} mm from where it should be", remedy)

    def move(self, velocity: Array, period: float) -> None:
        self.motors.velocity(self.motors.settings.ratios * velocity / tau, VALID_PERIODS * period)
