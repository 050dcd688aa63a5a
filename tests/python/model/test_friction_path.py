"""Friction twists the tubes along their path: in predictions, and in fits, which are repeated until the path agrees."""

from dataclasses import replace

import numpy as np
from ctcr import settings
from ctcr.diagnose import add
from ctcr.diagnose.candidates import Candidate, forms
from ctcr.diagnose.engine import Engine
from ctcr.diagnose.linearised import Gain
from ctcr.diagnose.round import CandidateFit, Round
from ctcr.diagnose.selection import Accepted, Selection
from ctcr.effects import catalogue
from ctcr.fit import joint
from ctcr.model import simulation, user_recording
from ctcr.model.noise import noise_of_readings

FREE = ["tubes.*.curvature", "actuation.home_rotation.*", "tracker.position.*"]
LAW = "effects.friction.law"
TRUE = {f"effects.friction.coefficient.{i}": 0.03 for i in (1, 2, 3)} | {"effects.friction.slip_angle": 0.03, LAW: 1.0}


def test_stiff_friction_is_found(robot, plan):
    """A fit that follows the friction path finds stiff friction."""
    made = simulation.simulate(catalogue.with_values(robot, ["friction"], TRUE), plan, "jitter", seed=1)
    added = add.add(robot, made, ["friction"], fixed={LAW: 1.0}, free=FREE)
    found = added.parameters()
    for i in (1, 2):
        name = f"effects.friction.coefficient.{i}"
        assert abs(found[name]["value"] - 0.03) < 0.02 * 0.03, found[name]
    # The fit begins at 0.105. Without the relative torsion that friction causes it would end at 0.18.
    assert abs(found["effects.friction.slip_angle"]["value"] - 0.03) < 0.003
    rms = added.rms("rms_mm")
    assert rms["friction"] < 2 * rms["noise_floor"] < 0.05 * rms["calibrated"]


def test_prediction(robot, plan):
    """Predictions follow the friction path, which is solved when a recording is made."""
    with_friction = catalogue.with_values(robot, ["friction"], TRUE)
    table = user_recording.recording_of(with_friction, plan, list(TRUE))
    assert table.solve_friction(table.nominal()) < settings.FRICTION_PATH_CHANGE  # already solved when it was made
    table.residual(table.nominal())
    solved = table.predicted()[0]
    assert table.solve_friction(0 * table.nominal()) == 0  # no friction: nothing changes
    table.residual(table.nominal())
    np.testing.assert_array_equal(table.predicted()[0], solved)
    simulated = simulation.simulate(with_friction, plan, "none").position
    np.testing.assert_allclose(simulated, solved, atol=2e-5)  # other integration steps


def test_start(robot, plan):
    """A recording may start at the friction path that another one has solved."""
    x, still = np.array(list(TRUE.values())), np.zeros(len(TRUE))
    first, like, unlike, fresh = (user_recording.recording_of(robot, plan, list(TRUE)) for _ in range(4))
    assert first.solve_friction(x) > 10 * settings.FRICTION_PATH_CHANGE
    for table in (like, unlike):
        table.begin_at(first)
    assert like.solve_friction(x) < 1e-3
    np.testing.assert_allclose(predicted(like, x), predicted(first, x), atol=1e-6)
    assert unlike.solve_friction(still) == 0  # without friction there is no relative torsion to solve
    np.testing.assert_array_equal(predicted(unlike, still), predicted(fresh, still))


def test_screening(robot, plan):
    """Candidates are screened at the friction path of the fit before."""
    made = simulation.simulate(catalogue.with_values(robot, ["friction"], TRUE), plan, "jitter", seed=2)
    noise = noise_of_readings(robot, made)
    engine = Engine(robot, made, noise, np.ones(len(made), bool), free=FREE)
    with_friction = [name for name in TRUE if name != LAW]
    fit = engine.fit(with_friction, start=TRUE, fixed={LAW: 1.0})
    assert fit.model.friction_is_solved
    own = fit.jacobian_all.reshape(*fit.residual.shape, -1) * fit.prior_sd
    np.testing.assert_allclose(engine.derivatives(fit, fit.names, {LAW: 1.0}), own, atol=1e-9 * np.abs(own).max())
    # A fit without friction comes between: the solved path is not forgotten.
    assert not engine.fit().model.friction_is_solved
    again = engine.recording(fit.names, {LAW: 1.0})
    again.begin_at(engine._friction_path)
    assert again.solve_friction(fit.values) < settings.FRICTION_PATH_CHANGE


def predicted(table, x):
    table.residual(x)
    return table.predicted()[0]


def test_forms():
    """Every constitutive law and every variant of an effect is tried."""
    effect = catalogue.get("friction", 3)
    coefficient = effect.names("coefficient")
    held = Candidate("friction", tuple(coefficient), (("effects.friction.insertion", 0.0),))
    laws = [dict(form.shape) for form in forms(effect, held)]
    held_or_begun = {"effects.friction.insertion": 0.0, LAW: 1.0, "effects.friction.slip_angle": 0.03}
    assert laws == [{"effects.friction.insertion": 0.0}, held_or_begun]
    for form in forms(effect, held):  # a torque per length enters the race alone, never beside the coefficient
        assert list(form.names) == coefficient + effect.shapes
    second = Candidate("friction", tuple(coefficient), tuple(held_or_begun.items())[::-1])
    once = [held_or_begun, {name: value for name, value in held_or_begun.items() if name != LAW}]
    assert [dict(form.shape) for form in forms(effect, second)] == once
    softening = catalogue.get("softening", 3)
    alone = Candidate("softening", tuple(softening.amplitudes))
    assert forms(softening, alone) == [replace(alone, names=(*alone.names, *softening.shapes))]
    effect = catalogue.get("straight_curvature", 3)
    plane, across = effect.names("bend_x"), effect.names("bend_y")
    flat, free = forms(effect, Candidate("straight_curvature", tuple(plane)))
    assert list(flat.names) == plane + effect.shapes and list(free.names) == plane + across + effect.shapes


def test_other_variant(robot, plan):
    """Friction that was accepted with the wrong amplitude changes to the right one."""
    made = simulation.simulate(catalogue.with_values(robot, ["friction"], TRUE), plan, "jitter", seed=3)
    noise = noise_of_readings(robot, made)
    engine = Engine(robot, made, noise, np.ones(len(made), bool), free=FREE)
    names = {
        strength: tuple(catalogue.get("friction", 3).names(strength))
        for strength in ("torque_per_length", "coefficient")
    }
    for given, fitted in names.items():
        fit = engine.fit(fitted)
        gain = Gain(0.0, *4 * [np.zeros(1)], removed=0.0)
        entered = CandidateFit(Candidate("friction", fitted), gain, fit=fit)
        round_ = Round(fit, [entered], accepted=entered, ids=["friction"])
        one = Accepted(entered, round_, log_evidence=100.0, beside=0.9)
        selection = Selection(engine, accepted=[one], fit=fit)
        selection.refine_form(one)
        after = selection.fit
        assert (np.max(fit.inflation) > settings.INFLATION_WRONG) == (given == "torque_per_length")
        assert set(names["coefficient"]) <= set(one.best.candidate.names)
        assert not set(names["torque_per_length"]) & set(one.best.candidate.names)
        assert np.max(after.inflation) < settings.INFLATION_EXPLAINED
        assert after.rms_mm() < 1.2 * joint.tracker_error(after, noise)[0]
