"""How the robot moved by a log: times, runs, joints and known forces."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from functools import partial

import numpy as np

from ctcr.arrays import Array, Integers, Mask
from ctcr.errors import InputError, Problem
from ctcr.intake import fields, units
from ctcr.intake.choices import Choices
from ctcr.intake.columns import DEG_FROM, RAD_UP_TO, STRONGEST_N, Columns, angle_unit, length_unit
from ctcr.intake.names import quantity
from ctcr.intake.units import Unit, named
from ctcr.robot.description import Robot
from ctcr.show.wording import counted, join, listed
from ctcr.table import measurements
from ctcr.table.csv_table import Faults

FORCE = ("fx", "fy", "fz")


@dataclass
class Motion:
    """M rows of a log with N tubes; NaN where a field was missing."""

    t: Array  # (M,) [s]
    zero: float  # the time of the log's clock at t = 0 [s]
    run: Array  # (M,)
    beta: Array  # (M, N) [m]
    alpha: Array  # (M, N) [rad]
    force: Array  # (M, 3) [N]
    rows: Integers  # (M,) of the file

    def only(self, kept: Mask) -> "Motion":
        arrays = {one.name: getattr(self, one.name)[kept] for one in fields_of(self) if one.name != "zero"}
        return replace(self, **arrays)


def of(columns: Columns, robot: Robot | None) -> Motion:
    """The motion that a log holds."""
    t, zero = times(columns)
    beta = _from_home(columns, _joints(columns, "beta", length_unit), robot)
    alpha = _joints(columns, "alpha", partial(_sure_angle_unit, columns))
    run = _runs(columns, t)
    _add_to_runs(columns, run, {"beta": beta, "alpha": alpha})
    columns.doubts += _jumps(columns, run, alpha)
    columns.doubts += _impossible(columns, robot, beta) if robot else []
    return Motion(t, zero, run, beta, alpha, _force(columns, robot), columns.log.rows)


def _jumps(columns: Columns, run: Array, alpha: Array) -> Iterator[Problem]:
    """The doubt where angles that stay within a turn jump by one, up to a step as the tube often makes."""
    steps = np.abs(np.diff(alpha, axis=0)[np.diff(run) == 0])
    small = np.where((steps > 0) & (steps < np.pi), steps, np.nan)
    often = np.array([np.nanmedian(one) if np.isfinite(one).any() else 0.0 for one in small.T])
    span = np.nanmax(alpha, axis=0, initial=-np.inf) - np.nanmin(alpha, axis=0, initial=np.inf)
    jumps = (np.abs(steps - 2 * np.pi) <= often) & (span <= RAD_UP_TO)
    if jumps.any():
        tubes = join([f"alpha{i}" for i in 1 + np.flatnonzero(jumps.any(axis=0))])
        text = f"jumps by nearly a whole turn, {jumps.sum()} times: if the log wraps angles, --unwrap alpha"
        yield Problem(text, str(columns.log.path), field=tubes)


def _impossible(columns: Columns, robot: Robot, beta: Array) -> Iterator[Problem]:
    """The doubt where tubes end where the model allows no tip, or hardly move; a fault where that is so in all rows."""
    file, length = str(columns.log.path), robot.lengths
    known = np.isfinite(beta).all(axis=1)
    beta, rows, faulty = beta[known], columns.log.rows[known], Faults(file)
    measurements.check("beta", beta, rows, ["beta"] * len(length), faulty)
    if faulty.total or not len(rows):  # the table says what is wrong with the joints themselves
        return
    largest = np.abs(beta).max()
    if 0 < largest < 1e-3 * length.min():
        text = f"beta is at most {1e3 * largest:.2g} mm, of tubes {1e3 * length.min():g} mm long and more"
        yield Problem(f"{text}: is its unit right, or is it --unit beta=m?", file)
    front, slack = length + beta, measurements.JOINT_ORDER_SLACK_M
    wrong = (front < -slack).any(axis=1) | (np.diff(front, axis=1) > slack).any(axis=1)
    text = "a tube of the robot ends behind the plate or inside an outer tube: are the unit (--unit beta=mm), --order, "
    text += "--translation and the lengths in ROBOT right?"
    if wrong.all():
        columns.faults.add(1, None, f"in every row {text}")
    elif wrong.any():
        yield Problem(f"in {row_ranges(rows[wrong])} {text}", file)


def times(columns: Columns) -> tuple[Array, float]:
    """Times (M,) [s], NaN without a column of them, and what the log's clock showed at zero [s]."""
    if not columns.has("t"):
        return np.full(len(columns.log), np.nan), 0.0
    used, asked = columns.mapping.used["t"], columns.choices.units.get("t")
    stated = used.unit if used.unit and used.unit.quantity else None
    asked = None if columns.beside and stated else asked
    unit = units.parsed(asked, "time", "--unit t") if asked else stated
    day = columns.mapping.used["date"].column if columns.has("date") else None
    read = fields.times(columns.log, used.column, unit, columns.choices.missing, columns.faults, day)
    if columns.has("nsec"):
        read = _with_parts(columns, read)
    columns.units["t"] = read.unit, "values" if read.guessed else "option" if asked else used.how
    if read.start:
        columns.notes.append(f"t_s = 0 is {read.start}")
    return read.seconds, read.zero


