"""Poses of one log and joints of another, by the clock that both share."""

from dataclasses import replace

import numpy as np

from ctcr.arrays import Array
from ctcr.errors import InputError, Problem
from ctcr.intake.choices import Choices
from ctcr.intake.columns import Columns
from ctcr.intake.log import Log
from ctcr.intake.mapping import MOVING
from ctcr.intake.motion import Motion, complete, row_ranges
from ctcr.show.wording import listed

SAME_S = 1e-9  # [s] by which a count times its period may be off by rounding


def divided(choices: Choices, poses: Log, joints: Log) -> tuple[Choices, Choices]:
    """The choices that concern the log of the poses, and those that concern the log of the joints: names of times or of
    columns to ignore, the log that has them; the size of a count as a unit of time, the log whose times are named."""

    def part(log: Log, other: Log, wanted: bool) -> Choices:
        def mine(name: str) -> bool:
            return log.find(name) is not None or log is poses and other.find(name) is None

        times = ("t", "nsec", "date")
        named = choices.columns.items()
        columns = {r: n for r, n in named if (mine(n) if r in times else (r.rstrip("123456789") in MOVING) == wanted)}
        counts = "t" in choices.columns and choices.units.get("t", "")[:1].isdigit()
        unused = {"t"} if counts and "t" not in columns else ()
        units = {role: unit for role, unit in choices.units.items() if role not in unused}
        ignore = [name for name in choices.ignore if mine(name)]
        return choices.model_copy(update={"columns": columns, "units": units, "ignore": ignore})

    of_joints = part(joints, poses, True)
    return part(poses, joints, False), of_joints.model_copy(update={"sensor": None, "relative_to": None})


def at(columns: Columns, moving: Columns, moved: Motion, t: Array, zero: float, shift: float | None) -> Motion:
    """The motion of a log of joints in each row of a log of poses.

    By their times [s], between which joints move in straight lines; row by row where neither log has times. `zero` is
    what the poses' clock shows at their t = 0, and `shift` is added to their times. Clocks of two kinds (a date, a time
    of day, or neither) begin at t = 0 of both tables and need a shift. Raises InputError where times do not meet.
    """
    rows, file = columns.log.rows, str(moving.log.path)
    timed = [np.isfinite(times).any() for times in (t, moved.t)]
    if not any(timed):
        if len(rows) != len(moved.rows):
            text = f"has {len(moved.rows)} rows, the log of the poses {len(rows)}, and neither has times"
            raise InputError(Problem(text, file))
        columns.notes.append(f"neither log has times: joints of {moving.log.path.name} are taken row by row")
        return replace(moved, rows=rows)
    if not all(timed):
        lacking, other = (moving, columns) if timed[0] else (columns, moving)
        text = f"has no times, {other.log.path.name} has: name its column with --column t=NAME; a number of the frame"
        text += ", at 60 a second, takes --unit t=16.667ms too; where both logs count frames, import that of the joints"
        text += " alone first, and give --joints what it wrote"
        if len(rows) == len(moved.rows):
            text += f"; where the logs belong together row by row, --ignore {other.mapping.used['t'].name}"
        unused = listed(lacking.unused, 30)
        raise InputError(Problem(f"{text} (not used: {unused})", str(lacking.log.path)))
    known = moved.only(complete(moving, moved) & np.isfinite(moved.t))
    if not len(known.rows):
        raise InputError(Problem("has no row with a time and all joints", file))
    if (np.diff(known.t) < 0).any():
        text = "its times run backwards: joints cannot be found by time"
        raise InputError(Problem(text, file, field=moving.name("t")))
    alike = np.sign(zero) == np.sign(moved.zero)  # a time of day counts from 1900, a date from 1970, others from 0
    if not alike and shift is None:
        text = "its clock is of another kind than that of the poses: say what to add to the times of the poses, where"
        text += " times of day, and dates, count from the first row of their log, such as --offset t=12.5s"
        raise InputError(Problem(text, file, field=moving.name("t")))
    clock = t + (shift or 0.0) + (zero - moved.zero if alike else 0.0)  # of the poses, by the clock of the joints
    inside = (clock >= known.t[0] - SAME_S) & (clock <= known.t[-1] + SAME_S)
    if not inside.any():
        span = f"{known.t[0]:g} to {known.t[-1]:g} s, those of the poses {np.nanmin(clock):g} to {np.nanmax(clock):g} s"
        text = f"its times are {span}: say what to add to those of the poses, such as --offset t=12.5s"
        raise InputError(Problem(text, file, field=moving.name("t")))
    before = np.clip(np.searchsorted(known.t, clock, side="right") - 1, 0, None)

    def between(values: Array) -> Array:
        return np.column_stack([np.where(inside, np.interp(clock, known.t, one), np.nan) for one in values.T])

    step = float(np.median(np.diff(known.t))) if len(known.t) > 1 else 0.0
    columns.notes.append(f"joints of {moving.log.path.name} are interpolated between its rows, {step:.3g} s apart")
    if not inside.all():
        columns.notes.append(f"outside the times of {moving.log.path.name}: {row_ranges(rows[~inside])}")
    run = np.where(inside, known.run[before], np.nan)
    return Motion(t, zero, run, between(known.beta), between(known.alpha), between(known.force), rows)
