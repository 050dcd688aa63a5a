"""The tables of the calibration procedures, measured on the bench: written row by row, and resumed where they end."""

import time
from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person
from ctcr.bench.devices.tracker import RATE_HZ, Tracker
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.shared.transmission import turns_of_joints
from ctcr.calibrate.tables import Table
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot

PATIENCE_S = 30.0
STILL_M = 0.5e-3  # motion of a probe that a hand holds still, with the tracker's noise
POSITION_COLUMNS = ("x_mm", "y_mm", "z_mm", "scatter_mm", "readings")
ROTATION_COLUMNS = ("tube", "motor_angle_deg", "direction", *POSITION_COLUMNS)
POINT_COLUMNS = ("point", "cad_x_mm", "cad_y_mm", "cad_z_mm", *POSITION_COLUMNS)
FLUSH_M = 0.2e-3  # a tip that stands out no farther is flush
OTHER_DEG = 3.0  # of a motor, between rows that are meant to be at one angle
RUN_UP = np.deg2rad(10.0)  # a turn reaches its first angle already turning


@dataclass(frozen=True)
class Circles:
    """The motion of the tubes."""

    step: float  # [rad] of a tube, between readings
    frames: int  # of a reading
    deployed: float | None = None  # [m] that a tube stands out; None: its curved length


@dataclass(frozen=True)
class Desk:
    """The devices of a bench, the person at it, and the folder `place` where its processes meet."""

    bench: Bench
    place: Path
    person: Person
    say: Callable[[str], None]


def rotation_table(path: str | Path, robot: Robot, desk: Desk, circles: Circles) -> None:
    """Turns one tube after the other, alone out of the plate, forward and backward; a row an angle.

    Ref: Boyer et al., Section V.B. Raises InputError where the robot cannot do so within the limits of the bench,
    DeviceFault where the devices stop. In the end the sensor is back on its tube, which stands out.
    """
    with (
        closing(RowFile(Path(path), ROTATION_COLUMNS)) as rows,
        Tracker(desk.bench, desk.place, PATIENCE_S) as tracker,
        Motors(desk.bench, robot, desk.place, one_by_one=True) as motors,
    ):
        turner = _Turner(robot, motors, tracker, desk.person, circles)
        turner.check()
        turner.check_last(rows)
        done, angles = divmod(rows.groups, len(turner.jobs))
        for tube in sorted(set(range(robot.n_tubes)) - set(turner.tubes)):
            desk.say(f"tube {tube + 1} is straight in the robot file: its tip draws no circle, and it is left out")
        if done < len(turner.tubes):
            motors.connect()
            tracker.connect()
            turner.look()
        for tube in turner.tubes[done:]:
            desk.say(f"tube {tube + 1}: alone out of the plate, turning both ways")
            turner.take_out(tube)
            turner.turn(tube, rows, angles)
            angles = 0
        if done < len(turner.tubes):
            turner.take_out(robot.tracker.sensor_on_tube - 1)


def point_table(path: str | Path, points: Table, desk: Desk, frames: int, rounds: int) -> None:
    """Asks the person to touch each named point with the probe, in `rounds` rounds; a row a touch.

    `points`: a table of CAD_POINTS. Raises InputError where the rows that are there are of other points, DeviceFault
    where the tracker stops.
    """
    names = list(dict.fromkeys(points["point"]))
    first = [points["point"].index(name) for name in names]
    cad = points.stacked("cad_x", "cad_y", "cad_z")[first]
    touches = list(zip(names, cad, strict=True)) * rounds
    section = desk.bench.tracker
    probe = section.model_copy(update={"tool": section.probe or section.tool})
    bench = desk.bench.model_copy(update={"tracker": probe})
    with closing(RowFile(Path(path), POINT_COLUMNS)) as rows, Tracker(bench, desk.place, PATIENCE_S) as tracker:
        if rows.last:
            name, where = touches[(rows.groups - 1) % len(names)]
            touched = [rows.last_number(column) for column in POINT_COLUMNS[1:4]]
            if rows.last[0] != name or not np.allclose(touched, 1e3 * where):
                text = "holds rows of other points: choose another name, or the points of those rows"
                raise rows.fault(text)
        left = touches[rows.groups :]
        if left:
            tracker.connect()
        for name, where in left:
            desk.person.touch(name, where)
            reading = still_reading(tracker, frames, STILL_M)
            rows.append([[name, *1e3 * where, *reading.fields()]])
            x, y, z = 1e3 * reading.position
            desk.say(f"{name}: {x:.2f}, {y:.2f}, {z:.2f} mm, scatter {1e3 * reading.scatter:.3f} mm")


@dataclass(frozen=True)
class StillReading:
    """The mean of some frames of a sensor at rest; `scatter`: standard deviation of one frame, per axis [m]."""

    position: Array  # (3,) [m], tracker frame
    scatter: float
    frames: int

    def fields(self) -> list[float]:
        """The values of POSITION_COLUMNS."""
        return [*1e3 * self.position, 1e3 * self.scatter, self.frames]


def still_reading(tracker: Tracker, frames: int, within: float) -> StillReading:
    """The first `frames` frames in a row that all lie `within` [m] of their mean.

    Raises DeviceFault where the tracker does not see the sensor, or it does not rest, for its patience.
    """
    tracker.discard()
    last: deque[tuple[float, float, float]] = deque(maxlen=frames)
    end = time.monotonic() + tracker.patience_s
    while True:
        last.append(tracker.seen().reading.position)
        mean = np.mean(last, axis=0)
        off = np.array(last) - mean
        if len(last) == frames and np.linalg.norm(off, axis=1).max() <= within:
            return StillReading(mean, float(np.sqrt((off**2).sum() / (3 * max(1, frames - 1)))), frames)
        if time.monotonic() > end + frames / RATE_HZ:
            text = f"it has not rested within {1e3 * within:g} mm for {tracker.patience_s:g} s"
            raise DeviceFault("tracker", text, "hold it still, or find the cause of its motion")


