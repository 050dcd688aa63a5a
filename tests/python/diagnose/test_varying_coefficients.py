"""The varying-coefficient model: which parameter would have to change with which quantity."""

import re
from dataclasses import replace

import numpy as np
import pytest
from ctcr import settings
from ctcr.compare.sample import take_sample
from ctcr.diagnose import diagnose, held_out, report, terminal, varying_coefficients
from ctcr.diagnose.engine import Engine
from ctcr.fit.folds import held_out_rows
from ctcr.model import fields, simulation, table_poses
from ctcr.model.noise import noise_of_readings
from ctcr.show import output
from ctcr.show.wording import number

GAIN, AMPLITUDE, SLIP = 1.5, 0.015, 0.05  # rad/m, rad, rad
TEETH = 9


def twisted(plan):
    """Tube 1 turns a little while it is pushed."""
    return plan.alpha + GAIN * plan.beta * [1, 0, 0]


def toothed(plan):
    """The wheels that turn the tubes have worn teeth."""
    return plan.alpha + AMPLITUDE * np.sin(TEETH * plan.alpha)


def slipped(plan):
    """Tube 2 slips in its grip halfway."""
    return plan.alpha + SLIP * (np.arange(len(plan)) > len(plan) / 2)[:, None] * [0, 1, 0]


def readings_of(robot, plan, alpha, seed=3):
    """Readings with jitter of a robot whose tubes get these angles, under those of the plan."""
    return replace(simulation.simulate(robot, replace(plan, alpha=alpha), "jitter", seed=seed), alpha=plan.alpha)


def looked_at(robot, readings):
    """An engine for three quarters of the runs, its calibration, and the model of what varies."""
    engine = Engine(robot, readings, noise_of_readings(robot, readings), ~held_out_rows(robot, readings, 0))
    fit = engine.fit_with_field([], {})
    sample = take_sample(robot, readings, table_poses.readings(robot, readings))
    return engine, fit, varying_coefficients.varying_model(engine, fit, sample)


@pytest.fixture(scope="module")
def twist(robot, recorded):
    """Engine, fit and model of readings of a robot whose tube 1 turns while it is pushed."""
    return looked_at(robot, readings_of(robot, recorded, twisted(recorded)))


@pytest.fixture(scope="module")
def noise(robot, plan):
    """The same of readings that hold noise alone."""
    return looked_at(robot, readings_of(robot, plan, plan.alpha))


def test_twist(twist):
    """A tube that turns while it is pushed: its home rotation changes with its deployed length, by the right gain."""
    _, _, found = twist
    [only] = found.variations
    assert (only.parameter, only.covariate.name, only.unit) == ("actuation.home_rotation.1", "length1", "deg")
    assert np.polyfit(only.covariate.value, only.change, 1)[0] == pytest.approx(np.rad2deg(GAIN), rel=0.1)
    assert found.explained > 0.9 and found.depends_on == ["length1"]
    for text in (only.message, only.measure):
        assert "home rotation of tube 1" in text and "deployed length of tube 1" in text


def test_worn_teeth(robot, recorded):
    """Worn teeth of the wheels are counted, and their amplitude is right."""
    found = looked_at(robot, readings_of(robot, recorded, toothed(recorded)))[2]
    seen = {(v.parameter, v.covariate.name) for v in found.variations}
    assert {(f"actuation.home_rotation.{i}", f"alpha{i}") for i in (1, 2, 3)} <= seen
    first = found.variations[0]
    assert f"{TEETH} times a turn" in first.covariate.label
    assert np.ptp(first.change) == pytest.approx(2 * np.rad2deg(AMPLITUDE), rel=0.2)


