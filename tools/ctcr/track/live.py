"""A scenario on the bench: every weight and repetition, recorded as it happens; what was interrupted goes on."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from ctcr.bench.devices import bench_file
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person, person_of
from ctcr.bench.devices.tracker import RATE_HZ, Tracker
from ctcr.bench.record.folder import Folder
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.shared.folder import private_folder
from ctcr.errors import InputError, Problem
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.show.output import Progress
from ctcr.track import scenario as scenario_file
from ctcr.track.bench_robot import BenchRobot
from ctcr.track.recording import COLUMNS, CONTROL, finished, runs_of, tips_at
from ctcr.track.result import Run
from ctcr.track.runs import check, run_once, system_values
from ctcr.track.scenario import Scenario

PATIENCE_S = 2.0
MOST_ERROR_MM = 20.0
MOST_FEEDBACK = 0.375  # a period: a loop two periods late, as that of tracker and motors is, is unstable above 0.62


def track(
    target: str | Path,
    robot: str,
    scenario: str,
    bench: str,
    *,
    place: str | Path | None = None,
    patience_s: float = PATIENCE_S,
    most_error_mm: float = MOST_ERROR_MM,
    said: Callable[[str], None] = lambda text: None,
) -> tuple[list[Run], Scenario]:
    """Runs the scenario of a file on the bench of a file, into the folder `target`, and gives what became of it.

    The scenario that comes back is that `within` the bench. `place`: where the processes of the bench meet;
    `said` is told each run. Raises InputError for the files, DeviceFault where the devices stop; what was done until
    then is in the folder, and the same call goes on behind the last whole run.
    """
    place, sources = private_folder(place), {"robot": robot, "scenario": scenario, "bench": bench}
    loaded, devices = robot_file.load(robot), bench_file.load(bench)
    wanted = within(scenario_file.load(scenario, loaded.n_tubes), devices, loaded)
    check(wanted, loaded, loaded)
    with Tracker(devices, place, patience_s) as tracker, Motors(devices, loaded, place) as motors:
        motors.connect()
        tracker.connect()
        folder = Folder(target, sources, {}, loaded.n_tubes, synced=False)
        age = 1e-3 * devices.tracker.reading_age_ms
        tracking = _Tracking(loaded, wanted, motors, tracker, folder, 1e-3 * most_error_mm, age)
        with folder.sitting(motors, tracker), closing(tracking):
            tracking.run(person_of(devices, place), said)
    return runs_of(folder, wanted, loaded, age), wanted


def within(scenario: Scenario, bench: Bench, robot: Robot) -> Scenario:
    """The scenario with the limits of the bench where they are tighter, less the way in which the joints brake.

    Feedback is no more than the bench stands. Raises InputError where the tracker has another rate.
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
    changes = {
        "limits": limits.model_copy(update=tighter),
        "tasks": tasks.model_copy(update={"feedback_per_s": feedback}),
    }
    return scenario.model_copy(update=changes)


class _Tracking:
    def __init__(
        self,
        robot: Robot,
        scenario: Scenario,
        motors: Motors,
        tracker: Tracker,
        folder: Folder,
        most_error: float,
        reading_age: float,
    ):
        self._robot, self._scenario, self._motors, self._tracker = robot, scenario, motors, tracker
        self._folder, self._most_error, self._reading_age = folder, most_error, reading_age
        self._control = RowFile(folder.path / CONTROL, COLUMNS, synced=False)

    def run(self, person: Person, said: Callable[[str], None]) -> None:
        """All runs that are not in the folder yet."""
        done = {(entry["mass_g"], entry["repetition"]) for entry in finished(self._folder)}
        hung = 0.0
        for mass in self._scenario.load.mass_g:
            for repetition in range(1, self._scenario.repetitions + 1):
                if (mass, repetition) in done:
                    continue
                if mass != hung:
                    person.hang(self._scenario.force(mass))
                    hung = mass
                run = self._one(mass, repetition)
                error = f", mean error {1e3 * run.counted.mean():.3f} mm" if run.started else ""
                said(f"{mass:g} g, run {repetition}: {run.verdict()}{error}")
        if hung:  # whoever measures next begins without a weight
            person.hang(np.zeros(3))

    def _one(self, mass: float, repetition: int) -> Run:
        motors, entries = self._motors, self._folder.about.setdefault("runs", [])
        motors.move(self._start())
        motors.wait(self._tracker.next)  # frames that nobody fetches would be missed
        entry = {"run": len(entries) + 1, "mass_g": mass, "repetition": repetition, "ended": "interrupted"}
        entries.append(entry)
        self._folder.save()  # rows of a run that is cut off keep their number
        values = system_values(self._robot)
        self._tracker.discard()
        with Progress(f"{mass:g} g, run {repetition}", 1.0) as progress:
            device = BenchRobot(
                self._robot,
                motors,
                self._tracker,
                self._folder.clock,
                self._folder.rows,
                self._control,
                entry["run"],
                self._scenario.force(mass),
                self._most_error,
                progress.advance,
            )
            run = run_once(self._scenario, values, device, mass, repetition, self._reading_age)
        if len(run.time):
            run = replace(run, tip=tips_at(run.time, run.time + self._reading_age, run.tip))
        motors.halt()
        motors.wait(self._tracker.next)
        for rows in (self._folder.rows, self._control):
            rows.sync()
        entry |= {"ended": "finished", "status": run.status, "settled_m": run.settled}
        self._folder.save()
        return run

    def _start(self):
        """The start as the joints of a table: those that the motors know."""
        start, known = self._scenario.start, self._robot.actuation
        beta = 1e-3 * np.array(start.beta_mm) - known.translation_correction
        return np.concatenate([beta, np.deg2rad(start.alpha_deg) - known.rotation_correction])

    def close(self) -> None:
        self._control.close()
        self._folder.rows.close()