class _Turner:
    """Brings the tubes out one by one, turns them and reads the sensor at each angle."""

    def __init__(self, robot: Robot, motors: Motors, tracker: Tracker, person: Person, circles: Circles):
        self._robot, self._motors, self._tracker, self._person = robot, motors, tracker, person
        self._circles, self._limits = circles, motors.settings.axes.limits
        self.tubes = [i for i, tube in enumerate(robot.tubes) if tube.curvature and tube.curved_length]  # that bend
        self.jobs = self._jobs()
        self._worn: int | None = None  # the tube with the sensor on it

    def _span(self) -> tuple[float, float]:
        """First and last angle of a turn [rad], which all tubes may reach."""
        low, high = self._limits.rotation[:, 0].max() + RUN_UP, self._limits.rotation[:, 1].min() - RUN_UP
        return max(low, -np.pi), min(high, np.pi)

    def _jobs(self) -> list[tuple[float, int]]:
        """Angles [rad], each with the direction of approach: one turn forward, one backward."""
        low, high = self._span()
        angles = np.linspace(low, high, 1 + max(2, round((high - low) / self._circles.step)))
        return [*((angle, 1) for angle in angles), *((angle, -1) for angle in angles[::-1])]

    def check(self) -> None:
        """Raises InputError where a tube cannot stand out alone or turn, or none is bent."""
        problems = [] if self.tubes else [Problem("all are straight: there is no rotation to find", field="tubes")]
        low, high = self._span()
        if low >= high:
            text = f"a turn begins {np.rad2deg(RUN_UP):g} deg before its first angle: all tubes need a common range of "
            problems.append(Problem(f"{text}more than {np.rad2deg(2 * RUN_UP):g} deg", field="limits.rotation_deg"))
        for tube in self.tubes:
            if problem := self._limits.problem(self._alone(tube)):
                text = f"tube {tube + 1} cannot stand out alone: {problem}; widen the limits, or take the tubes in the "
                problems.append(Problem(f"{text}way out of the robot and make the table by hand", field="limits"))
        if problems:
            raise InputError(problems)

    def check_last(self, rows: RowFile) -> None:
        """Raises InputError where the rows that are there were made at other angles."""
        if not rows.last:
            return
        place, job = divmod(rows.groups - 1, len(self.jobs))
        number, motor, sign = map(rows.last_number, ROTATION_COLUMNS[:3])
        if place < len(self.tubes):
            tube = self.tubes[place]
            angle, wanted = self.jobs[job]
            off = abs(motor - self._motor_deg(tube, self._alone(tube, angle)))
            if (number, sign) == (tube + 1, wanted) and off < OTHER_DEG:
                return
        text = "holds rows at other angles: choose another name, or the --step-deg and limits of those rows"
        raise rows.fault(text)

    def _motor_deg(self, tube: int, joints: Array) -> float:
        """Angle of the rotation motor of a tube since home [deg]."""
        return 360 * float(turns_of_joints(self._robot, joints)[self._robot.n_tubes + tube])

    def look(self) -> None:
        """Finds the tube with the sensor: the one that is out alone, or else its usual one."""
        tips = self._motors.joints[: self._robot.n_tubes] + self._limits.length
        out = np.flatnonzero(tips > FLUSH_M)
        self._worn = int(out[0]) if len(out) == 1 else self._robot.tracker.sensor_on_tube - 1 if len(out) else None

    def take_out(self, tube: int) -> None:
        """Brings this tube alone out of the plate, with the sensor on it, which does not fit into another tube."""
        tips = self._motors.joints[: self._robot.n_tubes] + self._limits.length
        ordered = tube == 0 or (np.delete(tips, tube) <= FLUSH_M).all()  # a straight move keeps to the limits
        if self._worn != tube or not ordered:
            if self._worn is not None:
                self._person.fasten(None)
            self._worn = None
            self._go(self._flush())
        self._go(self._alone(tube))
        if self._worn is None:
            self._person.fasten(tube)
        self._worn = tube

    def turn(self, tube: int, rows: RowFile, done: int) -> None:
        """Turns and reads both ways, without the first `done` angles."""
        before = 0
        for angle, sign in self.jobs[done:]:
            if sign != before:
                self._go(self._alone(tube, angle - sign * RUN_UP))
            before = sign
            self._go(self._alone(tube, angle))
            reading = still_reading(self._tracker, self._circles.frames, STILL_M)
            motor = self._motor_deg(tube, self._motors.joints)
            rows.append([[str(tube + 1), motor, sign, *reading.fields()]])
        self._go(self._alone(tube))

    def _go(self, joints: Array) -> None:
        self._motors.move(joints)
        self._motors.wait()

    def _flush(self) -> Array:
        """Joints (2N,) with all tips flush with the plate."""
        return np.concatenate([-self._limits.length, np.zeros(self._robot.n_tubes)])

    def _alone(self, tube: int, angle: float = 0.0) -> Array:
        joints, deployed = self._flush(), self._circles.deployed
        joints[tube] += self._robot.tubes[tube].curved_length if deployed is None else deployed
        joints[self._robot.n_tubes + tube] = angle
        return joints
