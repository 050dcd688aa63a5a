"""A log, or a log of poses and one of joints, as a table of measurements."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake import mapping, motion, sensor, together, units
from ctcr.intake.choices import Choices
from ctcr.intake.columns import Columns
from ctcr.intake.log import Log
from ctcr.intake.motion import Motion
from ctcr.intake.poses import Pose
from ctcr.intake.stacked import unstacked
from ctcr.robot.description import Robot
from ctcr.show.wording import join, listed
from ctcr.table import measurements
from ctcr.table.csv_table import Faults
from ctcr.table.measurements import Measurements


@dataclass
class Imported:
    """The table, and the columns that it came from; those of a log of joints apart."""

    table: Measurements
    sources: list[Columns]

    @property
    def notes(self) -> list[str]:
        return [note for source in self.sources for note in source.notes]


def convert(log: Log, choices: Choices, robot: Robot | None = None, joints: Log | None = None) -> Imported:
    """The table of a log; of its poses with the motion of `joints` at their times, where that is another log.

    Raises InputError with all faults of one kind: of the columns, then of single fields, then of values.
    """
    n_tubes = robot.n_tubes if robot else None
    log, choices = unstacked(log, choices)
    of_poses, of_joints = (choices, choices) if joints is None else together.divided(choices, log, joints)
    beside = joints is not None
    columns = moving = Columns(log, mapping.of(log, of_poses, 0 if beside else n_tubes), of_poses, beside)
    if joints is not None:
        moving = Columns(joints, mapping.of(joints, of_joints, n_tubes, poses=False), of_joints, beside)
    _check_joints(moving)
    moved = motion.of(moving, robot)
    pose = sensor.of(columns)
    t, zero = motion.times(columns) if beside else (moved.t, moved.zero)
    shift = units.value(choices.offsets["t"], "time", "--offset t") if "t" in choices.offsets else None
    columns.faults.raise_any()
    moving.faults.raise_any()
    if beside:
        moved = together.at(columns, moving, moved, t, zero, shift)
    else:
        moved.t = moved.t + (shift or 0.0)
    kept = motion.complete(columns, moved)
    moved = moved.only(kept)
    if not len(moved.rows):
        raise InputError(Problem("has no row with all joints", str(moving.log.path)))
    poses = (None, None) if pose is None else (pose.position, pose.quaternion)
    position, quaternion = (None if part is None else part[kept] for part in poses)
    _check_values(columns, moving, moved, position, quaternion)
    driven = moved.t, moved.run.astype(np.int64), moved.beta, moved.alpha, moved.force
    warnings = [*_doubts(columns, moved), *moving.doubts]
    table = Measurements(*driven, position, quaternion, moved.rows, warnings=warnings)
    columns.notes += _idle(columns, moving, pose)
    if not columns.has("t"):
        columns.notes.append("no column of times: effects of speed and delay cannot be found")
    return Imported(table, [columns] if joints is None else [columns, moving])


def _idle(columns: Columns, moving: Columns, pose: Pose | None) -> Iterator[str]:
    """Notes on options that concern what the log lacks."""
    choices, turned = columns.choices, pose is not None and pose.quaternion is not None
    forces = any(moving.has(role) for role in (*motion.FORCE, "weight"))
    for option, said, there, what in (
        ("--flip force", "force" in choices.flip, forces, "force"),
        ("--quaternion", choices.quaternion is not None, columns.has("qw"), "quaternion"),
        ("--invert-quaternion", choices.invert_quaternion, turned, "rotation"),
        ("--invert-pose", choices.invert_pose, turned, "rotation"),
        ("--euler", choices.euler is not None, columns.has("rx"), "angle"),
        ("--mirror", choices.mirror is not None, pose is not None, "position"),
        ("--offset t", "t" in choices.offsets, columns.has("t"), "time"),
    ):
        if said and not there:
            yield f"{option} has no effect here: there is no {what}"


def _check_joints(columns: Columns) -> None:
    log, used, choices = columns.log, columns.mapping.used, columns.choices
    n = columns.mapping.n_tubes
    named = [*choices.flip, *choices.units, *choices.offsets, *choices.constants]
    high = [name for name in named if (found := re.match(r"(?:beta|alpha)(\d)", name)) and int(found[1]) > n > 0]
    if high:
        raise InputError(Problem(f"there are {n} tubes: no {join(high)}", str(log.path)))
    wanted = [f"{kind}{i}" for i in range(1, n + 1) for kind in ("beta", "alpha")]
    missing = [role for role in wanted if role not in used and role not in choices.constants]
    if len(missing) == len(wanted):
        text = "no column looks like a joint: name them with --column beta1=NAME, --column alpha1=NAME, ..."
        text += "" if columns.beside else ", or all in their order with --columns t,beta1..beta2,alpha1..alpha2,x,y,z"
        if log.is_stated:
            text = f"an export of {log.kind} holds no joints: give their log with --joints FILE"
        elif all(name.startswith("#") for name in log.names):
            text = "it has no header: name its columns in their order, such as --columns t,beta1..beta2,alpha1..alpha2"
            if columns.beside:
                text = "it has no header: write a line above it, such as t,beta1,beta2,alpha1,alpha2, which names its"
                text += " columns in their order, with nothing between commas for one that does not count"
    elif missing:
        still = "0mm where it never moves" if missing[0].startswith("beta") else "0deg where it never turns"
        text = (
            f"no column looks like {join(missing)}: give --column {missing[0]}=NAME, or --constant {missing[0]}={still}"
        )
    else:
        return
    raise InputError(Problem(f"{text} (not used: {listed(columns.unused, 30)})", str(log.path)))


def _check_values(columns: Columns, moving: Columns, moved: Motion, position, quaternion) -> None:
    """The checks of the table's format, with the rows and columns of the log."""
    faults, n = Faults(str(columns.log.path)), moved.beta.shape[1]
    values = vars(moved) | {"position": position, "quaternion": quaternion}
    for group, names in measurements.group_columns(n).items():
        if values[group] is None:
            continue
        roles = [name.partition("_")[0] for name in names]
        source = columns if group in ("position", "quaternion") else moving
        block = values[group].reshape(len(moved.rows), -1)
        measurements.check(group, block, moved.rows, [source.name(role) for role in roles], faults)
    if faults.total:
        found, hint = faults.problems(), _hint(moved.beta, columns.choices)
        raise InputError([*found, *([Problem(hint)] if hint else [])], faults.total - len(found))


