"""A measurement session with something hidden: the plan, the way of the joints in time, what the tracker reads.

A set usually has 12 runs with hung masses in turn. At stops: 14 stops on a straight line in joint space, out, back, and
the seventh once more from the outward side. Streamed: the same way without stopping, at two speeds, read at 8 Hz.
Scattered: random places, each visited once.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from benches import JointRange
from equilibrium import Pose
from mechanics import Mechanics
from scipy.spatial.transform import Rotation
from simulate import FIELD_LENGTH, QUANTILE_95, Bench
from specimen import Specimen, small_moves

MASSES = (0.0, 0.010, 0.020)  # [kg]
DWELL, APPROACH, RETURN = 2.0, 9.0, 6.0  # [s] from stop to stop, to the next run, to the revisited stop
SETTLED = 1.5  # [s] of rest before a reading at a stop
STREAM_PERIOD, STREAM_TIMES = 0.125, (24.875, 8.25)  # [s] between readings; of a slow and of a fast run
ROTATION_ONLY = 0.4  # share of runs in which no tube translates
ELEMENT_LENGTH = 6e-3  # [m]: tip error 0.001 micrometres, 1 with kinks and contact; hundreds of readings average jitter
HISTORY_ELEMENT_LENGTH = 4e-3  # [m]: 1 to 6 micrometres, for robots that go in small moves on one grid
OUTLIER_SHARE, OUTLIER_SIZE = 0.005, (1e-3, 3e-3)  # [m]
SMALLEST_SWEEP = np.deg2rad(40.0)

Drive = Callable[[np.ndarray], np.ndarray]  # joints (2N,) wanted -> joints had; may remember
Sensing = Callable[[np.ndarray, Rotation, float], tuple[np.ndarray, Rotation]]  # position, rotation, time [s]


@dataclass(frozen=True)
class Habit:
    """How a laboratory measures."""

    runs: int = 12
    stops: int = 14  # on the way out, or scattered places, of each run; streamed runs have none
    loads: bool = True  # hung masses in turn: of runs, or of parts of a run where there are too few
    stream: bool = False
    scattered: bool = False
    orientation: bool = True  # whether the sensor tells it


@dataclass(frozen=True)
class Plan:
    """Readings in order, and the joints' way: piecewise linear in time."""

    time: np.ndarray  # (R,) [s]
    run: np.ndarray  # (R,)
    joints: np.ndarray  # (R, 2N) beta [m], alpha [rad]
    mass: np.ndarray  # (R,) [kg] hung from the tip
    knot_time: np.ndarray  # (K,) [s], rising
    knot_joints: np.ndarray  # (K, 2N)

    def at(self, time: float) -> np.ndarray:
        """Joints (2N,) at a time."""
        return np.array([np.interp(time, self.knot_time, column) for column in self.knot_joints.T])

    def way(self, start: float, end: float) -> np.ndarray:
        """(K, 2N) corners of the way from start (excluded) to end [s]."""
        between = self.knot_joints[(self.knot_time > start) & (self.knot_time < end)]
        return np.vstack([between, self.at(end)])


