"""Which rows of a table are fitted and which are held out to judge the fit.

Rows are never split singly, because neighbours on a path share their error. Runs stay together; where there are too few
runs, blocks of time do, or regions of joint space with every pass through them.
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ctcr import settings
from ctcr.arrays import Array, Integers, Mask, scattered
from ctcr.compare.crossvalidation import split
from ctcr.compare.sample import follow
from ctcr.errors import InputError, Problem
from ctcr.model import parameters, user_recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.show.wording import NAMED, runs_named
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Split:
    """`part` (M,) of each row, from 0; `kind`: what was kept together, runs or places (of joint space)."""

    kind: str
    part: Integers


def few_of(rows: Mask, least: int | None = None) -> Mask | None:
    """At least `least` (default: FEW_ROWS) of many rows (M,), evenly spread; None of fewer than twice as many."""
    chosen = np.flatnonzero(rows)
    every = len(chosen) // (least or settings.FEW_ROWS)
    if every < 2:
        return None
    few = np.zeros_like(rows)
    few[chosen[::every]] = True
    return few


def part_of(rows: Mask, most: int) -> Mask:
    """At most `most` of some rows (M,), spread over all of them and over every part of the runs."""
    chosen = np.flatnonzero(rows)
    few = np.zeros_like(rows)
    few[chosen[scattered(len(chosen), most)]] = True
    return few


def growing(rows: Mask) -> list[Mask]:
    """Growing parts of some rows (M,), the last all of them: the fit to each starts where the fit to the part before
    ended. Few rows are one part."""
    most = int(settings.FEW_PART * np.sum(rows))
    few = part_of(rows, most) if most >= 2 * settings.FEW_ROWS else few_of(rows)
    return [rows] if few is None else [*growing(few), rows]


def parts_of(readings: Measurements, lever: float, parts: int) -> Split | None:
    """The table in `parts` equal parts, each spread over the whole; None where it is too small for that.

    `lever` [m]: the tip's usual distance from the insertion axis, which makes rotations comparable with translations.
    """
    runs, index = np.unique(readings.run, return_inverse=True)
    if len(runs) >= max(settings.FEWEST_RUNS, parts):
        return Split("runs", index % parts)
    cell = _regions(readings, lever)
    return Split("places", cell % parts) if cell.max() + 1 >= 2 * parts else None


def runs_left_out(readings: Measurements, count: int) -> Split:
    """`count` runs, evenly spread, as part 1, all others as part 0. Raises InputError where too few are left."""
    runs, index = np.unique(readings.run, return_inverse=True)
    if count >= len(runs):
        text = f"--hold-out {count} needs more than {count} runs: the table has {len(runs)}"
        hint = "; leave it out, and places in joint space are held out" if len(runs) < settings.FEWEST_RUNS else ""
        raise InputError(Problem(text + hint))
    chosen = ((np.arange(count) + 0.5) * len(runs) / count).astype(int)
    return Split("runs", np.isin(index, chosen).astype(np.int64))


def groups(measurements: Measurements) -> Integers:
    """The group of each row (M,), numbered from 0 in the order of measuring: its run, or a block of time where there
    are too few runs. Rows and runs without a pose do not count: each group holds something measured."""
    measured = measurements.measured
    runs, first = np.unique(measurements.run[measured], return_index=True)
    if len(runs) >= settings.FEWEST_RUNS:
        order = {run: i for i, run in enumerate(runs[np.argsort(first)])}
        return np.array([order.get(run, 0) for run in measurements.run])
    return np.maximum(np.cumsum(measured) - 1, 0) * settings.TIME_BLOCKS // max(np.sum(measured), 1)


def each_fold(group: Integers) -> Iterator[Mask]:
    """The rows (M,) of each fold of a cross-validation: one of every FOLDS groups (M,)."""
    return (group % settings.FOLDS == fold for fold in range(settings.FOLDS))


def held_out_rows(robot: Robot, measurements: Measurements, turn: int = 0, fitted: Collection[int] = ()) -> Mask:
    """One of every four groups (M,); `turn` 0 to 3 says which. The groups `fitted` are never held out.

    A held-out group that goes where no other one went cannot judge a model: the others do not determine what it shows.
    It is exchanged for one that they cover. Joints, loads and the model decide that, not poses.
    """
    group, measured = groups(measurements), measurements.measured
    few, known, folds = few_of(measured), np.unique(group), settings.FOLDS
    first = np.array(settings.HELD_OUT_ORDER)[known // folds % len(settings.HELD_OUT_ORDER)]
    held_out = known[known % folds == (first + turn) % folds].tolist()
    coverage = Coverage(robot, measurements, measured if few is None else few, group)
    for _ in range(settings.EXCHANGES if held_out else 0):
        left = coverage.undetermined(held_out)
        left[np.isin(sorted(held_out), list(fitted))] = np.inf
        if left.max() <= settings.MOST_UNDETERMINED:
            break
        rest = sorted(held_out)
        rest.pop(int(np.argmax(left)))
        others = [k for k in known if k not in held_out and k not in fitted]
        worst = {k: coverage.undetermined([*rest, k]).max() for k in others}
        best = min(worst, key=worst.get, default=None)
        if best is None or worst[best] >= left.max():
            break
        held_out = [*rest, best]
    return np.isin(group, held_out)


def named(measurements: Measurements, held_out: Mask) -> str:
    """The groups of some held-out rows (M,) for people; empty without any."""
    if not held_out.any():
        return ""
    runs = np.unique(measurements.run[held_out])
    if np.isin(measurements.run[~held_out], runs).any():
        return "one of every four blocks of time"
    if len(runs) > NAMED:
        return f"{len(runs)} of {len(np.unique(measurements.run))} runs"
    return runs_named(runs)


def _regions(readings: Measurements, lever: float) -> Integers:
    """The region of joint space of each row (M,), numbered from 0."""
    motion = follow(readings.t, readings.run, readings.beta, readings.alpha, lever)
    rows, label, _ = split(np.zeros_like(readings.run), motion.scaled)
    return label[cKDTree(motion.scaled[rows]).query(motion.scaled)[1]]


class Coverage:
    """How well some groups of rows determine the poses of others: their Fisher information on the standard calibration.

    It follows from joints, loads and the model alone, not from measured poses. `rows` (M,) count, `group` (M,) from 0.
    """

    def __init__(self, robot: Robot, measurements: Measurements, rows: Mask, group: Integers) -> None:
        self._linearisations = [_information(J, group) for J in _linearisations(robot, measurements, rows)]

    def undetermined(self, held_out: Iterable[int]) -> Array:
        """Mean square error of the position in each held-out group (in ascending order) that a calibration by the
        others leaves, over that of the tracker's jitter."""
        held_out, left = sorted(held_out), []
        for total, information, of_position in self._linearisations:
            covariance = np.linalg.inv(total - information[held_out].sum(axis=0))
            left.append(np.einsum("ij,gji->g", covariance, of_position[held_out]) / 3)
        return np.max(left, axis=0)


