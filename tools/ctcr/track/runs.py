"""Runs a scenario in closed loop: one run on a simulated robot or a device, or every weight and repetition."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np

from ctcr import _core
from ctcr.arrays import Array
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.model import parameters
from ctcr.robot.description import Robot
from ctcr.track.result import FAR, UNSETTLED, Run, beside_obstacle, limit_in_words
from ctcr.track.scenario import Scenario


class Device(Protocol):
    """A robot as a controller sees it: the interface of include/ctcr/control/device.hpp, for devices in Python.

    The methods are called once a period, in this order. What a method raises ends the run and is raised by it.
    """

    def measure(self) -> tuple[Array, Array, Array]:
        """Motor angles (2N,) [rad] from home, position (3,) [m] and rotation (3, 3) of the sensor, tracker frame.

        Sets the pace: returns when the next period starts.
        """

    def record(self, so_far, row: int) -> None:
        """Row `row` of the result, a LoopResult, is complete; not called while the robot settles at the start."""

    def move(self, velocity: Array, period: float) -> None:
        """Velocities (2N,) of the motors [rad/s] for one period [s]."""


def system_values(robot: Robot) -> _core.SystemValues:
    """The robot with its effects as the compiled library takes it."""
    return _core.SystemValues(parameters=parameters.values(robot), effects=catalogue.values(robot))


def run_once(
    scenario: Scenario,
    controller: _core.SystemValues,
    plant: _core.SystemValues | Device,
    mass_g: float,
    seed: int = 1,
    reading_age: float = 0.0,
) -> Run:
    """One run, on a simulated plant or a device. `seed` is that of the noise. Raises what the device raises.

    `reading_age` [s]: how much older the tracker's readings are than the joints; the model compensates for it.
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
            weights=tasks.weights,
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
        alpha=np.radians(s.start.alpha_deg),
        force=s.force(mass_g),
        tip_force=s.load.controller,
        noise_position=1e-3 * s.noise_mm,
        noise_rotation=np.radians(s.noise_deg),
        seed=seed,
        reading_age=reading_age,
    )
    names = ("status", "settled", "time", "joints", "tip", "wanted", "shortfall", "held", "force", "stability")
    found = {name: getattr(result, name) for name in names}
    return Run(mass_g, seed, *found.values(), *beside_obstacle(s, result.tip, result.wanted))


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
    """Advice where the robot does not reach the start of the path."""
    if scenario.obstacle:
        centre = np.array(scenario.obstacle.centre_mm)
        left = np.linalg.norm(1e3 * scenario.trajectory.points[0] - centre) - scenario.obstacle.radius_mm
        if left < 1e3 * FAR:
            return f"the obstacle is only {left:.1f} mm from it: move one of them"
    if scenario.noise_mm > 1e3 * UNSETTLED:
        return f"noise of {scenario.noise_mm:g} mm alone is more than the {1e3 * UNSETTLED:g} mm that count as reached"
    return "move trajectory or start, or settle longer"


def check(scenario: Scenario, robot: Robot, plant: Robot) -> None:
    """Raises InputError where robot, plant and scenario do not fit together, or limits exclude the start."""
    problems = catalogue.in_python(robot) or catalogue.in_python(plant)
    for kind, one in (("robot", robot), ("plant", plant)):
        if one.n_tubes != len(scenario.start.beta_mm):
            text = f"the {kind} has {one.n_tubes} tubes, the scenario starts with {len(scenario.start.beta_mm)}"
            problems.append(scenario.problem(text, "start", "beta_mm"))
        if one.tracker.sensor_on_tube != 1:
            text = f"the sensor of the {kind} is on tube {one.tracker.sensor_on_tube}: control needs it on tube 1"
            problems.append(Problem(text, field="tracker.sensor_on_tube"))
    problems = problems or [
        scenario.problem(f"the limits exclude the start: {text}", "start", "beta_mm")
        for text in _violated(scenario, robot)
    ]
    if problems:
        raise InputError(problems)


def _violated(scenario: Scenario, robot: Robot):
    """The limits that the start violates, in words."""
    beta, limits = np.array(scenario.start.beta_mm), scenario.limits
    tips = np.array([tube.length_mm for tube in robot.tubes]) + beta
    base_gaps, tip_gaps = np.diff(np.append(beta, 0)), -np.diff(np.append(tips, 0))
    for kind, (name, gaps) in enumerate({"base_gap_mm": base_gaps, "tip_gap_mm": tip_gaps}.items()):
        least = getattr(limits, name)
        for tube in np.flatnonzero(gaps < least):
            where = limit_in_words(kind, tube, robot.n_tubes)
            yield f"{where}: {gaps[tube]:g} mm, but limits.{name} asks for {least:g} mm"
    for tube, x in enumerate(beta):
        low, high = limits.beta_low_mm, limits.beta_high_mm
        if (low and x < low[tube]) or (high and x > high[tube]):
            yield f"travel of tube {tube + 1} does not reach {x:g} mm"
