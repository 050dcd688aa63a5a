"""Runs a scenario: every weight, every repetition, over all cores."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ctcr import _core
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.track.device import Device
from ctcr.track.scenario import TASKS, Scenario, radians

Array = NDArray[np.float64]

FAR = 10e-3  # [m] from the surface of the obstacle: what is nearer to it is left out of the error, as it must deviate
FAILED = 1e-3  # [m] error beyond which a run has failed
UNSETTLED = 1e-3  # [m]


@dataclass(frozen=True)
class Run:
    """One run; rows are control periods. Positions [m], base frame of the plant."""

    mass_g: float
    repetition: int
    status: str
    settled: float  # distance to the start of the path when it begins [m]
    time: Array  # (R,) [s]
    joints: Array  # (R, 2N) beta [m], alpha [rad]
    tip: Array  # (R, 3) without noise
    wanted: Array  # (R, 3)
    shortfall: Array  # (R, tasks): above 1 the task gave way
    held: NDArray[np.int32]  # (R, 4) bits of base gaps, tip gaps, travel; speed
    force: Array  # (R, 3) [N] that the controller reckoned with
    stability: Array  # (R,)
    far: NDArray[np.bool_]  # (R,) whether the reference is far from the obstacle
    clearance: float  # least distance between tip and obstacle [m]; infinite: there is none

    @property
    def started(self) -> bool:
        return self.settled <= UNSETTLED and len(self.time) > 0

    @property
    def error(self) -> Array:
        """Distance between tip and reference (R,) [m]."""
        return np.linalg.norm(self.tip - self.wanted, axis=1)

    @property
    def counted(self) -> Array:
        """Errors where the reference is far from the obstacle [m]."""
        return self.error[self.far]

    @property
    def at_limit(self) -> NDArray[np.bool_]:
        """(R,) whether a position limit held the step."""
        return (self.held[:, :3] > 0).any(axis=1)

    @property
    def failed(self) -> bool:
        """Whether the robot did not do what it was told."""
        if not self.started or self.status != "ok" or self.clearance < 0:
            return True
        return bool((self.counted > FAILED).any())

    def limits_in_words(self) -> list[str]:
        """Which position limits held it, first ones first, with the time."""
        n, said = self.joints.shape[1] // 2, {}
        for row in np.flatnonzero(self.at_limit):
            for kind in range(3):
                for tube in range(n):
                    if self.held[row, kind] >> tube & 1:
                        said.setdefault((kind, tube), self.time[row])
        return [f"{_limit(kind, tube, n)} (from {time:.1f} s)" for (kind, tube), time in said.items()]

    def given_way(self) -> dict[str, float]:
        """Share of the time in which each task gave way, where it did [0..1]."""
        share = (self.shortfall > 1).mean(axis=0) if len(self.time) else np.zeros(len(TASKS))
        return {name: float(part) for name, part in zip(TASKS, share, strict=True) if part > 0}

    def verdict(self) -> str:
        """In words: what became of it."""
        if not self.started:
            return f"failed: the start of the path is not reached, the tip stays {1e3 * self.settled:.1f} mm away"
        if self.status != "ok":
            return f"failed at {self.time[-1]:.1f} s: {self.status}"
        if self.clearance < 0:
            return f"failed: the tip is {-1e3 * self.clearance:.2f} mm inside the obstacle"
        limits = "; ".join(self.limits_in_words())
        if self.failed:
            row = int(np.argmax(np.where(self.far, self.error, 0)))
            way = f"the tip is off by up to {1e3 * self.error[row]:.1f} mm (at {self.time[row]:.1f} s)"
            return f"failed: {limits or 'tracking gave way to the other tasks'}; {way}"
        return f"done, held at limits: {limits}" if limits else "done"


def _limit(kind: int, tube: int, n: int) -> str:
    if kind == 2:
        return f"travel of tube {tube + 1}"
    where = ("base", "tip")[kind]
    beside = f"that of tube {tube + 2}" if tube + 1 < n else "the front plate"
    return f"{where} of tube {tube + 1} against {beside}"


def system_values(robot: Robot, steps: int = 1) -> _core.SystemValues:
    """The robot with its effects as the compiled library takes it."""
    return _core.SystemValues(parameters=parameters.values(robot), effects=catalogue.values(robot), steps=steps)


def run_once(
    scenario: Scenario,
    controller: _core.SystemValues,
    plant: _core.SystemValues | Device,
    mass_g: float,
    seed: int = 1,
    reading_age: float = 0.0,
) -> Run:
    """One run, on a simulated plant or a device. `seed` is that of the noise. Raises what the device raises.

    `reading_age` [s]: how much older the tracker's readings are than the joints; the model makes up for it.
    """
    s, tasks, limits, obstacle = scenario, scenario.tasks, scenario.limits, scenario.obstacle
    n = len(s.start.beta_mm)

    def per_tube(values: list[float] | None, scale: float, default: float) -> Array:
        return np.full(n, default) if values is None else scale * np.array(values)

    simulated = isinstance(plant, _core.SystemValues)
    result = _core.closed_loop(
        controller=controller,
        plant=plant if simulated else controller,
        device=None if simulated else plant,
        tasks=_core.TaskValues(
            weights=np.array([getattr(tasks, name.replace(" ", "_")) for name in TASKS]),
            gain=tasks.feedback_per_s,
            correction=1e-3 * tasks.fastest_feedback_mm_s,
            tracking_tolerance=1e-3,
            damping_translation=20e-3,
            damping_rotation=2.0,
            avoidance_rate=tasks.limit_rate_per_s,
            comfort=5e-3 + 1e-3 * max(limits.base_gap_mm, limits.tip_gap_mm),
            obstacle=1e-3 * np.array(obstacle.centre_mm) if obstacle else np.zeros(3),
            obstacle_radius=1e-3 * obstacle.radius_mm if obstacle else 0.0,
            strength=tasks.obstacle_strength_m3_s,
            range=FAR,
            stability=tasks.stability_wanted,
            stability_rate=1.0,
            posture_beta=per_tube(tasks.posture_beta_mm, 1e-3, 0.0),
            posture_alpha=per_tube(tasks.posture_alpha_deg, np.pi / 180, 0.0),
            posture_rate=tasks.posture_rate_per_s,
        ),
        limits=_core.LimitValues(
            base_gap=1e-3 * limits.base_gap_mm,
            tip_gap=1e-3 * limits.tip_gap_mm,
            translation_speed=1e-3 * limits.translation_mm_s,
            rotation_speed=np.radians(limits.rotation_deg_s),
            beta_low=per_tube(limits.beta_low_mm, 1e-3, -np.inf),
            beta_high=per_tube(limits.beta_high_mm, 1e-3, np.inf),
            redistribute=limits.at_limits == "redistribute",
        ),
        points=s.trajectory.points,
        spline=s.trajectory.kind == "spline",
        speed=1e-3 * s.trajectory.speed_mm_s,
        acceleration=1e-3 * s.trajectory.acceleration_mm_s2,
        period=1 / s.rate_Hz,
        settle=s.start.settle_s,
        beta=1e-3 * np.array(s.start.beta_mm),
        alpha=radians(s.start.alpha_deg),
        force=s.force(mass_g),
        tip_force=s.load.controller,
        noise_position=1e-3 * s.noise_mm,
        noise_rotation=np.radians(s.noise_deg),
        seed=seed,
        reading_age=reading_age,
    )
    return Run(
        mass_g,
        seed,
        result.status,
        result.settled,
        result.time,
        result.joints,
        result.tip,
        result.wanted,
        result.shortfall,
        result.held,
        result.force,
        result.stability,
        *beside_obstacle(s, result.tip, result.wanted),
    )


def beside_obstacle(scenario: Scenario, tip: Array, wanted: Array) -> tuple[NDArray[np.bool_], float]:
    """Run.far and Run.clearance."""
    if not scenario.obstacle:
        return np.ones(len(wanted), bool), np.inf
    centre, radius = 1e-3 * np.array(scenario.obstacle.centre_mm), 1e-3 * scenario.obstacle.radius_mm
    clearance = float(np.linalg.norm(tip - centre, axis=1).min()) - radius if len(tip) else np.inf
    return np.linalg.norm(wanted - centre, axis=1) > radius + FAR, clearance


def run_all(
    scenario: Scenario, robot: Robot, plant: Robot, advance: Callable[[float], None] = lambda amount: None
) -> list[Run]:
    """Every weight with every repetition; `advance(1)` is called as each run ends.

    Raises InputError where the robots do not fit, limits exclude the start, or no run reaches the start of the path.
    """
    check(scenario, robot, plant)
    controller, real = system_values(robot), system_values(plant)
    jobs = [(mass, k) for mass in scenario.load.mass_g for k in range(1, scenario.repetitions + 1)]

    def work(job: tuple[float, int]) -> Run:
        run = run_once(scenario, controller, real, *job)
        advance(1)
        return run

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        runs = list(pool.map(work, jobs))
    if not any(run.started for run in runs):
        text = f"{runs[0].verdict().removeprefix('failed: ')}: {_remedy(scenario)}"
        raise InputError(scenario.problem(text, "trajectory"))
    return runs


def _remedy(scenario: Scenario) -> str:
    """What helps where the start of the path is not reached."""
    if scenario.obstacle:
        centre = np.array(scenario.obstacle.centre_mm)
        left = np.linalg.norm(1e3 * scenario.trajectory.points[0] - centre) - scenario.obstacle.radius_mm
        if left < 1e3 * FAR:
            return f"the obstacle is only {left:.1f} mm from it: move one of them"
    if scenario.noise_mm > 1e3 * UNSETTLED:
        return f"noise of {scenario.noise_mm:g} mm alone is more than the {1e3 * UNSETTLED:g} mm that count as reached"
    return "move trajectory or start, or settle longer"


def check(scenario: Scenario, robot: Robot, plant: Robot) -> None:
    """Raises InputError for what robot, plant and scenario are not made for."""
    problems = []
    for kind, one in (("robot", robot), ("plant", plant)):
        if one.n_tubes != len(scenario.start.beta_mm):
            text = f"the {kind} has {one.n_tubes} tubes, the scenario starts with {len(scenario.start.beta_mm)}"
            problems.append(scenario.problem(text, "start", "beta_mm"))
        if one.tracker.sensor_on_tube != 1:
            text = f"the sensor of the {kind} is on tube {one.tracker.sensor_on_tube}: control needs it on tube 1"
            problems.append(Problem(text, field="tracker.sensor_on_tube"))
    if not problems:
        problems = _excluded(scenario, robot)
    if problems:
        raise InputError(problems)


def _excluded(scenario: Scenario, robot: Robot) -> list[Problem]:
    beta = np.array(scenario.start.beta_mm)
    tips = np.array([tube.length_mm for tube in robot.tubes]) + beta
    found, n = [], robot.n_tubes
    for kind, (name, least) in enumerate((("base", scenario.limits.base_gap_mm), ("tip", scenario.limits.tip_gap_mm))):
        gaps = -np.diff(np.append(tips, 0)) if kind else np.diff(np.append(beta, 0))
        for tube in np.flatnonzero(gaps < least):
            text = f"{_limit(kind, tube, n)}: {gaps[tube]:g} mm, but limits.{name}_gap_mm asks for {least:g} mm"
            found.append(scenario.problem(f"the limits exclude the start: {text}", "start", "beta_mm"))
    for low, high in ((scenario.limits.beta_low_mm, scenario.limits.beta_high_mm),):
        for tube in range(n):
            if (low and beta[tube] < low[tube]) or (high and beta[tube] > high[tube]):
                text = f"the limits exclude the start: travel of tube {tube + 1} does not reach {beta[tube]:g} mm"
                found.append(scenario.problem(text, "start", "beta_mm"))
    return found
