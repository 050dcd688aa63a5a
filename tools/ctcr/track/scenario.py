"""A scenario file: the path of the tip, the tasks and limits of the controller, the surroundings, and the repetitions.

Fields carry their unit in their name; the properties and `ctcr.track.runs` give SI units. Positions are those of the
sensor in the base frame of the robot that is controlled: they stand in space, and a controller with another T_ref sees
them elsewhere. Defaults of the tasks are the paper's (Boyer et al., Section IV).
"""

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Len
from pydantic import Field, PrivateAttr

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.robot import yaml_document
from ctcr.robot.checks import problems, validated
from ctcr.robot.description import BELOW, Section, Three
from ctcr.robot.units import Quantity

# All twelve edges of a cube: three are travelled twice, as each of its eight corners has three edges. Bit k of a
# corner's number says at which end of axis k it lies.
CUBE_TOUR = (0, 1, 3, 2, 0, 4, 5, 1, 5, 7, 3, 7, 6, 2, 6, 4)
TASKS = ("tracking", "damping", "limit avoidance", "obstacle avoidance", "stability margin", "posture")

Lengths = Annotated[list[float] | None, Quantity("mm", usual=(0, 2000), count="one number a tube,")]
Weight = Annotated[list[float], Len(2, 2), Quantity("", count="two numbers, of translation and rotation,", least=0)]


class Trajectory(Section):
    """The path of the tip, from rest to rest: a polyline rests at each corner, a spline only at its ends."""

    kind: Literal["cube", "polyline", "spline"] = Field(description="cube, polyline or spline")
    corner_mm: Annotated[Three | None, Quantity("mm", usual=(0, 1000), count="three numbers")] = None
    side_mm: Annotated[float, Quantity("mm", usual=(1, 200), above=0)] = 30.0
    points_mm: list[Three] | None = Field(None, description="a list of points of three numbers in mm")
    speed_mm_s: Annotated[float, Quantity("mm/s", usual=(0.05, 200), above=0)] = 5.0
    acceleration_mm_s2: Annotated[float, Quantity("mm/s^2", usual=(0.05, 5000), above=0)] = 2.5

    @property
    def points(self) -> Array:
        """(K, 3) [m]."""
        if self.kind != "cube":
            return 1e-3 * np.array(self.points_mm)
        bits = np.array([[corner >> axis & 1 for axis in range(3)] for corner in CUBE_TOUR])
        return 1e-3 * (np.array(self.corner_mm) + self.side_mm * bits)


class Start(Section):
    """The joints from which the robot moves to the start of the path, and how long it may take."""

    beta_mm: Annotated[list[float], Quantity("mm", usual=(0, 2000), count="one number a tube,")]
    alpha_deg: Annotated[list[float], Quantity("deg", usual=(0, 720), count="one number a tube,")]
    settle_s: Annotated[float, Quantity("s", usual=(0.1, 600), least=0)] = 20.0


class Tasks(Section):
    """Weights [of translation, of rotation] and settings; a weight of 0 leaves a task out. Paper, Section IV.B.

    The second weight of tracking demands the orientation of the base frame: the tip points along z, without a turn.
    """

    tracking: Weight = [1e7, 0.0]
    damping: Weight = [1e6, 10.0]
    limit_avoidance: Weight = [100.0, 0.0]
    obstacle_avoidance: Weight = [10.0, 0.0]
    stability_margin: Weight = [0.0, 0.0]
    posture: Weight = [0.0, 0.0]
    feedback_per_s: Annotated[float, Quantity("1/s", usual=(0.1, 80), above=0)] = 32.0
    fastest_feedback_mm_s: Annotated[float, Quantity("mm/s", usual=(0.1, 500), above=0)] = 20.0
    limit_rate_per_s: Annotated[float, Quantity("1/s", usual=(1e-3, 1e4), least=0)] = 100.0
    obstacle_strength_m3_s: Annotated[float, Quantity("m^3/s", usual=(1e-6, 100), least=0)] = 0.1
    stability_wanted: Annotated[float, Quantity("", usual=(0.01, 1), least=0)] = 0.3
    posture_beta_mm: Lengths = None
    posture_alpha_deg: Annotated[list[float] | None, Quantity("deg", usual=(0, 720), count="one number a tube,")] = None
    posture_rate_per_s: Annotated[float, Quantity("1/s", usual=(1e-3, 10), least=0)] = 0.1

    @property
    def weights(self) -> Array:
        """(tasks, 2), in the order of TASKS."""
        return np.array([getattr(self, name.replace(" ", "_")) for name in TASKS])


