"""The error of a hypothesis after all that a calibration may move: a short robust fit to few readings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.model import parameters, recording
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

# Where errors are jitter, over the floor: the typical error, exp E log sqrt(1 + chi^2_3 / 3), and the 90 % quantile.
JITTER_ALONE, MOST_JITTER = 1.366, 1.756


@dataclass(frozen=True)
class Calibrated:
    """A robot fitted to K readings, and the error that it leaves."""

    robot: Robot
    error: Array  # (K,) [m] distance of each reading from its prediction; NaN where the model has no solution
    floor: float  # [m] distance that jitter alone makes; 0: not stated
    # Of the positions over those of the table. Errors compare in the unit of the table: those of positions made a
    # thousand times smaller are smaller, but no likelier.
    scale: float = 1.0

    @property
    def solved(self) -> Mask:
        return np.isfinite(self.error)

    @property
    def log_error(self) -> Array:
        """Logarithm of the error (K,), in which a few outliers weigh little; jitter bounds it below."""
        missed = np.where(self.solved, self.error, settings.CONVENTION_UNSOLVED)
        return 0.5 * np.log((missed / self.scale) ** 2 + self.jitter**2)

    @property
    def jitter(self) -> float:
        """Size [m of the table] of the error that jitter makes."""
        return max(self.floor, settings.CONVENTION_FINEST) / self.scale

    @property
    def typical(self) -> float:
        """Geometric mean of the error [m of the table], which decides. Infinite where the model solves too few rows."""
        return float(np.exp(self.log_error.mean())) if self.solved.mean() > settings.CONVENTION_SOLVED else np.inf

    def at(self, rows: Mask) -> "Calibrated":
        """The same fit, judged by some readings (K,) only."""
        return replace(self, error=self.error[rows])

    @property
    def beyond_jitter(self) -> float:
        """The part [m of the table] of the typical error that jitter does not make."""
        return float(self._beyond_jitter[0])

    @property
    def _beyond_jitter(self) -> Array:
        """The part [m of the table] that jitter does not make: typical, and of the error that 90 % do not exceed."""
        sizes = np.array([self.typical, np.exp(np.quantile(self.log_error, 0.9))])
        return np.sqrt(np.maximum(sizes**2 - (np.array([JITTER_ALONE, MOST_JITTER]) * self.jitter) ** 2, 0.0))

    def left_of(self, before: "Calibrated") -> Array:
        """The remaining fraction of the error beyond jitter: typical, and of 90 % of the readings."""
        with np.errstate(invalid="ignore"):  # neither is solved
            return self._beyond_jitter / np.maximum(before._beyond_jitter, 1e-150)

    def beats(self, before: "Calibrated") -> bool:
        """Whether the typical error fell far towards that of jitter and not by chance, and that of 90 % fell too."""
        typical, most = self.left_of(before)
        return bool(typical < settings.CONVENTION_CLEAR and most < 1) and before._exceeds(self.typical)

    @property
    def may_be_beaten(self) -> bool:
        """Whether it is more than jitter."""
        return self._exceeds(JITTER_ALONE * self.jitter)

    def _exceeds(self, typical: float) -> bool:
        """Whether the likelihood of a smaller typical error [m of the table] outweighs the odds against a cause."""
        return 3 * len(self.error) * np.log(self.typical / typical) > settings.DECISIVE + settings.CONVENTION_UNLIKELY

    @property
    def rms_mm(self) -> float:
        """Root mean square of the error [mm], which is shown."""
        return 1e3 * float(np.sqrt(np.mean(self.error[self.solved] ** 2))) if self.solved.any() else np.inf


def calibrated(
    robot: Robot, readings: Measurements, *, free: tuple[str, ...] = (), to_beat: float = np.inf
) -> Calibrated:
    """The robot whose standard parameters fit the positions best, each near its value in the file.

    Data sheets err by more than they say: the stated standard deviations are widened, and those of parameters whose
    name begins with one of `free` say nothing.
    Errors have an unknown size, so that what no calibration explains does not drive the parameters anywhere. The fit
    gives up where it does not soon fall below an error `to_beat` [m].
    """
    names, mean, sd, low, high = _priors(robot, free)
    if free:
        chosen = np.array([name.startswith(free) for name in names])
        anywhere = np.array([np.pi if "rotation" in name else settings.CONVENTION_ANYWHERE for name in names])
        sd = np.where(chosen, anywhere, sd)
        low, high = np.where(chosen, mean - anywhere, low), np.where(chosen, mean + anywhere, high)
    table = recording.recording_of(robot, readings, names)
    values, floor = mean.copy(), np.sqrt(3) * 1e-3 * (robot.tracker.jitter_mm or 0.0)
    damping, found = settings.CONVENTION_DAMPING, None
    for iteration in range(settings.CONVENTION_ITERATIONS):
        if found is None:
            residual, jacobian = _positions(table, values)
            error = np.linalg.norm(residual, axis=1)
            solved = np.isfinite(error)
            if not names or solved.mean() <= settings.CONVENTION_SOLVED:  # all is known exactly, or nothing fits
                break
            size = max(float(np.median(error[solved])), floor, settings.CONVENTION_FINEST)
            if iteration >= settings.CONVENTION_PATIENCE and size > to_beat:
                break
            found = _cost(error, solved, size, (values - mean) / sd)
        weight = 1 / (size**2 + error[solved] ** 2)
        a = jacobian[solved] * np.sqrt(3 * weight)[:, None, None]
        a, b = a.reshape(-1, len(names)), (residual[solved] * np.sqrt(3 * weight)[:, None]).ravel()
        information = a.T @ a + np.diag(1 / sd**2)
        scaled = damping * np.diag(np.diag(information))
        step = np.linalg.solve(information + scaled, a.T @ b + (values - mean) / sd**2)
        tried = np.clip(values - step, low, high)
        missed = np.linalg.norm(table.residual(tried)[0].reshape(-1, 6)[:, :3], axis=1)
        cost = _cost(missed, solved, size, (tried - mean) / sd)
        if cost < found:
            settled = found - cost < settings.CONVENTION_SETTLED
            values, error, found, damping = tried, missed, None, damping / 10
            if settled:
                break
        else:
            damping *= 10
            if damping > settings.CONVENTION_MOST_DAMPING:
                break
    return Calibrated(parameters.applied(robot, names, values), error, floor)


def own_values(fit: Calibrated, readings: Measurements, which: Sequence[str]) -> Array:
    """Values (R,) that one parameter would have to take in each run, while all runs share the others; linearised.

    Of the parameters `which`, named as in `parameters.expand`, the one that explains the readings best; in units of its
    widened prior standard deviation times CONVENTION_JUMP.
    """
    names, mean, sd, _, _ = _priors(fit.robot, ())
    residual, jacobian = _positions(recording.recording_of(fit.robot, readings, names), mean)
    solved = np.isfinite(residual).all(axis=1)
    residual, jacobian = residual[solved], jacobian[solved] * sd
    runs, index = np.unique(readings.run, return_inverse=True)
    of_run = (index[solved, None] == np.arange(len(runs))) * settings.CONVENTION_JUMP
    best, found = np.inf, np.zeros(len(runs))
    for p in np.flatnonzero(np.isin(names, parameters.expand(which, fit.robot))):
        columns = np.concatenate([jacobian, jacobian[:, :, p, None] * of_run[:, None, :]], axis=2)
        left, flat = residual, columns.reshape(-1, columns.shape[2])
        for _ in range(settings.CONVENTION_ITERATIONS):
            error = np.linalg.norm(left, axis=1)
            size = max(float(np.median(error)), fit.floor, settings.CONVENTION_FINEST)
            weighted = flat.T * np.repeat(3 / (size**2 + error**2), 3)
            moved = np.linalg.solve(weighted @ flat + np.eye(flat.shape[1]), weighted @ residual.ravel())
            left = residual - (flat @ moved).reshape(-1, 3)
        typical = replace(fit, error=np.linalg.norm(left, axis=1)).typical
        if typical < best:
            best, found = typical, moved[len(names) :]
    return found


def _positions(table: Any, values: Array) -> tuple[Array, Array]:
    """Residual (K, 3) [m] of the positions of a recording, and its derivatives (K, 3, P) by the parameters."""
    residual, jacobian, _ = table.residual(values, True)
    rows = len(residual) // 6  # not -1: where all is known exactly there are no columns
    return residual.reshape(rows, 6)[:, :3], jacobian.reshape(rows, 6, len(values))[:, :3]


def _cost(error: Array, solved: Mask, size: float, shift: Array) -> float:
    """Minus the log posterior density: errors (K,) of Student's distribution, shifts of parameters in prior sd."""
    missed = np.where(np.isfinite(error), error, settings.CONVENTION_UNSOLVED)[solved]
    return 1.5 * float(np.sum(np.log1p((missed / size) ** 2))) + 0.5 * float(np.sum(shift**2))


