"""Writes docs/control_effects.md: what a missing effect costs in control, and what adding it brings.

A simulated robot differs from its file in every calibrated parameter, within the file's uncertainty, and in one effect.
It is measured (examples/data/plan.csv, realistic noise), calibrated and diagnosed; then controllers with the file, with
the calibration and with the effects that the diagnosis found drive it along the path of scenario S2.
"""

import numpy as np
from ctcr import add, diagnose
from ctcr.effects import catalogue
from ctcr.fit import joint
from ctcr.frames import points_to_base, points_to_tracker
from ctcr.model import simulation
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.table import measurements
from ctcr.table.measurements import Measurements
from ctcr.track import runs, scenario
from origin import ROOT, written_by

TARGET = ROOT / "docs" / "control_effects.md"
# The strength that is hidden, in standard deviations of its prior.
HIDDEN = {"friction": ("coefficient", 2.0), "softening": ("gamma", 2.0), "clearance": ("tilt", 2.0)}
SEED = 7
REPETITIONS = 10  # in closed loop
ABOUT = """A simulated robot differs from its file (Table II) in every calibrated parameter, drawn with half the file's
uncertainty, and in one hidden effect of two prior standard deviations: friction (a coefficient of 0.04), softening or
clearance. It was measured along `examples/data/plan.csv` with realistic noise, calibrated, diagnosed, and
then driven along the path of scenario S2. *Open loop*: the robot replays the joints that the controller planned on
what it knows. *Closed loop*: the tracker corrects at 40 Hz, in ten runs that differ in its noise; behind the mean, in
brackets, that of the best and of the worst run. Distances of the tip from the path; what lies near the obstacle is left
out. All robots begin at rest at the start of the path: friction remembers nothing before."""


def hidden_robot(robot: Robot, identity: str, rng: np.random.Generator) -> Robot:
    effect = catalogue.get(identity, robot.n_tubes)
    strength, size = HIDDEN[identity]
    hidden = next(p for p in effect.parameters if p.name == strength)
    values = dict.fromkeys(hidden.full_names, hidden.neutral + size * hidden.sigma)
    return catalogue.with_values(simulation.as_built(robot, rng), [identity], values)


def candidates(robot: Robot, session: Measurements) -> tuple[dict[str, Robot], str]:
    """What the controller may know of the robot, and what the diagnosis said."""
    known = {"robot file": robot, "calibrated": joint.fit(robot, session).apply(robot)}
    result = diagnose(robot, session)
    if result.accepted:
        known["with the effects found"] = add(robot, result, session).robot
    return known, f"{result.verdict.word}: {' + '.join(a.id for a in result.accepted) or 'nothing'}"


def closed_loop(plan: scenario.Scenario, controller: Robot, plant: Robot) -> list[np.ndarray]:
    """Distances of the tip from the path [mm], the corner near the obstacle left out, of each run that reaches it."""
    known, real = runs.system_values(controller), runs.system_values(plant)
    done = (runs.run_once(plan, known, real, 0.0, seed) for seed in range(1, REPETITIONS + 1))
    return [1e3 * run.counted for run in done if run.started]


def open_loop(plan: scenario.Scenario, controller: Robot, plant: Robot) -> np.ndarray:
    """The same where the robot replays the joints that the controller planned on its own model."""
    path, obstacle = plan.trajectory, plan.obstacle

    def seen(points_mm):  # by a controller whose T_ref is another one
        there = points_to_tracker(plant.tracker, 1e-3 * np.atleast_2d(points_mm))
        return (1e3 * points_to_base(controller.tracker, there)).tolist()

    own = plan.model_copy(
        update={
            "trajectory": path.model_copy(
                update={"kind": "polyline", "points_mm": seen(1e3 * path.points), "corner_mm": None}
            ),
            "obstacle": obstacle.model_copy(update={"centre_mm": seen(obstacle.centre_mm)[0]}),
            "noise_mm": 0.0,
        }
    )
    values = runs.system_values(controller)
    run = runs.run_once(own, values, values, 0.0)
    n, drive = plant.n_tubes, controller.actuation
    replay = Measurements.of_joints(
        run.joints[:, :n] - drive.translation_correction,
        run.joints[:, n:] - drive.rotation_correction,
        t=run.time,
        from_home=False,  # as the controller planned: at rest at the start of the path
    )
    read = simulation.simulate(plant, replay, "none")
    return 1e3 * np.linalg.norm(read.position - points_to_tracker(controller.tracker, run.wanted), axis=1)[run.far]


def row(name: str, open_: np.ndarray, closed: list[np.ndarray]) -> str:
    cells = f"| {name} | {np.nanmean(open_):.3f} | {np.nanmax(open_):.3f}"
    if not closed:
        return f"{cells} | failed | |"
    mean = [e.mean() for e in closed]
    spread = f"{np.mean(mean):.3f} ({min(mean):.3f} to {max(mean):.3f})"
    return f"{cells} | {spread} | {max(e.max() for e in closed):.3f} |"


def main() -> None:
    robot = robot_file.load(ROOT / "examples/robots/table2.yaml")
    plan = scenario.load(ROOT / "examples/data/scenarios/S2.yaml", robot.n_tubes)
    joints = measurements.load(ROOT / "examples/data/plan.csv", robot.n_tubes)
    lines = []
    for identity in HIDDEN:
        plant = hidden_robot(robot, identity, np.random.default_rng(SEED))
        known, verdict = candidates(robot, simulation.simulate(plant, joints, "realistic", SEED))
        known["the truth"] = plant
        lines += ["", f"## Hidden: {identity}; diagnosed: {verdict}", ""]
        lines += [
            "| the controller knows | open loop, mean mm | max | closed loop, mean mm | max |",
            "|---|---|---|---|---|",
        ]
        for name, controller in known.items():
            lines.append(row(name, open_loop(plan, controller, plant), closed_loop(plan, controller, plant)))
            print(identity, lines[-1], flush=True)
    head = ["# Control with a missing effect", "", ABOUT, written_by("tools/control_study.py")]
    TARGET.write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
