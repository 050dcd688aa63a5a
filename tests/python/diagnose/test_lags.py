"""A delay that varies between time segments: found as such, not taken for hysteresis."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import diagnose, figures, lags
from ctcr.diagnose import round as rounds
from ctcr.diagnose.candidates import candidates
from ctcr.diagnose.engine import Engine
from ctcr.effects import catalogue
from ctcr.fit.folds import groups
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from matplotlib.figure import Figure

DELAY = "effects.delay.delay"
DELAYS = (0.5, 0.75)  # s: rows of the demonstration follow each other slowly


def late(robot, table, later):
    """Readings with jitter, late by the first of the two delays, or `later` (M,) by the second."""
    one, two = (
        simulation.simulate(catalogue.with_values(robot, ["delay"], {DELAY: delay}), table, "jitter", seed=1)
        for delay in DELAYS
    )
    choose = later[:, None]
    return replace(
        one,
        position=np.where(choose, two.position, one.position),
        quaternion=np.where(choose, two.quaternion, one.quaternion),
    )


@pytest.fixture(scope="module")
def by_chance(robot, recorded):
    """Engine and fit of readings in which each half of a run is late by one of the delays, by chance."""
    random = np.random.default_rng(5)
    later = np.zeros(len(recorded), bool)
    for run in np.unique(recorded.run):
        for half in np.array_split(np.flatnonzero(recorded.run == run), 2):
            later[half] = random.random() < 0.5
    readings = late(robot, recorded, later)
    engine = Engine(robot, readings, noise_of_readings(robot, readings), groups(readings) % 4 != 2)
    return engine, engine.fit_with_field([DELAY], {})


@pytest.fixture(scope="module")
def steady(robot, recorded):
    return diagnose(robot, late(robot, recorded, np.zeros(len(recorded), bool)))


@pytest.fixture(scope="module")
def slipped(robot, recorded):
    """The diagnosis of readings that are later between two moments of the session, one of them in a held-out run."""
    part = np.arange(len(recorded)) / len(recorded)
    return diagnose(robot, late(robot, recorded, (part > 0.3) & (part < 0.7)))


@pytest.mark.parametrize(("readings", "parts"), [(1, 1), (28, 2), (100, 8)])
def test_segments(recorded, readings, parts):
    """A run has two segments, or more of at least a dozen readings each."""
    runs = np.repeat(np.arange(12), readings)
    there = np.arange(len(runs)) % len(recorded)
    columns = {name: value[there] for name, value in vars(recorded).items() if isinstance(value, np.ndarray)}
    segment = lags.segments(replace(recorded, **columns | {"run": runs}))
    assert segment.max() + 1 == 12 * parts == len(np.unique(segment))
    assert all(len(np.unique(segment[runs == run])) == parts for run in range(12))


def delay_of(fit) -> tuple[float, float]:
    i = fit.names.index(DELAY)
    return float(fit.values[i]), float(fit.sd[i])


def test_no_hysteresis(by_chance):
    """With lags of the segments no effect that depends on the history explains anything more."""
    engine, fit = by_chance
    pool = [c for c in candidates(engine.robot, engine.measurements)[0] if c.id in ("friction", "backlash_rotation")]
    assert max(one.linear for one in rounds.screen(engine, fit, pool, {})) < settings.DECISIVE
    assert lags.explained(engine, fit)[0] > settings.DECISIVE


def test_scores_of_a_round(by_chance):
    """Scores are log evidences over the fit before, lags included, also where that is a better one than at first."""
    engine, fit = by_chance
    early = engine.fit_like(fit, [DELAY], {}, max_iterations=1, near=False)
    pool = [c for c in candidates(engine.robot, engine.measurements)[0] if c.id == "backlash_rotation"]
    refits = rounds.Refits(engine, early, {})
    before, tried = refits.without_best(refits.of_all(rounds.screen(engine, early, pool, {})[:1]))
    assert before.log_evidence > early.log_evidence
    of_before, (one,) = rounds.Judged.of(engine, before), tried
    gained = rounds.Judged.of(engine, one.fit).log_evidence - of_before.log_evidence
    assert one.score == pytest.approx(gained - one.candidate.penalty)
    assert gained != pytest.approx(one.fit.log_evidence - before.log_evidence, abs=1.0)


def test_single_readings(robot, recorded):
    """Lags of single readings are noise, as a parameter for each reading would be; nothing else explains them."""
    readings = late(robot, recorded, np.random.default_rng(7).random(len(recorded)) < 0.5)
    engine = Engine(robot, readings, noise_of_readings(robot, readings, field=False), groups(readings) % 4 != 2)
    fit = engine.fit([DELAY])
    late_by_sd = settings.LAG_SPREAD * delay_of(fit)[0] * fit.derivative_where_used(DELAY)
    each = fit.whiten(late_by_sd[:, :, None] * np.eye(len(readings))[:, None, engine.fitted])
    by_parameters = engine.linear(fit).gain(each)
    _, as_noise = lags.Scatter(fit, late_by_sd).beside(engine.linear(fit))
    assert as_noise == pytest.approx((by_parameters.log_evidence, by_parameters.removed))
    assert lags.explained(engine, fit)[0] > settings.DECISIVE
    pool = [c for c in candidates(robot, readings)[0] if c.id != "delay"]
    assert max(one.linear for one in rounds.screen(engine, fit, pool, {})) < settings.DECISIVE


def test_message(by_chance):
    """The message says by how much the delay varies."""
    _, (message,) = lags.corrected(*by_chance)
    spread = float(message.split(" varies by ")[1].split(" ms")[0])
    assert spread == pytest.approx(1e3 * (DELAYS[1] - DELAYS[0]) / 2, rel=0.4)


def test_uncertainty(by_chance, steady):
    """The delay is no surer than its lags; where there are none it is."""
    (value, sd), (one, sure) = delay_of(lags.widened(*by_chance)), delay_of(steady.final)
    assert DELAYS[0] - 2 * sd < value < DELAYS[1] + 2 * sd and sd > 0.01
    assert abs(one - DELAYS[0]) < 4 * sure and sure < 0.2 * sd


def test_steady(steady):
    """A constant delay gives no message about a delay that varies."""
    assert [accepted.ids for accepted in steady.accepted] == [["delay"]]
    assert steady.residual.messages == ["The residual is noise."]


def test_figure(steady):
    """The report draws the error along the motion over the speed of the tip, and the same explained."""
    picture = Figure()
    assert figures.before_after(picture, steady) is None
    (axes,) = [axes for axes in picture.axes if "speed of the tip" in axes.get_xlabel()]
    error, explained = (line.get_ydata() for line in axes.lines[:2])
    known = np.isfinite(error) & np.isfinite(explained)
    assert np.corrcoef(error[known], explained[known])[0, 1] > 0.98
    assert "along the motion" in axes.get_ylabel()


def test_residual(slipped):
    """The residual that lags explain is no structure, and the lags are named."""
    assert [accepted.ids for accepted in slipped.accepted] == [["delay"]]
    assert not slipped.residual.structured
    assert any("is not constant" in line for line in slipped.residual.messages)


def test_held_out_runs(slipped):
    """Held-out runs are as late as their neighbours; one delay for all leaves far more of them beyond noise."""
    rms, one_delay = slipped.rms_mm, slipped.final.rms_mm(slipped.held_out)
    noise = rms["noise_floor"] ** 2
    assert one_delay**2 - noise > 4 * (rms["with_effects"] ** 2 - noise)
    assert lags.CORRECTED in slipped.residual.messages


def test_frame_of_tracker(robot, slipped):
    """Lags that differ by a frame of the tracker are said to."""
    slow = robot.model_copy(deep=True)
    slow.tracker.rate_Hz = 1 / (DELAYS[1] - DELAYS[0])
    noise = noise_of_readings(slow, slipped.measurements)
    engine = Engine(slow, slipped.measurements, noise, ~slipped.held_out)
    assert "about one frame of the tracker (250 ms)" in lags.corrected(engine, slipped.final)[1][0]
    assert "frame" not in lags.corrected(replace(engine, robot=robot), slipped.final)[1][0]
