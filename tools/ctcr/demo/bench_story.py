"""The story of `ctcr demo bench`: from a robot that nobody knows to one that does what its model says."""

import shutil
from functools import partial
from pathlib import Path

import numpy as np

from ctcr.arrays import Array
from ctcr.bench.record.folder import TABLE
from ctcr.demo import blind_drive
from ctcr.demo.story import Story
from ctcr.effects import catalogue
from ctcr.frames import points_to_tracker
from ctcr.model import simulation
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.table import measurements
from ctcr.track import scenario

FILES = Path(__file__).parent / "bench"
BENCH = "--bench bench.yaml"
KNOWN = "known.yaml"  # the robot file after the procedures
RECORDED = "{rows} poses, {rms_mm:.2f} mm RMS off the model"
ROBOTS = {"calibrated": "without friction", "with_effect": "with friction"}  # in the model
EFFECT, VALUE = "friction", 0.02  # coefficient of every tube
SEED = 4
SHIFT_MM, TURN_DEG = ((9.0, -6.0, 7.0), (3.0, -2.5, 2.0))  # of the tracker, and of the tubes at home, if misplaced


def hidden_robot(known: Robot, misplaced: bool) -> Robot:
    """The robot on the bench: off its file `known` in all calibrated parameters, with an effect that the file lacks."""
    built = simulation.as_built(known, np.random.default_rng(SEED))
    if misplaced:
        built.tracker.position_mm = list(np.add(built.tracker.position_mm, SHIFT_MM))
        built.actuation.home_rotation_deg = list(np.add(built.actuation.home_rotation_deg, TURN_DEG))
    values = {f"effects.{EFFECT}.coefficient.{i + 1}": VALUE for i in range(known.n_tubes)}
    return catalogue.with_values(built, [EFFECT], values)


def tell(story: Story, short: bool = False) -> None:
    """Runs the story in its folder, beside the simulators. `short` leaves out what only illustrates."""
    for file in FILES.iterdir():
        shutil.copy(file, story.folder)
    _find_the_joints(story, short)
    _find_the_effect(story, short)
    _add_the_effect(story, short)
    if not short:
        _track(story)


def _find_the_joints(story: Story, short: bool) -> None:
    if short:
        story.do("Find the joints", f"move robot.yaml {BENCH} --at-home", "taken from their marks")
    else:
        story.do("See which devices answer", f"devices {BENCH}", _devices, "devices")
        found = "each tube flush with the plate in turn: its length says where it is"
        story.do("Find the joints", f"move robot.yaml {BENCH} --home", found)
    why = "Touch six points with the probe: where the tracker stands"
    live = f"--live {BENCH} --readings 5 --robot robot.yaml -o registered.yaml"
    story.do(why, f"calibrate registration points.csv --cad cad.csv {live}", _registered, "registration")
    if short:
        shutil.copy(story.folder / "registered.yaml", story.folder / KNOWN)
        return
    live = f"--live {BENCH} --readings 2 --step-deg 60 --robot registered.yaml -o {KNOWN}"
    why = "Turn one tube after the other, alone, for the home rotations"
    story.do(why, f"calibrate rotation-offset circles.csv {live}", _turned, "circles")


def _find_the_effect(story: Story, short: bool) -> None:
    dwell, first, second = 0.05 if short else 0.2, "first/measurements.csv", "second/measurements.csv"
    story.do("Measure: all tubes turn by 40 degrees and back", _record(KNOWN, "first", dwell), RECORDED, "first")
    if not short:
        off = "by {position_mm[rms]:.2f} mm RMS, where noise alone would be {noise[rms_mm]:.2f} mm"
        story.do("How wrong is the model?", f"compare {KNOWN} {first}", off, "compared")
        story.do("Which effect is missing?", f"diagnose {KNOWN} {first}", _diagnosed, "first_diagnosis")
    story.do("Ask for the runs that decide", f"next {KNOWN} {first} --runs 2 -o second.csv", _proposed, "proposal")
    if story.answers["proposal"]["runs"]:
        story.do("Measure them", _record(KNOWN, "second", dwell), RECORDED, "second")
        story.do("Put both recordings together", f"join {KNOWN} {first} {second} -o both.csv", "both.csv")
    else:  # the first recording has decided
        shutil.copy(story.folder / first, story.folder / "both.csv")
    story.do("Which effect is missing?", f"diagnose {KNOWN} both.csv", _diagnosed, "diagnosis")


