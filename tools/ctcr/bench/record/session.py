"""One recording: the plan is run on the devices, row by row, and every row is kept."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person
from ctcr.bench.devices.sight import Sight, is_seen, pose_of
from ctcr.bench.devices.tracker_process import TrackedFrame
from ctcr.bench.record.plan import Step
from ctcr.bench.record.row_file import RowFile
from ctcr.model.moving import MovingModel
from ctcr.robot.description import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """How a row is measured."""

    dwell_s: float = 0.5  # from rest to the first reading
    readings: int = 1  # of each row
    speed: float = 1.0  # share of the highest


@dataclass
class Progress:
    """What a display needs; errors against the model, NaN where it has no solution."""

    total: int
    done: int = 0
    doing: str = ""
    errors_mm: list[float] = field(default_factory=list)
    seen: bool = True  # the tracker sees the sensor

    @property
    def rms_mm(self) -> float:
        known = [error for error in self.errors_mm if error == error]
        return float(np.sqrt(np.mean(np.square(known)))) if known else float("nan")


class Session:
    """Runs the steps that are not in the file yet. `shown` is called about 40 times a second."""

    def __init__(
        self,
        robot: Robot,
        motors: Motors,
        sight: Sight,
        person: Person,
        rows: RowFile,
        options: Options,
        clock: Callable[[], float],
        shown: Callable[[Progress], None] = lambda progress: None,
    ):
        """`clock` gives t_s of the rows from a time of `time.monotonic`."""
        self._robot, self._motors, self._sight, self._person = robot, motors, sight, person
        self._rows, self._options, self._clock, self._shown = rows, options, clock, shown
        self._model = MovingModel(robot)
        self._force = np.full(3, np.nan)

    def run(self, steps: list[Step]) -> Progress:
        """Raises DeviceFault or InputError where it cannot go on; what has been measured is in the file."""
        self.progress = Progress(len(steps), self._rows.groups)
        if 0 < self._rows.groups < len(steps):
            self._come_to(steps[self._rows.groups - 1])  # the path to the next row is that of the plan
        for step in steps[self._rows.groups :]:
            self._rows.append(self._measured(step))
            self.progress.done += 1
        self._motors.halt()
        if steps and np.nan_to_num(self._force).any():  # whoever measures next begins without a weight
            self._doing("weight")
            self._person.hang(np.zeros(3))
        return self.progress

    def _measured(self, step: Step) -> list[Array]:
        rows = self._come_to(step)
        self._doing(f"row {step.row}: settling")
        end = time.monotonic() + self._options.dwell_s
        while time.monotonic() < end:
            self._follow()
        self._doing(f"row {step.row}: reading")
        for frame in self._seen_frames(end):
            pose = pose_of(frame)
            rows.append(self._row(step, frame.t, pose))
            self.progress.errors_mm.append(1e3 * float(np.linalg.norm(pose[:3] - self._model.reading()[0])))
        return rows

    def _come_to(self, step: Step) -> list[Array]:
        """Moves there; the row of the way point, where there is one."""
        if not np.array_equal(step.force, self._force):
            if np.isfinite(self._force).all() or step.force.any():
                self._doing(f"row {step.row}: weight")
                self._person.hang(step.force)
            self._force = step.force
        rows = []
        self._doing(f"row {step.row}: moving")
        if step.way_point is not None:
            self._go(step.way_point)
            rows.append(self._row(step, time.monotonic(), np.full(7, np.nan)))
        self._go(step.joints)
        return rows

    def _go(self, joints: Array) -> None:
        self._motors.move(joints, self._options.speed)
        self._motors.wait(self._follow)

    def _row(self, step: Step, t: float, pose: Array) -> Array:
        return np.concatenate([[self._clock(t), step.run], self._motors.joints, step.force, pose])

    def _seen_frames(self, after: float):
        """As many frames as a row needs, later than `after`, in which the tracker sees the sensor."""
        count, patience = 0, time.monotonic() + self._sight.patience_s
        while count < self._options.readings:
            frame = self._follow()
            if frame and frame.t > after and is_seen(frame):
                count += 1
                yield frame
            elif time.monotonic() > patience:
                raise self._sight.blind()

    def _follow(self) -> TrackedFrame | None:
        """Waits for the next frame, for a short time, and lets the model follow the joints."""
        frame, now = self._sight.next(), time.monotonic()
        n, joints = self._robot.n_tubes, self._motors.joints
        self._model.move(now, joints[:n], joints[n:], self._force)
        self.progress.seen = self._sight.is_now
        self._shown(self.progress)
        if self._motors.state["stopped"]:
            self._motors.wait()  # says why
        return frame

    def _doing(self, text: str) -> None:
        self.progress.doing = text
        self._shown(self.progress)
