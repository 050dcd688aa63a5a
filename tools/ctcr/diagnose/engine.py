"""Fits and linearisations of a robot with any effects: one table of measurements, one noise, one choice of rows."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Mask
from ctcr.audit import sensor_pose
from ctcr.diagnose.candidates import Candidate
from ctcr.diagnose.linearised import Linear
from ctcr.fit import folds, joint, one_sided
from ctcr.fit.result import Priors
from ctcr.fit.widening import Likelihood, Scales
from ctcr.model import parameters, recording, user_recording
from ctcr.model.noise import has_field
from ctcr.model.protocol import ResidualModel
from ctcr.model.sessions import told
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements
from ctcr.table.path import with_path

Progress = Callable[[str], None]


@dataclass
class Engine:
    robot: Robot
    measurements: Measurements
    noise: Any  # of the tracker, as stated
    rows: Mask  # that are fitted
    robust: bool = True  # whether outliers count for little
    threads: int = 0
    progress: Progress = lambda _: None  # is told each step
    free: str | Sequence[str] = "standard"  # calibration parameters that are fitted, as in parameters.expand
    tolerance: float = settings.TOLERANCE  # of log evidence, in fits for which no other is given
    steps: int = field(init=False)  # of integration
    positions: Array = field(init=False)  # of the sensor (M, 3) [m], tracker frame
    base: list[str] = field(init=False)  # names of the calibration parameters
    _equilibria: ResidualModel | None = field(init=False, default=None)  # those of the last fit, in its model
    _friction_path: ResidualModel | None = field(init=False, default=None)  # of the last fit with friction
    _scales: Scales = field(init=False, default_factory=dict)  # on the stated uncertainties, of the last fit

    def __post_init__(self) -> None:
        self.positions = joint.sensor_positions(self.robot, self.measurements)
        self.base = told(sensor_pose.with_pose(self.free, self.robot), self.measurements)
        self.steps = recording.steps_for(self.robot, self.measurements, self.noise, settings.INTEGRATION_ERROR_COARSE)

    @property
    def fitted(self) -> Mask:
        """Rows that hold something to fit."""
        return self.measurements.measured & self.rows

    def priors(self, names: Sequence[str]) -> tuple[Array, Array, Array, Array]:
        """Mean, standard deviation, lower and upper bound of parameters of the robot and of effects."""
        return parameters.priors(self.robot, names)

    def recording(self, names: Sequence[str], fixed: dict[str, float] | None = None) -> Any:
        return user_recording.recording_of(
            self.robot, self.measurements, names, fixed=fixed, steps=self.steps, threads=self.threads
        )

    def fit(
        self,
        added: Iterable[str] = (),
        *,
        start: dict[str, float] | None = None,
        fixed: dict[str, float] | None = None,
        weights: Array | None = None,
        noise: Any = None,
        positions: Array | None = None,
        tolerance: float | None = None,
        near: bool = False,
        like: ResidualModel | None = None,
        **options: Any,
    ) -> joint.Fit:
        """Fits the calibration and the `added` parameters of effects together; other effects keep their `fixed` values.

        near: the start is the optimum of a similar fit, so that a first fit to a part of many rows is not needed.
        like: the model of a similar fit; the rows start from its equilibria.
        Frozen `weights` of outliers and `inflation` of the noise, at the same `positions` of the sensor, make log
        evidences comparable. Without them the fit estimates both. Where the model is wrong, it inflates the noise, so
        that the calibration stays plausible. Other options as in fit_joint().
        """
        names = [*self.base, *added]
        priors = replace(Priors.of(self.robot, names, self.measurements.beta[self.rows]), scales=self._scales)
        at = dict(zip(names, priors.mean, strict=True)) | (start or {})
        at = np.clip([at[name] for name in names], priors.low, priors.high)
        table = self.recording(names, fixed)
        for known in (like, self._equilibria, self._friction_path):
            if type(known) is type(table):
                table.begin_at(known)
        if weights is None and not self.robust:
            weights = np.ones((len(self.measurements), 2))
        options |= {"start": at, "weights": weights, "tolerance": tolerance or self.tolerance, "few_first": not near}
        options["row"] = self.measurements.row
        positions = self.positions if positions is None else positions
        fitted = joint.fit_joint(table, priors, noise or self.noise, positions, self.fitted, **options)
        self._equilibria = table
        if table.friction_is_solved:
            self._friction_path = table
        if options.get("scales") is None:
            self._scales = fitted.priors.scales
        return fitted

    def fit_like(
        self, other: joint.Fit, added: Iterable[str] = (), start: dict[str, float] | None = None, **options: Any
    ) -> joint.Fit:
        """Like fit(), with the noise, positions, weights and inflation of another fit, so that their log evidences can
        be compared. It starts at the values of that fit, or at `start`, which lies near them."""
        options = {"noise": other.noise, "near": True, "like": other.model} | other.frozen | options
        return self.fit(added, start=values_of(other) if start is None else start, **options)

    def fit_with_field(
        self, added: Sequence[str], start: dict[str, float], fixed: dict[str, float] | None = None
    ) -> joint.Fit:
        """Like fit(), with the fraction of the tracker's stated field error that makes the readings likeliest, at the
        positions that the fit predicts; later fits take these."""

        def again(values: Array, like: joint.Fit | None) -> joint.Fit:
            from_there = dict(zip(full.names, map(float, values), strict=True))
            if like is None:
                return self.fit(added, start=from_there, fixed=fixed, near=True)
            return self.fit_like(like, added, from_there, fixed=fixed, tolerance=settings.COARSE)

        full = self.fit(added, start=start, fixed=fixed)
        full = one_sided.restarted(full, again)
        if not has_field(full.noise):
            return full
        self.positions = full.predicted_positions()
        noise = joint.with_likeliest_field(full, positions=self.positions).noise
        # Fitted anew, not linearised: far from the full model's values effects are not linear.
        return self.fit(added, start=values_of(full), fixed=fixed, noise=noise, first_weights=full.weights, near=True)

    def continued(self, fit: joint.Fit, fixed: dict[str, float] | None = None) -> joint.Fit:
        """A fit of the same rows taken on to this engine's tolerance, from its values and outliers, under its noise."""
        self._scales = fit.priors.scales
        self.positions = fit.predicted_positions()
        options = {"fixed": fixed, "noise": fit.noise, "first_weights": fit.weights, "like": fit.model, "near": True}
        return self.fit(effects_in(fit), start=values_of(fit), **options)

    def revise_initial_history(self, fit: joint.Fit, fixed: dict[str, float] | None = None) -> bool:
        """Whether the readings say that the robot came to its first row otherwise than assumed: straight from home, or
        at rest there. If so, all later fits assume that."""
        other = replace(self, measurements=replace(self.measurements, from_home=not self.measurements.from_home))
        there = other.fit_like(fit, effects_in(fit), fixed=fixed, tolerance=settings.COARSE)
        if there.log_evidence - fit.log_evidence < settings.DECISIVE:
            return False
        self.measurements = other.measurements
        return True

    def less_widened(self, fit: joint.Fit, candidates: Iterable[Candidate], fixed: dict[str, float]) -> joint.Fit:
        """The fit with those widened priors alone that the readings ask for even where the candidates act: the
        uncertainties of a data sheet must not be widened for what an effect has done."""
        if not fit.priors.scales:
            return fit
        names = [name for name in dict.fromkeys(n for c in candidates for n in c.names) if name not in fit.names]
        columns = fit.whiten(self.derivatives(fit, names, fixed))
        scales = Likelihood.of(fit, columns).likeliest()
        if scales.keys() == fit.priors.scales.keys():
            return fit
        same = {"noise": fit.noise, "positions": fit.positions, "scales": scales}
        return self.fit(effects_in(fit), start=values_of(fit), fixed=fixed, near=True, **same)

    def linear_fit(self, at: joint.Fit, **options: Any) -> joint.Fit:
        """joint.linear_fit() of the rows of this engine."""
        return joint.linear_fit(at, rows=self.rows, **options)

    def part(self, rows: Mask) -> "Engine":
        """An engine for some of its rows (M,), on a table of these and of the path to them."""
        kept = with_path(self.measurements, rows)
        table = replace(self.measurements.rows(kept), about=self.measurements.centre)
        return replace(self, measurements=table, rows=rows[kept])

    def thinned(self, fit: joint.Fit, least: int = settings.LINEARISATION_ROWS) -> tuple["Engine", joint.Fit]:
        """Itself and a fit, or both with at least so many of many rows, each of which counts for its neighbours."""
        few = folds.few_of(self.fitted, least)
        if few is None:
            return self, fit
        weights = fit.weights * few[:, None] * (np.sum(self.fitted) / np.sum(few))
        thin = self.linear_fit(fit, weights=weights, inflation=fit.inflation, max_iterations=0)
        return replace(self, rows=few), thin

    def linear(self, fit: joint.Fit) -> Linear:
        residual, jacobian = fit.whitened()
        return Linear(residual, jacobian @ fit.priors.factor)

    def derivatives(self, fit: joint.Fit, names: Sequence[str], fixed: dict[str, float] | None = None) -> Array:
        """Of the residual (M, 6, k) by parameters, at their fitted or neutral values, in units of their prior sd.

        0 in rows that are not fitted.
        """
        everything = [*(name for name in fit.names if name not in names), *names]
        neutral, sd, _, _ = self.priors(everything)
        at = dict(zip(everything, neutral, strict=True)) | values_of(fit)
        table = self.recording(everything, fixed)
        if type(fit.model) is type(table):
            table.begin_at(fit.model)
        table.activate(self.fitted.tolist())
        values = np.array([at[name] for name in everything])
        # A part of the table, scaled in place: with many rows it is the largest array of a diagnosis.
        columns = table.residual(values, True)[1][:, len(everything) - len(names) :]
        columns *= sd[len(everything) - len(names) :]
        columns[~np.isfinite(columns)] = 0.0
        return columns.reshape(len(self.measurements), 6, len(names))


def effects_in(fit: joint.Fit) -> list[str]:
    """Names of the fitted parameters of effects."""
    return [name for name in fit.names if name.startswith("effects.")]


def values_of(fit: joint.Fit) -> dict[str, float]:
    return dict(zip(fit.names, map(float, fit.values), strict=True))