def _with_parts(columns: Columns, read: fields.Times) -> fields.Times:
    """Times whose second is in one column, and the nanoseconds after it in another."""
    parts = 1e-9 * columns.values("nsec")
    columns.units["nsec"] = named("ns"), "name"
    first = float(parts[0]) if read.start else 0.0  # a stamp counts from the first row
    return replace(read, seconds=read.seconds + parts - first, zero=read.zero + first)


def complete(columns: Columns, motion: Motion) -> Mask:
    """Rows that have a run, all joints and a force. The others are noted with their numbers."""
    kept = np.ones(len(motion.rows), dtype=bool)
    joints = np.column_stack([motion.beta, motion.alpha])
    for name, values in (("joints", joints), ("force", motion.force), ("run", motion.run[:, None])):
        lacking = kept & ~np.isfinite(values).all(axis=1)
        if lacking.any():
            columns.notes.append(f"without {name}, {row_ranges(motion.rows[lacking])}: dropped")
        kept &= ~lacking
    return kept


def row_ranges(rows: Integers) -> str:
    """Numbers of rows as ranges: 8 rows (3 to 9, 12)."""
    starts = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) > 1)
    ends = np.append(starts[1:] - 1, len(rows) - 1)
    ranges = [f"{rows[a]}" if a == b else f"{rows[a]} to {rows[b]}" for a, b in zip(starts, ends, strict=True)]
    return f"{counted(len(rows), 'row')} ({listed(ranges)})"


def _joints(columns: Columns, kind: str, guess) -> Array:
    """One kind of joint (M, N) in SI units with its signs and offsets."""
    choices = columns.choices
    roles = [f"{kind}{i}" for i in range(1, columns.mapping.n_tubes + 1)]
    logged = [role for role in roles if columns.has(role)]
    values = dict(zip(logged, columns.si(kind, logged, guess).T, strict=True)) if logged else {}
    for role in roles:
        if role not in values:
            constant = units.value(choices.constants[role], quantity(kind), f"--constant {role}")
            values[role] = np.full(len(columns.log), constant)
            continue
        if (role in choices.flip) != (kind in choices.flip):
            values[role] = -values[role]
        for key in (role, kind):
            if key in choices.offsets:
                values[role] = values[role] + units.value(choices.offsets[key], quantity(kind), f"--offset {key}")
        if {role, kind} & set(choices.unwrap):
            known = np.isfinite(values[role])
            values[role][known] = np.unwrap(values[role][known])
    return np.column_stack([values[role] for role in roles]) + 0.0  # no negative zeros


def _sure_angle_unit(columns: Columns, size: float) -> Unit:
    if RAD_UP_TO < size < DEG_FROM:
        text = f"angles up to {size:.3g} may be rad or deg: say it with --unit alpha=deg or --unit alpha=rad"
        columns.faults.add(1, None, text)
    return angle_unit(size)


def _from_home(columns: Columns, beta: Array, robot: Robot | None) -> Array:
    """beta of translations that are travel from somewhere."""
    choices, n = columns.choices, columns.mapping.n_tubes
    if choices.translation in (None, "beta"):
        return beta
    home = _home(choices, robot, n)
    columns.notes.append(f"beta is travel + home; home is {', '.join(f'{1e3 * h:g}' for h in home)} mm")
    moves = [f"beta{i}" not in choices.constants for i in range(1, n + 1)]
    return beta + np.where(moves, home, 0.0)