def _hint(beta: Array, choices: Choices) -> str:
    """The probable cause of impossible joints, as a hint."""
    far = (np.abs(beta) > measurements.QUANTITIES["beta"].usual[1]).any(axis=1)
    if 0 < far.mean() < 0.5:
        return "if it stands for what is missing, say so as it stands in the log, such as --missing -9999"
    if far.any():
        return "if these are counts of an encoder, say how long one is, such as --unit beta=0.0025mm"
    if (beta >= 0).all() and choices.translation is None:
        return (
            "beta is where a tube is grasped: 0 at the front plate, negative behind it. Positive columns are often"
            " travel from flush tips (--translation from-flush --robot ROBOT) or from home (--translation from-home"
            " --robot ROBOT), or distances behind the plate (--flip beta): docs/formats.md draws them"
        )
    if beta.shape[1] > 1 and np.mean(beta[:, 0] > beta[:, -1]) > 0.5:
        return "beta grows from inner to outer tubes: if the log has the outermost first, --order outermost-first"
    return ""


def _doubts(columns: Columns, moved: Motion) -> Iterator[Problem]:
    """Times that look wrong."""
    steps = np.diff(moved.t)[moved.run[1:] == moved.run[:-1]]
    steps = steps[np.isfinite(steps)]
    if not len(steps) or "t" not in columns.units:
        return
    name, file = columns.name("t"), str(columns.log.path)
    if back := int((steps <= 0).sum()):
        todo = f"put them in order, or do without times: --ignore {columns.mapping.used['t'].name}"
        yield Problem(f"{back} rows do not come after the row before them: {todo}", file, field=name)