def _information(jacobian: Array, group: Integers) -> tuple[Array, Array, Array]:
    """Information on the parameters, prior included (k, k), that of each group (G, k, k), and of its mean position."""
    whole, position = np.zeros((2, group.max() + 1, *2 * jacobian.shape[-1:]))
    for k in range(len(whole)):
        own = jacobian[group == k]
        whole[k] = np.einsum("mai,maj->ij", own, own)
        position[k] = np.einsum("mai,maj->ij", own[:, :3], own[:, :3]) / max(1, np.sum(own.any(axis=(1, 2))))
    return np.eye(jacobian.shape[-1]) + whole.sum(axis=0), whole, position


def _linearisations(robot: Robot, measurements: Measurements, rows: Mask) -> Iterable[Array]:
    """Derivatives of poses (M, 6, k) by the standard parameters, in units of jitter and prior sd; 0 in other rows.

    At curved lengths as stated, longer and shorter by their sd: where a curve starts near the plate, that decides which
    readings depend on its length.
    """
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    noise = noise_of_readings(robot, measurements, field=False)
    jitter = np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    model = user_recording.recording_of(robot, measurements, names)
    model.activate(rows.tolist())
    curves = np.array([name.endswith(".curved_length") for name in names])
    for side in (0.0, 1.0, -1.0):
        at = np.clip(mean + side * curves * sd, low, high)
        jacobian = model.residual(at, True)[1].reshape(len(measurements), 6, len(names))
        yield np.where(np.isfinite(jacobian), jacobian, 0.0) * sd / jitter[:, None]
