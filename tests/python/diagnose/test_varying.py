"""What no effect explains: which parameter would have to change with which quantity."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr.compare.sample import take_sample
from ctcr.diagnose import diagnose, other_runs, race, report, terminal, varying
from ctcr.diagnose.engine import Engine
from ctcr.fit.folds import held_out_rows
from ctcr.model import effect_model, simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from ctcr.show import output

ROOT = Path(__file__).parents[3]
GAIN, AMPLITUDE, SLIP = 1.5, 0.015, 0.05  # rad/m, rad, rad
TEETH = 9


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROOT / "examples" / "robots" / "table2.yaml")


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
    """A calibration of three quarters of the runs, and what would have to vary."""
    noise = noise_of_readings(robot, readings)
    engine = Engine(robot, readings, noise, ~held_out_rows(robot, readings, 0))
    fit = race.baseline(engine, [], {}, lambda _: None)
    return (
        engine,
        fit,
        varying.found(engine, fit, take_sample(robot, readings, effect_model.readings(robot, readings))),
    )


def test_a_twist_while_pushing_is_seen_with_its_gain(robot, recorded):
    found = looked_at(robot, readings_of(robot, recorded, twisted(recorded)))[2]
    [only] = found.variations
    assert (only.parameter, only.covariate.name, only.unit) == ("actuation.home_rotation.1", "length1", "deg")
    assert np.polyfit(only.covariate.value, only.change, 1)[0] == pytest.approx(np.rad2deg(GAIN), rel=0.1)
    assert found.share > 0.9 and found.depends_on == ["length1"]
    for text in (only.in_words, only.measure):
        assert "home rotation of tube 1" in text and "deployed length of tube 1" in text


def test_worn_teeth_are_counted(robot, recorded):
    found = looked_at(robot, readings_of(robot, recorded, toothed(recorded)))[2]
    seen = {(v.parameter, v.covariate.name) for v in found.variations}
    assert {(f"actuation.home_rotation.{i}", f"alpha{i}") for i in (1, 2, 3)} <= seen
    first = found.variations[0]
    assert f"{TEETH} times a turn" in first.covariate.label
    assert np.ptp(first.change) == pytest.approx(2 * np.rad2deg(AMPLITUDE), rel=0.2)


def test_a_slip_shows_in_time(robot, recorded):
    first = looked_at(robot, readings_of(robot, recorded, slipped(recorded)))[2].variations[0]
    assert (first.parameter, first.covariate.name) == ("actuation.home_rotation.2", "time")
    assert "again and again" in first.measure
    early, late = first.change[: len(recorded) // 4].mean(), first.change[-len(recorded) // 4 :].mean()
    assert late - early == pytest.approx(np.rad2deg(SLIP), rel=0.4)


@pytest.mark.parametrize("seed", range(4))
def test_noise_varies_with_nothing(robot, plan, seed):
    assert looked_at(robot, readings_of(robot, plan, plan.alpha, seed))[2] is None


def test_excess_is_none_for_noise_and_grows_with_the_square_of_an_error(robot, plan):
    engine, fit, _ = looked_at(robot, readings_of(robot, plan, plan.alpha))
    excess = other_runs.excess_of(engine, fit, ~engine.rows)
    unseen = int(6 * np.sum(~engine.rows))
    assert excess(fit.residual) < 3 * np.sqrt(2 * unseen)
    off = np.zeros_like(fit.residual)
    off[:, 0] = 1e-2  # m
    assert (excess(2 * off) + unseen) / (excess(off) + unseen) == pytest.approx(4, rel=1e-9)
    seen = np.where(engine.rows[:, None], off, 0.0)
    assert excess(seen) == 0.0  # of rows that were fitted it says nothing


def test_few_of_many_readings_say_the_same(robot, recorded, monkeypatch):
    readings = readings_of(robot, recorded, twisted(recorded))
    monkeypatch.setattr(varying, "ROWS", 60)
    engine, fit, found = looked_at(robot, readings)
    assert engine.thinned(fit, 60)[0].rows.sum() < engine.rows.sum() / 2
    first = found.variations[0]
    assert (first.parameter, first.covariate.name) == ("actuation.home_rotation.1", "length1")


def test_effects_that_leave_far_more_are_outdone(robot, recorded):
    engine, fit, found = looked_at(robot, readings_of(robot, recorded, twisted(recorded)))
    assert varying.may_outdo(engine, fit, fit) and found.outdoes(engine, fit, fit)
    right = replace(fit, core=NoResidual(fit))
    assert not varying.may_outdo(engine, fit, right) and not found.outdoes(engine, fit, right)


class NoResidual:
    """What a fit reports where the model explains everything."""

    def __init__(self, fit):
        self.whiten = fit.core.whiten
        self.report = lambda _: (0 * fit.residual.ravel(), fit.jacobian_all, 0 * fit.field.ravel(), None)


def test_a_diagnosis_tells_it_everywhere(robot, recorded, capsys):
    found = diagnose(robot, readings_of(robot, recorded, twisted(recorded)))
    assert found.verdict.word != "identified"
    assert "length1" in found.as_json()["leftover"]["depends_on"]
    terminal.show(output.console(), found)
    page = report.page(found, "a test")
    for text in (capsys.readouterr().out, page):
        assert "home rotation of tube 1" in text
    assert "What does not stay constant" in page and "identified" not in page.split("</p>")[0]


def test_where_noise_explains_the_rest_nothing_is_said_to_vary(robot, plan):
    found = diagnose(robot, readings_of(robot, plan, plan.alpha))
    assert found.varying is None
    assert "What does not stay constant" not in report.page(found, "a test")


def test_each_run_says_how_much_of_it_is_explained(robot, recorded):
    engine, before, _ = looked_at(robot, readings_of(robot, recorded, twisted(recorded)))
    runs = np.unique(recorded.run[~engine.rows])
    names = {f"run {run}" for run in runs}
    same = other_runs.explained(engine, before, before)
    assert len(runs) >= 3 and set(same) <= names and [*same.values()] == pytest.approx(len(same) * [0])

    def with_residual(residual):
        found = replace(before, core=NoResidual(before))
        found.core.report = lambda _: (residual.ravel(), before.jacobian_all, 0 * residual.ravel(), None)
        return found

    far = 20 * before.residual
    one_is_off = far * (recorded.run == runs[0])[:, None]
    shares = other_runs.explained(engine, with_residual(far), with_residual(one_is_off))
    assert shares == pytest.approx({name: float(name != f"run {runs[0]}") for name in names}, abs=1e-6)
    half = other_runs.explained(engine, with_residual(far), with_residual(far / 2))
    assert half == pytest.approx(dict.fromkeys(names, 0.75), abs=0.02)


def test_where_noise_explains_other_runs_nothing_is_left_to_explain(robot, recorded):
    engine, fit, _ = looked_at(robot, readings_of(robot, recorded, recorded.alpha))
    assert other_runs.explained(engine, fit, fit) == {}