def _priors(robot: Robot, free: tuple[str, ...]) -> tuple[list[str], Array, Array, Array, Array]:
    """Names, means, widened standard deviations and bounds of the standard parameters that are not known exactly, and
    of those whose name begins with one of `free`.

    Beyond CONVENTION_JUMP lies no data sheet, but another convention.
    """
    known = parameters.names_of(robot.n_tubes)
    chosen = {name: np.inf for name in known if name.startswith(free)}
    uncertain = {*chosen, *parameters.uncertain(robot)}
    names = [name for name in known if name in uncertain]
    mean, sd, low, high = parameters.priors(robot, names, chosen)
    far = np.array([jump(name, width) for name, width in zip(names, sd, strict=True)])
    # Positive values err by a factor, either way. So do curvatures: one of opposite sign is a home half a turn off.
    bent = np.array([".curvature" in name for name in names], dtype=bool) & (mean > 0)
    by_factor = (low >= 0) | bent
    least = np.divide(mean**2, mean + far, out=mean - far, where=by_factor)
    return names, mean, settings.CONVENTION_WIDER * sd, np.maximum(low, least), np.minimum(high, mean + far)


def jump(name: str, sd: float) -> float:
    """How far a parameter with this standard deviation is off at most by an error of the data sheet, SI."""
    far = settings.CONVENTION_JUMP * sd
    return min(far, np.deg2rad(settings.CONVENTION_MOST_JUMP_DEG)) if "rotation" in name else far


def dearer(numbers: int, readings: int) -> float:
    """By which factor the errors of a fit must fall to pay for more numbers, by the Bayesian information criterion."""
    return float(np.exp(0.5 * numbers * np.log(3 * readings) / (3 * readings)))
