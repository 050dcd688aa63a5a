"""A scenario on the bench: every weight and repetition, recorded row by row; an interrupted recording is resumed."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import product
from math import tau
from pathlib import Path

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices import bench_file
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person, person_of
from ctcr.bench.devices.tracker import RATE_HZ, Tracker
from ctcr.bench.record.folder import Folder
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.shared.folder import private_folder
from ctcr.bench.shared.transmission import turns_of_joints
from ctcr.errors import InputError, Problem
from ctcr.frames import matrix_from_quaternion
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.show.output import Progress
from ctcr.track import scenario as scenario_file
from ctcr.track.recording import COLUMNS, CONTROL, control_row, finished, runs_of, tips_at
from ctcr.track.result import Run
from ctcr.track.runs import check, run_once, system_values
from ctcr.track.scenario import Scenario

VALID_PERIODS = 3  # for which a velocity is driven before the motors come to rest by themselves
MOST_FEEDBACK = 0.375  # a period: a loop two periods late, as that of tracker and motors is, is unstable above 0.62


def track(
    target: str | Path,
    robot: str,
    scenario: str,
    bench: str,
    *,
    place: str | Path | None = None,
    patience_s: float = 2.0,
    most_error_mm: float = 20.0,
    said: Callable[[str], None] = lambda text: None,
) -> tuple[list[Run], Scenario]:
    """Runs the scenario of a file on the bench of a file, records it in the folder `target`, and returns the runs.

    The scenario returned is that `within` the limits of the bench. `place`: the folder where the processes of the bench
    meet; `said` is called with a line for each run. Raises InputError for the files, DeviceFault where the devices
    stop; the runs until then are in the folder, and the same call resumes after the last whole run.
    """
    place, sources = private_folder(place), {"robot": robot, "scenario": scenario, "bench": bench}
    loaded, devices = robot_file.load(robot, compiled=True), bench_file.load(bench)
    wanted = within(scenario_file.load(scenario, loaded.n_tubes), devices, loaded)
    check(wanted, loaded, loaded)
    with Tracker(devices, place, patience_s) as tracker, Motors(devices, loaded, place) as motors:
        motors.connect()
        tracker.connect()
        folder = Folder(target, sources, {}, loaded.n_tubes, synced=False)
        age = 1e-3 * devices.tracker.reading_age_ms
        control = RowFile(folder.path / CONTROL, COLUMNS, synced=False)
        with folder.sitting(motors, tracker), closing(folder.rows), closing(control):
            device = BenchRobot(loaded, motors, tracker, folder, control, 1e-3 * most_error_mm)
            _run_all(wanted, device, person_of(devices, place), age, said)
    return runs_of(folder, wanted, loaded, age), wanted


def within(scenario: Scenario, bench: Bench, robot: Robot) -> Scenario:
    """The scenario with the limits of the bench where they are tighter, less the braking distance of the joints.

    The feedback is limited to what the delays of the bench allow. Raises InputError where the tracker has another rate.
    """
    if scenario.rate_Hz != RATE_HZ:
        text = f"{scenario.rate_Hz:g} Hz: on the bench the tracker sets the pace, {RATE_HZ:g} Hz"
        raise InputError(Problem(text, field="rate_Hz"))
    tasks = scenario.tasks
    feedback = min(tasks.feedback_per_s, MOST_FEEDBACK * RATE_HZ)
    axes, limits, n = bench.axis_settings(robot), scenario.limits, robot.n_tubes
    braking = float(axes.speeds[0] ** 2 / (2 * axes.accelerations[0]))
    travel = axes.limits.travel + robot.actuation.translation_correction[:, None]
    low, high = 1e3 * (travel + [braking, -braking]).T
    tighter = {
        "base_gap_mm": max(limits.base_gap_mm, 1e3 * (axes.limits.clearance + 2 * braking)),
        "tip_gap_mm": max(limits.tip_gap_mm, 2e3 * braking),
        "translation_mm_s": min(limits.translation_mm_s, 1e3 * float(axes.speeds[0])),
        "rotation_deg_s": min(limits.rotation_deg_s, float(np.rad2deg(axes.speeds[n]))),
        "beta_low_mm": np.maximum(low, -np.inf if limits.beta_low_mm is None else limits.beta_low_mm).tolist(),
        "beta_high_mm": np.minimum(high, np.inf if limits.beta_high_mm is None else limits.beta_high_mm).tolist(),
    }
    tasks = tasks.model_copy(update={"feedback_per_s": feedback})
    return scenario.model_copy(update={"limits": limits.model_copy(update=tighter), "tasks": tasks})


@dataclass
class BenchRobot:
    """The robot on the bench, a ctcr.track.runs.Device that records every period; the tracker sets its pace.

    While the tracker does not see the sensor the path is held and the motors rest. Raises DeviceFault where that lasts
    longer than the patience of `tracker`, where the tip strays, a limit of the bench is met, or anything stops.
    """

    robot: Robot
    motors: Motors
    tracker: Tracker
    folder: Folder
    control: RowFile
    most_error: float  # [m] between tip and reference
    run: int = 0
    force: Array | None = None  # (3,) [N] of the weight at the tip
    advance: Callable[[float], None] = lambda fraction: None  # called each period with the fraction of the run done

    def measure(self) -> tuple[Array, Array, Array]:
        frame = self.tracker.seen()
        self.motors.check()
        if self.motors.state["limited"]:
            raise DeviceFault("joints", "a limit of the bench file ended the motion", "change the path or the start")
        joints, pose = self.motors.joints, frame.pose
        self._t = self.folder.clock(frame.t)
        self.folder.rows.append([[self._t, self.run, *joints, *self.force, *pose]])
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


def _run_all(
    scenario: Scenario, device: BenchRobot, person: Person, reading_age: float, said: Callable[[str], None]
) -> None:
    """All runs that are not in the folder yet."""
    done = {(entry["mass_g"], entry["repetition"]) for entry in finished(device.folder)}
    hung = None if person.weight_left or any(scenario.load.mass_g) else 0.0  # None: it must be looked at
    for mass, repetition in product(scenario.load.mass_g, range(1, scenario.repetitions + 1)):
        if (mass, repetition) in done:
            continue
        if mass != hung:
            person.hang(scenario.force(mass))
            hung = mass
        run = _run(scenario, device, mass, repetition, reading_age)
        error = f", mean error {1e3 * run.counted.mean():.3f} mm" if run.started else ""
        said(f"{mass:g} g, run {repetition}: {run.verdict()}{error}")
    if hung:  # the next measurement begins without a weight
        person.hang(np.zeros(3))


def _run(scenario: Scenario, device: BenchRobot, mass: float, repetition: int, reading_age: float) -> Run:
    motors, tracker, folder = device.motors, device.tracker, device.folder
    known, start = device.robot.actuation, scenario.start
    beta = 1e-3 * np.array(start.beta_mm) - known.translation_correction  # as the motors count
    motors.move(np.concatenate([beta, np.deg2rad(start.alpha_deg) - known.rotation_correction]))
    motors.wait(tracker.next)  # frames that nobody fetches would be missed
    entries = folder.about.setdefault("runs", [])
    entry = {"run": len(entries) + 1, "mass_g": mass, "repetition": repetition, "ended": "interrupted"}
    entries.append(entry)
    folder.save()  # rows of a run that is cut off keep their number
    values = system_values(device.robot)
    tracker.discard()
    with Progress(f"{mass:g} g, run {repetition}", 1.0) as progress:
        device.run, device.force, device.advance = entry["run"], scenario.force(mass), progress.advance
        run = run_once(scenario, values, device, mass, repetition, reading_age)
    if len(run.time):
        run = replace(run, tip=tips_at(run.time, run.time + reading_age, run.tip))
    motors.halt()
    motors.wait(tracker.next)
    for rows in (folder.rows, device.control):
        rows.sync()
    entry |= {"ended": "finished", "status": run.status, "settled_m": run.settled}
    folder.save()
    return run
