"""Whether the runs of a table share one frame and one set of homes: the one place that decides it, for all commands.

What each run may have of its own competes with the effects of the catalogue by the log evidence of the readings, in
which every number of every run has its cost. So a load, a jump or a drift is not taken for a frame of each run.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, robust_rms
from ctcr.audit import sensor_pose
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine, values_of
from ctcr.diagnose.outliers import unexplained_runs
from ctcr.diagnose.round import Judged, parameters_of
from ctcr.diagnose.selection import Selection
from ctcr.diagnose.varying_coefficients import label_of
from ctcr.errors import InputError
from ctcr.fit import folds, joint
from ctcr.fit.result import Fit, rms
from ctcr.fit.sessions import as_sessions, part_of_runs, sessions_at, some_runs
from ctcr.model import parameters, user_recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot.description import Robot
from ctcr.show import wording
from ctcr.table.measurements import Measurements
from ctcr.table.sessions import Sessions


def of_runs(robot: Robot, readings: Measurements, asked: bool | None = None) -> tuple[Measurements, list[str]]:
    """The readings without what each run has of its own, and sentences on that; the same readings, where the runs are
    one session, or nobody asked and no fit is possible that could tell.

    asked    whether each run has a frame of its own; None: where the readings support it
    Raises InputError where a frame for each run was asked for, and no fit is possible.
    """
    try:
        return _of_runs(robot, readings, asked)
    except InputError:
        if asked:
            raise
        return readings, []


def _of_runs(robot: Robot, readings: Measurements, asked: bool | None) -> tuple[Measurements, list[str]]:
    robot, every, _ = sensor_pose.usable(robot, readings)
    located = np.isfinite(every.positions).all(axis=1)
    if asked is False or len(np.unique(every.run[located])) < 2:
        return readings, []
    table, rows = part_of_runs(robot, some_runs(every))
    noise, free = noise_of_readings(robot, every), parameters.uncertain(robot)
    engine = Engine(robot, table, noise, rows, free=free, tolerance=settings.COARSE)
    one = engine.fit()
    if unexplained_runs(table, one):  # whole runs that the fit takes for outliers
        engine = replace(engine, robust=False)
        one = engine.fit()
    if asked is None and not (joint.rejects(one) and _may_win(engine, one)):
        return readings, []
    framed = replace(engine, measurements=as_sessions(robot, table))
    if asked is None and not _wins(engine, one, framed):
        return readings, []
    own, shared = framed.fit(), "a frame"
    homes = tuple(parameters.expand("homes", robot))
    explained = _explained_by_run(framed, own) if joint.rejects(own) else {}
    homed = _with_homes(framed) if homes in explained else None
    if homed:
        own, shared, explained = homed.fit(), "a frame and homes", {}
    taken = sessions_at(own.apply(robot), every, homes=homed is not None)
    before, after = (wording.mm(_rms_mm(fit.apply(robot), of)) for fit, of in ((one, every), (own, taken)))
    text = f"The runs do not share {shared}: with one for each the calibrated error falls from {before} to {after}."
    return taken.sessions.taken_out(readings), [text, *_moved_alone(taken.sessions), *_not_shared(explained)]


def _may_win(engine: Engine, one: Fit) -> bool:
    """Whether moves of each run's frame, and with them of the calibration, could explain enough, and moves of all runs
    or of one are likelier than none."""
    table = Sessions.alike(engine.robot, engine.measurements).taken_out(engine.measurements)
    recorded = user_recording.recording_of(engine.robot, table)
    columns = recorded.columns(one.residual.ravel()).reshape(*one.residual.shape, -1)
    linear, columns = engine.linear(one), one.whiten(columns)
    # Tables that contradict the robot end here.
    most = _most(np.hstack([linear.jacobian, columns]), linear.residual)
    if np.sum(most**2) - columns.shape[1] < settings.SESSION_EXPLAINED * Judged.of(engine, one).unexplained:
        return False
    of_one = np.split(columns, len(table.sessions.run), axis=1)
    tried = [(columns, 0.0), *((one, np.log(len(of_one) * len(settings.SESSION_PARTS))) for one in of_one)]
    return any(
        linear.gain(part * some).log_evidence - cost > settings.DECISIVE
        for some, cost in tried
        for part in settings.SESSION_PARTS
    )


def _wins(engine: Engine, one: Fit, framed: Engine) -> bool:
    """Whether a frame for each run is likelier than one frame, wherever that lies, and than any effects beside it."""
    own = framed.fit_like(one, start={})
    frame = [name for name in one.names if name not in own.names]
    evidence, numbers = own.log_evidence + _cost(own), len(frame) * len(framed.measurements.sessions.run)
    beyond = evidence - one.log_evidence
    explained = Judged.of(engine, one).fraction_explained(Judged.of(framed, own), numbers)
    if beyond < settings.DECISIVE or explained < settings.SESSION_EXPLAINED:
        return False
    wide = {name: settings.SESSION_PRIOR_WIDER * sd for name, sd in zip(frame, engine.priors(frame)[1], strict=True)}
    same = {"noise": one.noise, "tolerance": engine.tolerance, **one.frozen}
    elsewhere = joint.fit(engine.robot, engine.measurements, one.names, rows=engine.rows, sd=wide, **same)
    if evidence < elsewhere.log_evidence + settings.DECISIVE:
        return False
    own = framed.fit_with_field([], values_of(own))
    pool = [c for c in candidates(engine.robot, engine.measurements)[0] if c.id not in engine.robot.effects]
    chosen = Selection(replace(engine), fit=one)
    while _is_likelier(framed, own, chosen):
        if not chosen.take_one(pool):
            return True
    return False


def _is_likelier(framed: Engine, own: Fit, chosen: Selection) -> bool:
    """Whether a frame for each run is likelier than one frame and effects. What a model misses it takes for noise and
    outliers: here a reading is one only where neither explains it."""
    effects, (names, fixed) = chosen.fit, parameters_of(chosen.fits)
    alike = {
        "weights": np.maximum(own.weights, effects.weights),
        "inflation": np.minimum(own.inflation, effects.inflation),
    }
    by_frames = framed.fit_like(own, start=values_of(own), **alike)
    least = by_frames.log_evidence + _cost(by_frames) - settings.DECISIVE
    options = {"start": values_of(effects), "fixed": fixed, **alike}
    start = chosen.engine.fit_like(own, names, max_iterations=0, **options)
    linear = chosen.engine.linear(start)
    # Far from the readings such a fit converges slowly. Mostly a linear bound on its evidence decides without it.
    if start.log_evidence + 0.5 * np.sum(_most(linear.jacobian, linear.residual) ** 2) < least:
        return True
    return chosen.engine.fit_like(own, names, **options).log_evidence < least


def _most(jacobian: Array, residual: Array) -> Array:
    """The part of a residual that parameters could remove, whatever their priors say."""
    return jacobian @ np.linalg.lstsq(jacobian, residual, rcond=None)[0]


def _cost(own: Fit) -> float:
    """Log evidence that the numbers of all runs cost, which the fit has profiled out: under the likeliest of the widths
    that their scatter about the typical run may have; or each run has a width of its own, as where one was moved."""
    model, sessions = own.model, own.model.readings.sessions
    columns = own.whiten(model.columns(own.residual.ravel()).reshape(*own.residual.shape, -1))
    information = columns.T @ columns
    values = np.hstack([sessions.shift, sessions.turn]) / model.sd
    values = values - np.median(values, axis=0)

    n, k = values.shape
    of_run = information.reshape(n, k, n, k)[np.arange(n), :, np.arange(n), :]  # runs share no reading
    parts = np.array(settings.SESSION_PARTS)[:, None]
    determinant = np.linalg.slogdet(parts[:, :, None, None] ** 2 * of_run + np.eye(k))[1]
    costs = -0.5 * (determinant + np.sum(values**2, axis=1) / parts**2)  # (parts, runs)
    return float(max(costs.sum(axis=1).max(), costs.max(axis=0).sum() - n * np.log(len(parts))))


def _with_homes(framed: Engine) -> Engine | None:
    """With homes of each run's own beside its frame, where these predict left-out runs better."""
    try:
        homed = replace(framed, measurements=as_sessions(framed.robot, framed.measurements, homes=True))
        better = _held_out(homed) < (1 - settings.SESSION_EXPLAINED) * _held_out(framed)
    except joint.NoFit:  # such homes ask for joints that the tubes cannot have
        return None
    return homed if better else None