def draw_plan(allowed: JointRange, rng: np.random.Generator, habit: Habit) -> Plan:
    """A plan at stops, streamed or scattered, with hung masses in turn or without."""
    rows, knots = [], [(0.0, np.concatenate([allowed.home, np.zeros(allowed.home.size)]))]
    time = 0.0
    for run in range(habit.runs):
        mass = MASSES[run % len(MASSES)] if habit.loads else 0.0
        time += APPROACH
        if habit.scattered:
            visits = [allowed.draw(rng).round(9) for _ in range(habit.stops)]
            start = visits[0]
        else:
            start, end = _draw_line(allowed, rng)
        knots.append((time - SETTLED, start))
        if habit.stream:
            length = STREAM_TIMES[run % 2]
            knots += [(time, start), (time + length / 2, end), (time + length, start)]
            for moment in np.arange(0.0, length + 1e-9, STREAM_PERIOD):
                part = 1 - abs(1 - 2 * moment / length)
                rows.append((time + moment, run, start + part * (end - start), mass))
            time += length
            continue
        if not habit.scattered:
            stops = start + np.linspace(0, 1, habit.stops)[:, None] * (end - start)
            visits = [*stops, *stops[-2::-1], stops[(habit.stops - 1) // 2]]
        for k, stop in enumerate(visits):
            far = habit.scattered or k == len(visits) - 1
            time += 0.0 if k == 0 else RETURN if far else DWELL
            knots += [(time - SETTLED, stop), (time, stop)]
            if habit.loads and habit.runs < len(MASSES):
                mass = MASSES[k * len(MASSES) // len(visits)]
            rows.append((time, run, stop, mass))
    knots = [knot for k, knot in enumerate(knots) if k == 0 or knot[0] > knots[k - 1][0]]
    return Plan(
        *(np.array(column) for column in zip(*rows, strict=True)),
        *(np.array(column) for column in zip(*knots, strict=True)),
    )


def _draw_line(allowed: JointRange, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Ends (2N,) of a run: at least one tube turns by SMALLEST_SWEEP. Whole nanometres and nanoradians."""
    n = allowed.home.size
    rotation_only = rng.uniform() < ROTATION_ONLY
    while True:
        start, end = allowed.draw(rng).round(9), allowed.draw(rng).round(9)
        if rotation_only:
            end[:n] = start[:n]
        if np.max(np.abs(end - start)[n:]) > SMALLEST_SWEEP:
            return start, end


@dataclass
class Setup:
    """The true bench. Effects change it before the session."""

    bench: Bench
    plan: Plan
    mechanics: Mechanics
    drives: list[Drive] = field(default_factory=list)
    sensings: list[Sensing] = field(default_factory=list)  # in the base frame
    tracker_sensings: list[Sensing] = field(default_factory=list)  # in the tracker frame
    lags: np.ndarray = field(default_factory=lambda: np.zeros(1))  # [s], averaged, of a reading
    lag_noise: Callable[[], float] = lambda: 1.0  # times these, of one reading: no model can know it
    load_scale: float = 1.0

    def true_joints(self, joints: np.ndarray) -> np.ndarray:
        """Joints had (2N,) when `joints` are wanted."""
        for drive in self.drives:
            joints = drive(joints)
        return joints + np.concatenate([self.bench.beta_offset, self.bench.alpha_offset])


def run_session(setup: Setup) -> Iterator[tuple[np.ndarray, Rotation]]:
    """Position (3,) [m] and rotation in the tracker frame for each reading of the plan, without noise."""
    plan, settle_on_the_way = setup.plan, setup.mechanics.has_history
    specimen = Specimen(setup.mechanics, HISTORY_ELEMENT_LENGTH if settle_on_the_way else ELEMENT_LENGTH)
    gravity = setup.mechanics.robot.gravity
    last, wanted = plan.knot_time[0], plan.knot_joints[0]
    if settle_on_the_way:
        specimen.settle(*np.split(setup.true_joints(wanted), 2), np.zeros(3))
    for time, mass in zip(plan.time, plan.mass, strict=True):
        force = setup.load_scale * mass * gravity
        lags = setup.lag_noise() * setup.lags
        seen = time - lags.mean()
        smear = np.mean([plan.at(time - lag) for lag in lags], axis=0) - plan.at(seen)
        for corner in plan.way(last, seen):
            moves = small_moves(wanted, corner) if settle_on_the_way else [corner]
            for move in moves:
                joints = setup.true_joints(move)
                if settle_on_the_way:
                    pose = specimen.settle(*np.split(joints, 2), force, seen)
            wanted = corner
        if not settle_on_the_way:
            pose = specimen.settle(*np.split(joints + smear, 2), force, seen)
        last = seen
        yield _in_tracker(setup, pose, time)


def _in_tracker(setup: Setup, pose: Pose, time: float) -> tuple[np.ndarray, Rotation]:
    position, rotation = pose.position, Rotation.from_matrix(pose.rotation)
    for sensing in setup.sensings:
        position, rotation = sensing(position, rotation, time)
    position = setup.bench.tracker_rotation.apply(position) + setup.bench.tracker_position
    rotation = setup.bench.tracker_rotation * rotation
    for sensing in setup.tracker_sensings:
        position, rotation = sensing(position, rotation, time)
    return position, rotation


@dataclass(frozen=True)
class Noise:
    """What the tracker adds to each reading of a session."""

    position: np.ndarray  # (R, 3) [m] jitter and outliers
    rotation: np.ndarray  # (R, 3) [rad]
    field_position: np.ndarray  # (R, 3) [m] smooth error of the field
    field_rotation: np.ndarray  # (R, 3) [rad]
    outlier: np.ndarray  # (R,) bool


def draw_noise(tracker: dict, positions: np.ndarray, kind: str, rng: np.random.Generator) -> Noise:
    """Jitter alone ("jitter"), or with the field error that the accuracy figure implies and outliers ("realistic")."""
    n = len(positions)
    position = 1e-3 * tracker["jitter_mm"] * rng.normal(size=(n, 3))
    rotation = np.deg2rad(tracker["jitter_deg"]) * rng.normal(size=(n, 3))
    if kind == "jitter":
        return Noise(position, rotation, np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n, dtype=bool))
    outlier = rng.uniform(size=n) < OUTLIER_SHARE
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    position += outlier[:, None] * rng.uniform(*OUTLIER_SIZE, (n, 1)) * direction
    sigma = (1e-3 * tracker["accuracy_95_mm"] / QUANTILE_95, np.deg2rad(tracker["accuracy_95_deg"]) / QUANTILE_95)
    fields = [s * _smooth_field(positions, rng) for s in sigma]
    return Noise(position, rotation, *fields, outlier)


def _smooth_field(positions: np.ndarray, rng: np.random.Generator, waves: int = 300) -> np.ndarray:
    """(R, 3) unit normal functions of position (R, 3) [m], squared-exponential correlation over FIELD_LENGTH."""
    wave, phase = rng.normal(size=(3, waves, 3)) / FIELD_LENGTH, rng.uniform(0, 2 * np.pi, (3, waves))
    return np.sqrt(2 / waves) * np.stack(
        [np.cos(positions @ w.T + p).sum(axis=1) for w, p in zip(wave, phase, strict=True)], axis=1
    )