class Limits(Section):
    """Hard limits of every step. `at_limits` hold: as the paper; redistribute: the other joints take over."""

    base_gap_mm: Annotated[float, Quantity("mm", usual=(0.1, 300), least=0)] = 2.0
    tip_gap_mm: Annotated[float, Quantity("mm", usual=(0.1, 300), least=0)] = 2.0
    translation_mm_s: Annotated[float, Quantity("mm/s", usual=(1, 1000), above=0)] = 100.0
    rotation_deg_s: Annotated[float, Quantity("deg/s", usual=(5, 5000), above=0)] = 570.0
    beta_low_mm: Lengths = None
    beta_high_mm: Lengths = None
    at_limits: Literal["hold", "redistribute"] = Field("hold", description="hold or redistribute")


class Obstacle(Section):
    """A ball that the tip must not touch."""

    centre_mm: Annotated[Three, Quantity("mm", usual=(0, 1000), count="three numbers")]
    radius_mm: Annotated[float, Quantity("mm", usual=(0.1, 200), above=0)]


class TipLoad(Section):
    """Weights that hang at the tip, and the direction of their pull, base frame."""

    mass_g: Annotated[list[float], Len(1), Quantity("g", usual=(0.1, 500), least=0, count="a list of numbers")] = [0.0]
    direction: Annotated[Three, Quantity("", usual=(0, 1), count="three numbers")] = [0.0, -1.0, 0.0]
    controller: Literal["unknown", "known", "estimated"] = Field("unknown", description="unknown, known or estimated")


class Scenario(Section):
    """The whole file."""

    name: str = Field(description="text")
    about: str = Field("", description="text")
    rate_Hz: Annotated[float, Quantity("Hz", usual=(1, 5000), above=0)] = 40.0
    trajectory: Trajectory = Field(description=BELOW)
    start: Start = Field(description=BELOW)
    tasks: Tasks = Field(default_factory=Tasks, description=BELOW)
    limits: Limits = Field(default_factory=Limits, description=BELOW)
    obstacle: Obstacle | None = Field(None, description=BELOW)
    load: TipLoad = Field(default_factory=TipLoad, description=BELOW)
    noise_mm: Annotated[float, Quantity("mm", usual=(1e-4, 5), least=0)] = 0.035
    noise_deg: Annotated[float, Quantity("deg", usual=(1e-4, 5), least=0)] = 0.0
    repetitions: Annotated[int, Field(ge=1, le=1000, description="a whole number from 1 to 1000")] = 10
    _source: yaml_document.YamlDocument | None = PrivateAttr(None)

    def problem(self, text: str, *path: str) -> Problem:
        """A fault of a field, with file and line where it comes from a file."""
        return problems([(path, text)], self._source)[0]

    def force(self, mass_g: float) -> Array:
        """Pull of a weight (3,) [N], base frame."""
        direction = np.array(self.load.direction)
        return 9.80665e-3 * mass_g * direction / np.linalg.norm(direction)


def shipped(name: str) -> Scenario:
    """One of the scenarios that come with the package, for three tubes: S1 to S4 of the paper, and S5."""
    text = (files("ctcr") / "track" / "scenarios" / f"{name}.yaml").read_text(encoding="utf-8")
    return parse(text, name, 3)