def _explained_by_run(engine: Engine, fit: Fit) -> dict[tuple[str, ...], float]:
    """Fraction of the unexplained chi-square that values of their own in each run explain: of all homes, of a parameter
    of a tube, of all of it. Those that are sure alone."""
    residual, jacobian = fit.whitened()
    linear, jacobian = engine.linear(fit), jacobian * fit.prior_sd
    run = engine.measurements.run[fit.fitted_numbers // 6]
    of_run = (run[:, None] == np.unique(run)) * settings.SESSION_PRIOR_WIDER
    of_tubes = [name for name in fit.names if name.startswith("tubes.")]
    groups = [parameters.expand("homes", engine.robot), *([name] for name in of_tubes)]
    groups += [[name for name in of_tubes if f"tubes.{i + 1}." in name] for i in range(engine.robot.n_tubes)]
    found, unexplained = {}, Judged.of(engine, fit).unexplained
    for names in groups:
        if not set(names) <= set(fit.names):  # known exactly
            continue
        own = jacobian[:, [fit.names.index(name) for name in names]]
        gain = linear.gain((own[:, :, None] * of_run[:, None, :]).reshape(len(run), -1))
        removed = np.sum(residual**2) - np.sum((residual + gain.signal) ** 2)
        sure = gain.log_evidence > settings.DECISIVE + np.log(len(groups))
        if sure and removed > settings.SESSION_EXPLAINED * unexplained:
            found[tuple(names)] = float(min(removed / unexplained, 1.0))
    return found


def _held_out(engine: Engine) -> float:
    """Mean square position error [m^2] of runs, some at a time left out of a fit."""
    _, run = np.unique(engine.measurements.run, return_inverse=True)
    measured = engine.measurements.measured
    rows = measured if np.sum(measured) < settings.CROSS_VALIDATION_ROWS else engine.rows
    square = np.full(len(run), np.nan)
    for out in folds.each_fold(run):
        if out.any() and (rows & ~out).any():
            fit = replace(engine, rows=rows & ~out).fit()
            square[out] = np.sum(fit.residual[out, :3] ** 2, axis=1)
    return float(np.nanmean(square))


def _rms_mm(robot: Robot, readings: Measurements) -> float:
    """RMS position error of all readings, those that no fit saw too."""
    recorded = user_recording.recording_of(robot, readings)
    return 1e3 * rms(recorded.residual(recorded.nominal())[0].reshape(-1, 6)[:, :3])


def _moved_alone(sessions: Sessions) -> list[str]:
    """A sentence on runs whose frame lies far from that of the others; none where there are no such runs."""
    far = np.linalg.norm(sessions.shift - np.median(sessions.shift, axis=0), axis=1)
    odd = far > settings.OUTLYING_RUN * robust_rms(far, 3)
    if not odd.any():
        return []
    size = wording.mm(1e3 * far[odd].max())
    return [f"One frame holds for all but for {wording.runs_named(sessions.run[odd])}: up to {size} away from it."]


def _not_shared(explained: Mapping[tuple[str, ...], float]) -> list[str]:
    """A sentence with a question on parameters that may differ between runs beside their frames; none without any."""
    if not explained:
        return []
    best = max(explained.values())
    alike = [names for names in explained if explained[names] > settings.SESSION_ALIKE * best]
    of_tubes = [names[0].startswith("tubes.") for names in alike]
    asked = " or ".join(["changed"] * any(of_tubes) + ["homed anew"] * (not all(of_tubes)))
    return [
        f"{wording.percent(best)} of the unexplained chi-square looks as if the runs did not share "
        f"{' or '.join(map(_named, alike))}. One robot file cannot hold that: were tubes {asked} between runs?"
    ]


def _named(names: tuple[str, ...]) -> str:
    """Parameters for people: one of a tube, the tube, or the homes."""
    if not names[0].startswith("tubes."):
        return "their homes"
    return f"the {label_of(names[0])}" if len(names) == 1 else f"tube {names[0].split('.')[1]}"