def test_slip(robot, recorded):
    """A tube that slips halfway: its home rotation changes with time."""
    first = looked_at(robot, readings_of(robot, recorded, slipped(recorded)))[2].variations[0]
    assert (first.parameter, first.covariate.name) == ("actuation.home_rotation.2", "time")
    assert "again and again" in first.measure
    early, late = first.change[: len(recorded) // 4].mean(), first.change[-len(recorded) // 4 :].mean()
    assert late - early == pytest.approx(np.rad2deg(SLIP), rel=0.4)


@pytest.mark.parametrize("seed", range(3))
def test_noise(robot, plan, seed):
    """Noise varies with nothing."""
    assert looked_at(robot, readings_of(robot, plan, plan.alpha, seed))[2] is None


def test_unexplained_chi_square(noise):
    """Noise leaves none unexplained; an error adds its square; rows that were fitted do not count."""
    engine, fit, _ = noise
    unexplained = held_out.unexplained_of(fit, ~engine.rows)
    unseen = int(6 * np.sum(~engine.rows))
    assert unexplained(fit.residual) < 3 * np.sqrt(2 * unseen)
    off = np.zeros_like(fit.residual)
    off[:, 0] = 1e-2  # m
    once, twice, thrice = (unexplained(times * off) for times in (1, 2, 3))
    assert (thrice - twice) / (twice - once) == pytest.approx((9 - 4) / (4 - 1), rel=1e-9)
    seen = np.where(engine.rows[:, None], off, 0.0)
    assert unexplained(seen) == 0.0  # of rows that were fitted it says nothing


def test_part_of_the_rows(robot, recorded, monkeypatch):
    """A part of many rows gives the same answer."""
    readings = readings_of(robot, recorded, twisted(recorded))
    monkeypatch.setattr(settings, "VARYING_ROWS", 60)
    engine, fit, found = looked_at(robot, readings)
    assert engine.thinned(fit, 60)[0].rows.sum() < engine.rows.sum() / 2
    first = found.variations[0]
    assert (first.parameter, first.covariate.name) == ("actuation.home_rotation.1", "length1")


def with_residual(engine, fit, residual):
    """The fit with another residual (M, 6)."""
    same = {"weights": fit.weights, "inflation": fit.inflation, "max_iterations": 0}
    return engine.linear_fit(fit, more=residual - fit.residual, **same)


def test_diagnosis(robot, plan, capsys):
    """The terminal, the report and the JSON say what varies."""
    found = diagnose(robot, readings_of(robot, plan, twisted(plan)))
    assert found.verdict.word != "identified"
    assert "length1" in found.as_dict()["leftover"]["depends_on"]
    terminal.show(output.console(), found)
    page = report.page(found)
    length = next(one for one in fields.fitted(found.final) if one.name == "tubes.1.length")
    said = re.findall(r">tubes\.1\.length</td>(.*?)</tr>", page)[-1]
    assert number(length.value, length.sd) in said and ">mm<" in said and 100 < length.value < 1000
    for text in (capsys.readouterr().out, page):
        assert "home rotation of tube 1" in text
    assert "Parameters that vary" in page and "identified" not in page.split("</p>")[0]


def test_diagnosis_of_noise(tip_load):
    """Where the residual is noise nothing is said to vary."""
    assert tip_load.varying is None
    assert "Parameters that vary" not in report.page(tip_load)


def test_explained_by_run(twist, recorded):
    """The fraction explained is counted for each held-out run, in chi-square."""
    engine, before, _ = twist
    runs = np.unique(recorded.run[~engine.rows])
    names = {f"run {run}" for run in runs}
    same = held_out.explained_by_run(engine, before, before)
    assert len(runs) >= 3 and set(same) <= names and [*same.values()] == pytest.approx(len(same) * [0])

    far = 20 * before.residual
    one_is_off = far * (recorded.run == runs[0])[:, None]
    fractions = held_out.explained_by_run(
        engine, with_residual(engine, before, far), with_residual(engine, before, one_is_off)
    )
    assert fractions == pytest.approx({name: float(name != f"run {runs[0]}") for name in names}, abs=1e-6)
    half = held_out.explained_by_run(engine, with_residual(engine, before, far), with_residual(engine, before, far / 2))
    assert half == pytest.approx(dict.fromkeys(names, 0.75), abs=0.02)


def test_runs_of_noise(noise):
    """Runs that noise explains say nothing of effects."""
    engine, fit, _ = noise
    assert held_out.explained_by_run(engine, fit, fit) == {}