def _add_the_effect(story: Story, short: bool) -> None:
    table = "both.csv"
    if not short:
        table = "all.csv"
        story.do("Measure all over the workspace", _record(KNOWN, "workspace"), RECORDED, "workspace")
        story.do("Join it", f"join {KNOWN} both.csv workspace/measurements.csv -o {table}", table)
    fit = f"calibrate fit {KNOWN} {table} -o calibrated.yaml"
    story.do("Calibrate alone, to compare", fit, "{rms_mm[held_out]:.2f} mm RMS on held-out runs", "calibrated")
    add = f"add {KNOWN} --diagnosis diagnosis.json --fit {table} -o with_effect.yaml"
    story.do("Add the effect that was found", add, _added, "added")


def _track(story: Story) -> None:
    """Along the edges of a cube, first by the model alone, then with the tracker's help."""
    corners = cube(story.folder)
    start = scenario.load(story.folder / "cube.yaml", robot_file.load(story.folder / "robot.yaml").n_tubes).start
    joints = np.concatenate([1e-3 * np.array(start.beta_mm), np.deg2rad(start.alpha_deg)])
    for robot, name in ROBOTS.items():
        blind = f"blind_{robot}"
        loaded = robot_file.load(story.folder / f"{robot}.yaml")
        simulation.write(blind_drive.drive(loaded, joints, corners), story.folder / f"{blind}.csv")

        off = partial(_off_the_cube, story.folder / blind / TABLE, corners, loaded.n_tubes)
        story.do(f"Drive along a cube blindly, by the model {name}", _record(f"{robot}.yaml", blind), off, blind)
    for robot, name in ROBOTS.items():
        track = f"track {robot}.yaml cube.yaml --live {BENCH} -o track_{robot}"
        story.do(f"Track the cube at 40 Hz, by the model {name}", track, _tracked, f"track_{robot}")


def _record(robot: str, name: str, dwell: float = 0.2) -> str:
    return f"record {robot} {name}.csv {BENCH} --dwell {dwell} -o {name}"


def cube(folder: Path) -> Array:
    """Corners of the cube (P, 3) [m] in the order of its tour, in the tracker frame that calibration alone found."""
    robot = robot_file.load(folder / "calibrated.yaml")
    path = scenario.load(folder / "cube.yaml", robot.n_tubes).trajectory
    return points_to_tracker(robot.tracker, path.points)


# ---- results of the commands, in words


def _devices(told) -> str:
    return f"{len(told['devices'])} devices and tools answer"


def _registered(told) -> str:
    origin = [value for value in told["values"] if value["name"].startswith("origin")]
    moved = np.linalg.norm([value["value"] - value["old"] for value in origin])
    return f"{moved:.1f} mm from where the file says"


def _turned(told) -> str:
    offsets = [value for value in told["values"] if value["name"].endswith("rotation offset")]
    return ", ".join(f"{value['value']:.1f} ± {value['sd']:.1f}" for value in offsets) + " deg from their marks"


def _off_the_cube(recording: Path, corners: Array, n_tubes: int, _) -> str:
    tips = measurements.load(recording, n_tubes).position[-len(corners) :]
    return f"{1e3 * np.linalg.norm(tips - corners, axis=1).mean():.2f} mm off the cube"


def _diagnosed(told) -> str:
    named = " and ".join(" or ".join(effect["class"]) for effect in told["effects"]) or "nothing"
    return f"{told['verdict'].replace('_', ' ')}: {named.replace('_', ' ')}"


def _proposed(told) -> str:
    masses = ", ".join(f"{1e3 * run['mass_kg']:g} g" for run in told["runs"])
    rivals = ", or ".join(told["rivals"]).replace("_", " ")
    return f"{len(told['runs'])} runs decide whether it is {rivals} (weights at the tip: {masses})"


def _tracked(told) -> str:
    (figures,) = told["weights"].values()
    return f"{figures['mean_mm']:.2f} mm mean, {figures['max_mm']:.2f} mm largest error"


def _added(told) -> str:
    (name,) = told["added"]
    return f"{told['rms_mm'][name]:.2f} mm RMS on held-out runs"
