"""One recording: the rows of a plan, checked against the limits, are run on the devices and kept one by one."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.devices.tracker_process import TrackedFrame
from ctcr.bench.record.row_file import RowFile
from ctcr.errors import InputError, Problem
from ctcr.model.moving import MovingModel
from ctcr.robot.description import Robot
from ctcr.table.csv_table import SHOWN
from ctcr.table.measurements import Measurements

DIRECTIONS = {"planned": 0.0, "forward": -1.0, "backward": 1.0}  # sign of the way point minus the target


@dataclass(frozen=True)
class Approach:
    """How the joints come to a row: as planned, or always from below (forward) or above (backward)."""

    direction: str = "planned"
    translation: float = 2e-3  # [m] between way point and target
    rotation: float = np.deg2rad(5.0)  # [rad]

    @property
    def has_way_point(self) -> bool:
        return self.direction != "planned"


@dataclass(frozen=True)
class Step:
    """One row of the plan."""

    row: int  # of the plan's file
    run: int
    joints: Array  # (2N,) [m], [rad]
    way_point: Array | None  # (2N,)
    force: Array  # (3,) [N]

    def problem(self, limits: JointLimits) -> str | None:
        """Which limit it violates; None where it is allowed."""
        if text := limits.problem(self.joints):
            return text
        text = None if self.way_point is None else limits.problem(self.way_point)
        return text and f"on its approach {text}"


def steps_of(plan: Measurements, approach: Approach, limits: JointLimits, file: str) -> list[Step]:
    """The steps of a plan. Raises InputError with every row that the limits forbid."""
    n = plan.beta.shape[1]
    shift = DIRECTIONS[approach.direction] * np.repeat([approach.translation, approach.rotation], n)
    steps = []
    for row, run, *parts, force in zip(plan.row, plan.run, plan.beta, plan.alpha, plan.force, strict=True):
        joints = np.concatenate(parts)
        steps.append(Step(int(row), int(run), joints, joints + shift if approach.has_way_point else None, force))
    texts = [(step.row, text) for step in steps if (text := step.problem(limits))]
    if texts:
        problems = [Problem(text, file, row, line_name="row") for row, text in texts[:SHOWN]]
        raise InputError(problems, omitted=len(texts) - len(problems))
    return steps


@dataclass(frozen=True)
class Options:
    """How a row is measured."""

    dwell_s: float = 0.5  # from rest to the first reading
    readings: int = 1  # of each row
    speed: float = 1.0  # fraction of the highest


@dataclass
class Progress:
    """How far a recording has come, for displays. `errors_mm` are those of the model at the readings, NaN where it has
    no solution."""

    total: int
    done: int = 0
    doing: str = ""
    errors_mm: list[float] = field(default_factory=list)
    seen: bool = True  # the tracker sees the sensor

    @property
    def rms_mm(self) -> float:
        known = [error for error in self.errors_mm if error == error]
        return float(np.sqrt(np.mean(np.square(known)))) if known else float("nan")


@dataclass
class Session:
    """Runs the steps that are not in the file yet. `show` is called about 40 times a second."""

    robot: Robot
    motors: Motors
    tracker: Tracker
    rows: RowFile
    options: Options
    clock: Callable[[float], float]  # t_s of the rows from a time of `time.monotonic`
    hang: Callable[[Array], None]  # a weight, as Person.hang
    show: Callable[[Progress], None] = lambda progress: None
    weight_left: bool = False  # as Person.weight_left

    def run(self, steps: list[Step]) -> Progress:
        """Raises DeviceFault or InputError where it cannot go on; what has been measured is in the file."""
        self._model = MovingModel(self.robot)
        doubtful = self.weight_left or any(step.force.any() for step in steps)
        self._force = np.full(3, np.nan if doubtful else 0.0)  # NaN, what hangs there, differs from every force
        self.progress = Progress(len(steps), self.rows.groups)
        if 0 < self.rows.groups < len(steps):
            self._approach(steps[self.rows.groups - 1])  # the path to the next row is that of the plan
        for step in steps[self.rows.groups :]:
            self.rows.append(self._measured(step))
            self.progress.done += 1
        self.motors.halt()
        if steps and np.nan_to_num(self._force).any():  # the next recording begins without a weight
            self._announce("weight")
            self.hang(np.zeros(3))
        return self.progress

    def _measured(self, step: Step) -> list[Array]:
        rows = self._approach(step)
        self._announce(f"row {step.row}: settling")
        end = time.monotonic() + self.options.dwell_s
        while time.monotonic() < end:
            self._follow()
        self._announce(f"row {step.row}: reading")
        for frame in self._seen_frames(end):
            pose = frame.pose
            rows.append(self._row(step, frame.t, pose))
            self.progress.errors_mm.append(1e3 * float(np.linalg.norm(pose[:3] - self._model.reading()[0])))
        return rows

    def _approach(self, step: Step) -> list[Array]:
        """Moves to the joints of a step. Returns the row of its way point, where it has one."""
        if not np.array_equal(step.force, self._force):
            self._announce(f"row {step.row}: weight")
            self.hang(step.force)
            self._force = step.force
        rows = []
        self._announce(f"row {step.row}: moving")
        if step.way_point is not None:
            self._go(step.way_point)
            rows.append(self._row(step, time.monotonic(), np.full(7, np.nan)))
        self._go(step.joints)
        return rows

    def _go(self, joints: Array) -> None:
        self.motors.move(joints, self.options.speed)
        self.motors.wait(self._follow)

    def _row(self, step: Step, t: float, pose: Array) -> Array:
        return np.concatenate([[self.clock(t), step.run], self.motors.joints, step.force, pose])

    def _seen_frames(self, after: float) -> Iterator[TrackedFrame]:
        """The first frames later than `after` in which the tracker sees the sensor, as many as a row has readings."""
        count, patience = 0, time.monotonic() + self.tracker.patience_s
        while count < self.options.readings:
            frame = self._follow()
            if frame and frame.t > after and frame.reading.is_seen:
                count += 1
                yield frame
            elif time.monotonic() > patience:
                raise self.tracker.unseen_fault()

    def _follow(self) -> TrackedFrame | None:
        """Waits for the next frame, for a short time, and moves the model to the joints of the motors."""
        frame, now = self.tracker.next(), time.monotonic()
        n, joints = self.robot.n_tubes, self.motors.joints
        self._model.move(now, joints[:n], joints[n:], self._force)
        self.progress.seen = self.tracker.sees_now
        self.show(self.progress)
        self.motors.check()
        return frame

    def _announce(self, text: str) -> None:
        self.progress.doing = text
        self.show(self.progress)