def load(path: str | Path, n_tubes: int) -> Scenario:
    """The scenario of a file for a robot of so many tubes. Raises InputError with all faults of the file."""
    return _scenario(yaml_document.load(path), n_tubes)


def parse(text: str, file: str, n_tubes: int) -> Scenario:
    """The scenario described by a text; `file` is its name in errors. Raises InputError with all its faults."""
    return _scenario(yaml_document.parse(text, file), n_tubes)


def _scenario(document: yaml_document.YamlDocument, n_tubes: int) -> Scenario:
    if not isinstance(document.data, dict):
        text = "does not describe a scenario: no fields such as name, trajectory, start"
        raise InputError(Problem(text, document.file))
    scenario = validated(Scenario, document)
    if faults := [*_relations(scenario, n_tubes), *_unusual(scenario)]:
        raise InputError(problems(faults, document))
    scenario._source = document
    return scenario


def _relations(s: Scenario, n: int):
    """Faults (path, message) of fields that do not go together."""
    t, tasks = s.trajectory, s.tasks
    if t.kind == "cube" and t.corner_mm is None:
        yield ("trajectory", "corner_mm"), f"is missing: a cube needs {Trajectory.expected('corner_mm')}"
    if t.kind != "cube":
        least = 4 if t.kind == "spline" else 2
        if len(np.unique(np.array(t.points_mm or np.empty((0, 3))), axis=0)) < least:
            yield ("trajectory", "points_mm"), f"a {t.kind} needs at least {least} different points"
        elif t.kind == "spline" and (np.linalg.norm(np.diff(t.points_mm, axis=0), axis=1) == 0).any():
            yield ("trajectory", "points_mm"), "a point of a spline may not follow itself"
    per_tube = {
        "start": ("beta_mm", "alpha_deg"),
        "tasks": ("posture_beta_mm", "posture_alpha_deg"),
        "limits": ("beta_low_mm", "beta_high_mm"),
    }
    for path in ((section, field) for section, fields in per_tube.items() for field in fields):
        values = getattr(getattr(s, path[0]), path[1])
        if values is not None and len(values) != n:
            yield path, f"has {len(values)} values: this robot needs {n}, one a tube"
    if any(tasks.posture) and not (tasks.posture_beta_mm and tasks.posture_alpha_deg):
        yield ("tasks", "posture"), "needs posture_beta_mm and posture_alpha_deg"
    if not min(tasks.damping) > 0:
        yield ("tasks", "damping"), "both weights must be above 0: without damping the step is not determined"
    if not tasks.tracking[0] > 0:
        yield ("tasks", "tracking"), "its first weight must be above 0: nothing else follows the path"
    if not np.linalg.norm(s.load.direction) > 0:
        yield ("load", "direction"), "has no length"
    if tasks.feedback_per_s > 2 * s.rate_Hz:
        text = f"{tasks.feedback_per_s:g} 1/s is unstable at {s.rate_Hz:g} Hz: at most twice the rate"
        yield ("tasks", "feedback_per_s"), text
    points = "corner_mm" if t.kind == "cube" else "points_mm"
    lengths = {
        ("trajectory", points): getattr(t, points),
        ("start", "beta_mm"): s.start.beta_mm,
        ("obstacle", "centre_mm"): s.obstacle and s.obstacle.centre_mm,
    }
    for path, values in lengths.items():
        if values and np.abs(values).max() < 1:
            yield path, "all below 1 mm: is this m?"
    if s.obstacle and getattr(t, points):
        if np.linalg.norm(1e3 * t.points[0] - s.obstacle.centre_mm) <= s.obstacle.radius_mm:
            yield ("obstacle", "centre_mm"), "the obstacle lies on the start of the path: move one of them"


def _unusual(s: Scenario):
    """Values that look like another unit: in a file that moves a robot they are faults."""
    first: dict[tuple, str] = {}  # of each field
    for path, quantity, value in s.unusual():
        first.setdefault(tuple(step for step in path if isinstance(step, str)), quantity.doubt(value))
    yield from first.items()