def _home(choices: Choices, robot: Robot | None, n: int) -> Array:
    """beta [m] (N,) where the travel is zero."""
    if choices.home_mm is not None:
        if len(choices.home_mm) != n:
            raise InputError(Problem(f"has {len(choices.home_mm)} values: needs {n}, one a tube", field="--home-mm"))
        return 1e-3 * np.array(choices.home_mm)
    if robot is None:
        text = (
            "travel becomes beta by the lengths or homes of the tubes: give --robot ROBOT, or beta at home, --home-mm"
        )
        raise InputError(Problem(text, field=f"--translation {choices.translation}"))
    if choices.translation == "from-home":
        return 1e-3 * np.array(robot.actuation.home_translation_mm)
    return -robot.lengths  # all tips at the plate


def _add_to_runs(columns: Columns, run: Array, joints: dict[str, Array]) -> None:
    """Adds the offsets that concern one run alone."""
    for key, text in columns.choices.offsets.items():
        joint, at, number = key.partition("@")
        if not at:
            continue
        rows, kind = run == float(number), joint.rstrip("123456789")
        tubes = slice(int(joint[-1]) - 1, int(joint[-1])) if joint != kind else slice(None)
        if not rows.any() or not joints[kind][:, tubes].size:
            raise InputError(Problem(f"there is no {joint} in a run {number}", field=f"--offset {key}"))
        joints[kind][rows, tubes] += units.value(text, quantity(kind), f"--offset {key}")


def _runs(columns: Columns, t: Array) -> Array:
    if not columns.has("run"):
        return _runs_by_time(t, columns.notes)
    column, words = columns.mapping.used["run"].column, columns.choices.missing
    run, texts = fields.labels(columns.log, column, words, columns.faults)
    if texts:
        columns.notes.append("runs: " + listed([f"{i} = {text or '(empty)'}" for i, text in enumerate(texts)]))
    return run


def _runs_by_time(t: Array, notes: list[str]) -> Array:
    """Runs (M,) of a log that names none. A run begins where the clock starts again, nearer to the first time of the
    last run than to its end, and goes on from there. Rows out of order, or back in time, begin none."""
    first, made = 0, np.zeros(len(t))
    for i in np.flatnonzero(t[1:] < t[:-1]) + 1:
        last, after = t[i - 1], t[i + 1 : i + 2]
        if 2 * t[i] < t[first] + last and ((t[i] <= after) & (after < last)).any():
            first, made[i:] = i, made[i] + 1
    if first:
        notes.append(f"times start again: {int(made[-1]) + 1} runs")
    return made


def _weight(columns: Columns, robot: Robot | None) -> Array:
    """Forces (M, 3) [N] of a weight hung at the tip."""
    down = np.zeros(3) if robot is None else robot.gravity_vector
    if not down.any():
        name = columns.mapping.used["weight"].name
        text = "a weight needs the direction of gravity: give --robot ROBOT, whose gravity is known"
        raise InputError(Problem(f"{text}, or --ignore {name}", str(columns.log.path), field=name))
    columns.notes.append(f"{columns.mapping.used['weight'].name} is taken as a weight at the tip, along gravity")
    return columns.si("force", ["weight"], partial(_force_unit, columns)) * down / np.linalg.norm(down)


def _force_unit(columns: Columns, size: float) -> Unit:
    if size > STRONGEST_N:
        text = f"forces up to {size:.4g} without a unit are no N at a tip: say it with --unit force=mN (g, N, ...)"
        columns.faults.add(1, None, text)
    return named("N")


def _force(columns: Columns, robot: Robot | None) -> Array:
    """Forces (M, 3) [N]; axes that the log lacks are zero."""
    roles, flip = [role for role in FORCE if columns.has(role)], columns.choices.flip
    force = np.zeros((len(columns.log), 3))
    if columns.has("weight"):
        force += _weight(columns, robot)
    if roles:
        force[:, [FORCE.index(role) for role in roles]] += columns.si("force", roles, partial(_force_unit, columns))
    signs = [-1.0 if (role in flip) != ("force" in flip) else 1.0 for role in FORCE]
    return force * signs + 0.0
