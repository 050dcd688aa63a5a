"""Runs that were homed elsewhere than the others: one joint of one run is off by a constant."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.conventions import orientation, tips
from ctcr.conventions.calibrated import calibrated
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change, changed, joints
from ctcr.conventions.search import PRIOR, Case, with_run_frames
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.show.wording import short
from ctcr.table.measurements import Measurements


@dataclass(frozen=True)
class Offset:
    """One joint of one run is off by a constant, SI, which is to be added to it."""

    run: int
    kind: str  # beta or alpha
    tube: int  # from 0
    size: float

    def change(self, readings: Measurements) -> Measurements:
        move = self.size * (np.arange(readings.beta.shape[1]) == self.tube)
        here = (readings.run == self.run)[:, None]
        return changed(self.kind, lambda q: q + np.where(here, move, 0.0))(readings)

    @property
    def width(self) -> float:
        """Standard deviation of such an offset before it is known."""
        return settings.CONVENTION_SCAN[self.kind]

    def finding(self, before: Case, after: Case) -> Finding:
        unit, size, digits = ("deg", np.degrees(self.size), 1) if self.kind == "alpha" else ("mm", 1e3 * self.size, 2)
        [name] = joints(self.kind, (self.tube,))
        text = f"run {self.run} was homed elsewhere: {name} stands {short(abs(size))} {unit} off"
        fix = f"ctcr import --offset {name}@{self.run}={size:.{digits}f}{unit}, or leave this run out"
        errors = (before.fit.rms_mm, after.fit.rms_mm)
        return Finding("run_offset", text, (name,), fix, runs=(self.run,), rms_mm=errors)


def homed_elsewhere(case: Case) -> tuple[Finding, Change, Case] | None:
    """An offset of one run that is likelier than none, than another frame of this run, and than one of every run; the
    change that corrects it, and the corrected case.
    """
    runs = np.unique(case.readings.run)
    if len(runs) < settings.FEWEST_RUNS:
        return None
    prior, odds = PRIOR + np.log(len(runs)), np.log(2 * case.robot.n_tubes)
    estimates = _estimates(case, runs)
    tried = [one for run in _suspects(estimates, runs, prior + odds) for one in _tried(case, int(run), prior + odds)]
    if not tried:
        return None
    gains = [moved.gain(case) for _, moved in tried]
    offset, moved = tried[int(np.argmax(gains))]
    rivals = (
        with_run_frames(case, (offset.run,)).gain(case) - prior,
        with_run_frames(case, runs).gain(case),
        _with_every_offset(case, runs, offset, estimates).gain(case),
    )
    if max(gains) + settings.TIE < max(settings.TIE, *rivals):
        return None
    if abs(offset.size) < _stated(case.robot, offset):
        return None  # no more than homing differs
    mine = case.readings.run == offset.run
    given, turned = (orientation.error_deg(moved.fit.robot, one.readings.rows(mine)) for one in (case, moved))
    if given < settings.CONVENTION_CLEAR * turned:
        return None  # the orientations deny it
    for _ in range(2):
        fit = _fitted(case, offset)
        offset = replace(offset, size=offset.size + fit.offset)
    after = replace(case, readings=offset.change(case.readings), fit=fit)
    return offset.finding(case, after), offset.change, after


def _stated(robot: Robot, offset: Offset) -> float:
    """Standard deviation of a home as the robot file states it, SI."""
    if offset.kind == "beta":
        return 1e-3 * robot.uncertainty.of("translation_offset_mm", offset.tube)
    return np.deg2rad(robot.uncertainty.of("rotation_offset_deg", offset.tube))


def _fitted(case: Case, offset: Offset):
    """All rows fitted, with a further offset of this run."""
    motion = "translation" if offset.kind == "beta" else "rotation"
    own = f"actuation.home_{motion}.{offset.tube + 1}", offset.width, case.readings.run == offset.run
    return calibrated(case.robot, offset.change(case.readings), offset=own)


def _by_joints(robot: Robot, readings: Measurements) -> Array:
    """Derivatives (K, 3, 2, N) of positions in the tracker frame by beta and alpha; 0 where there is no solution."""
    beta, alpha = robot.joints_of_table(readings.beta, readings.alpha)
    found = Model(robot.standard).predict(beta, alpha, readings.force, derivatives=True).jacobian[:, :3]
    return np.nan_to_num(robot.tracker.rotation @ found).reshape(len(readings), 3, 2, robot.n_tubes)


@dataclass(frozen=True)
class Estimates:
    """The small offset of each joint of each run that fits it best, by linearisation: arrays (R, 2, N), SI."""

    size: Array
    square: Array  # sum of the squared derivatives by it
    by: Array  # (K, 3, 2, N) these
    variance: float  # [m^2] of a reading, each axis

    @property
    def chi_square(self) -> Array:
        """That the offset explains, where errors are white."""
        return self.size**2 * self.square / self.variance

    @property
    def information(self) -> Array:
        return self.square / self.variance


def _estimates(case: Case, runs: Array) -> Estimates:
    by, fit = _by_joints(case.fit.robot, case.readings), case.fit
    both = np.einsum("ka,kaij->kij", np.nan_to_num(fit.residual), by), np.sum(by**2, axis=1)
    along, square = (np.array([part[case.readings.run == run].sum(axis=0) for run in runs]) for part in both)
    square = np.maximum(square, np.finfo(float).tiny)
    return Estimates(along / square, square, by, max(fit.typical, fit.floor) ** 2 / 3)


def _suspects(estimates: Estimates, runs: Array, needed: float) -> Array:
    """The runs of which an offset explains most, if that may be so much."""
    explained = estimates.chi_square.max(axis=(1, 2))
    order = np.argsort(-explained)[: settings.CONVENTION_LIKELY]
    return runs[order[explained[order] > needed]]


def _with_every_offset(case: Case, runs: Array, offset: Offset, estimates: Estimates) -> Case:
    """The case in which this joint has an offset of its own in every run, as something that is not known may cause."""
    i = ("beta", "alpha").index(offset.kind)
    size, information = estimates.size[:, i, offset.tube], estimates.information[:, i, offset.tube]
    width = max(float(np.sqrt(np.mean(size**2))), np.finfo(float).tiny ** 0.5)
    residual = (
        case.fit.residual - estimates.by[:, :, i, offset.tube] * size[np.searchsorted(runs, case.readings.run), None]
    )
    more = 0.5 * np.sum(np.log1p(information * width**2) + (size / width) ** 2)
    return replace(case, fit=replace(case.fit, residual=residual, improbable=case.fit.improbable + more))


def _tried(case: Case, run: int, prior: float) -> Iterator[tuple[Offset, Case]]:
    """The best offset of each joint of a run, and its case; the others alone are calibrated."""
    mine, n = case.readings.run == run, case.robot.n_tubes
    like = calibrated(case.robot, case.readings.rows(~mine))
    by = np.sum(_by_joints(like.robot, case.readings.rows(mine)) ** 2, axis=(0, 1))
    for i, kind in enumerate(("beta", "alpha")):
        for tube in range(n):
            offset = _scanned(like.robot, case.readings, mine, Offset(run, kind, tube, 0.0))
            readings = offset.change(case.readings)
            predicted = tips.predicted(like.robot, readings)
            residual = readings.position - predicted @ like.robot.tracker.rotation.T - like.robot.tracker.position
            size = max(like.typical, like.floor, settings.CONVENTION_FINEST)
            known = 0.5 * np.log1p(3 * by[i, tube] * (offset.width / size) ** 2)
            fit = replace(like, residual=residual, improbable=like.improbable + known + prior)
            yield offset, replace(case, readings=readings, fit=fit)


def _scanned(robot: Robot, readings: Measurements, mine: Mask, offset: Offset) -> Offset:
    """The offset that fits its run best, by ever finer grids."""
    rows, half, n = readings.rows(mine), offset.width, settings.CONVENTION_SCAN_POINTS
    count, size = len(rows), 0.0
    for _ in range(settings.CONVENTION_SCANS):
        grid = size + np.linspace(-half, half, n)
        tried = rows.rows(np.tile(np.arange(count), n))
        getattr(tried, offset.kind)[:, offset.tube] += np.repeat(grid, count)
        error = np.nan_to_num(tips.errors(robot, tried).reshape(n, count), nan=settings.CONVENTION_UNSOLVED)
        size, half = float(grid[np.argmin(np.median(error, axis=1))]), 2 * half / (n - 1)
    return replace(offset, size=size)
