"""Joint identification: names and priors, and fits of simulated tables whose truth is known."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from ctcr import settings
from ctcr.errors import InputError
from ctcr.fit import folds, joint
from ctcr.fit.result import Priors
from ctcr.frames import base_to_tracker, product, quaternion_from_rotation_vector
from ctcr.model import parameters
from ctcr.model.model import Model
from ctcr.model.noise import Noise, changed, noise_of
from ctcr.model.protocol import LinearModel
from ctcr.robot.defaults import UNCERTAINTY
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

NOISE = Noise(position_jitter=5e-5, rotation_jitter=5e-4)


def robot(**uncertainty) -> Robot:
    tube = {"youngs_modulus_GPa": 58.0, "poisson_ratio": 0.3, "density_kg_m3": 6450.0}
    return Robot.model_validate(
        {
            "name": "bench",
            "gravity": [0.0, -9.81, 0.0],
            "tubes": [
                tube
                | {
                    "inner_diameter_mm": 1.3,
                    "outer_diameter_mm": 1.52,
                    "length_mm": 400.0,
                    "curved_length_mm": 50.0,
                    "curvature_per_m": 10.0,
                },
                tube
                | {
                    "inner_diameter_mm": 1.62,
                    "outer_diameter_mm": 1.8,
                    "length_mm": 300.0,
                    "curved_length_mm": 50.0,
                    "curvature_per_m": 5.0,
                },
            ],
            "actuation": {
                "translation_mm_per_rev": 2.0,
                "rotation_rev_per_rev": -1.0,
                "home_translation_mm": [-298.0, -220.5],
                "home_rotation_deg": [0.0, 10.0],
            },
            "tracker": {
                "sensor_on_tube": 1,
                "rate_Hz": 40.0,
                "jitter_mm": 0.05,
                "jitter_deg": 0.03,
                "accuracy_95_mm": 0.9,
                "accuracy_95_deg": 0.5,
                "position_mm": [-48.0, -7.0, 5.0],
                "rotation_vector_rad": [2.0, 0.1, 0.0],
            },
            "uncertainty": {
                "tracker_frame_mm": 0.5,
                "tracker_frame_deg": 0.3,
                "rotation_offset_deg": 1.0,
                "translation_offset_mm": 1.0,
                "length_mm": 1.0,
                "curved_length_mm": 2.5,
                "curvature_percent": 5.0,
                "youngs_modulus_percent": 15.0,
            }
            | uncertainty,
        }
    )


def table(truth: Robot, rows: int = 80, seed: int = 0, noise: Noise = NOISE) -> Measurements:
    """What a robot reads at random joints, in eight runs, with jitter."""
    random = np.random.default_rng(seed)
    n = truth.n_tubes
    beta = np.array([-0.26, -0.22][:n]) + random.uniform(-0.02, 0.02, (rows + 10, n))
    alpha = random.uniform(-3, 3, (rows + 10, n))
    tips = Model(truth).predict(*truth.joints_of_table(beta, alpha))
    quiet = np.flatnonzero(tips.solved & (tips.stability > 0.1))[:rows]  # a tube may snap here and there
    beta, alpha, tips = beta[quiet], alpha[quiet], replace(tips, **_taken(tips, quiet))
    position, quaternion = base_to_tracker(truth.tracker, tips.position, tips.quaternion)
    turn = quaternion_from_rotation_vector(noise.rotation_jitter * random.standard_normal((rows, 3)))
    return Measurements.of_joints(
        beta,
        alpha,
        run=np.arange(rows) * 8 // rows,
        position=position + noise.position_jitter * random.standard_normal((rows, 3)),
        quaternion=product(turn, quaternion),
    )


def _taken(tips, rows):
    return {name: getattr(tips, name)[rows] for name in ("position", "quaternion", "status", "stability")}


def test_expand():
    """Names are expanded in the order of the library."""
    assert parameters.expand("tubes.*.length", robot()) == ["tubes.1.length", "tubes.2.length"]
    assert parameters.expand(["tracker.frame", "tracker.position.x"], robot()) == [
        f"tracker.{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"
    ]
    assert len(parameters.expand("standard", robot())) == 6 + 6 * 2
    assert parameters.expand("tubes.1.*,gravity.x", robot())[-1] == "gravity.x"


def test_standard():
    """`standard` leaves out parameters that a robot does not have."""
    bench = robot()
    bench.tubes[1].curvature_per_m = 0.0
    bench.tubes[0].bending_stiffness_Nm2 = 0.01
    names = parameters.expand("standard", bench)
    assert "tubes.2.curvature" not in names and "tubes.2.length" in names
    assert "tubes.1.bending_stiffness" in names and "tubes.1.youngs_modulus" not in names


@pytest.mark.parametrize(
    ("name", "hint"), [("tubes.1.lenght", "tubes.1.length"), ("standart", "standard"), ("zzz", "names are")]
)
def test_unknown_name(name, hint):
    """An unknown name is refused with the nearest."""
    with pytest.raises(InputError, match=hint):
        parameters.expand(name, robot())


def test_priors():
    """Priors come from the file or from the caller."""
    names = ["tubes.1.youngs_modulus", "tubes.1.curvature", "actuation.home_rotation.2", "tracker.rotation.x"]
    mean, sd, _, _ = parameters.priors(robot(), names)
    np.testing.assert_allclose(mean, [58e9, 10, np.deg2rad(10), 0])
    np.testing.assert_allclose(sd, [0.15 * 58e9, 0.5, np.deg2rad(1), np.deg2rad(0.3)])
    assert parameters.priors(robot(), names, {"tubes.*.curvature": 2.0})[1][1] == 2.0
    assert parameters.priors(robot(), names, {"tubes.1.curvature": inf})[1][1] == inf
    with pytest.raises(InputError, match=r"poisson_ratio: .* does not state the uncertainty"):
        parameters.priors(robot(), ["tubes.1.poisson_ratio"])
    with pytest.raises(InputError, match=r"^tubes.1.length: the prior standard deviation must be above 0"):
        parameters.priors(robot(length_mm=0.0), ["tubes.1.length"])


def test_priors_of_nothing():
    """What no fit can move is one problem, which names all parameters: a kind by its pattern, others one by one."""
    names = ["tubes.1.length", "tubes.1.curvature", "tubes.2.length", "tubes.2.curvature", "tubes.1.poisson_ratio"]
    with pytest.raises(InputError) as caught:
        parameters.priors(robot(length_mm=0.0, curvature_percent=[5.0, 0.0]), names)
    unstated, exact = caught.value.lines
    assert unstated.startswith("tubes.1.poisson_ratio: the robot file does not state")
    assert exact.startswith("tubes.*.length, tubes.2.curvature: the prior standard deviation must be above 0")
    with pytest.raises(InputError) as caught:
        parameters.priors(robot(**dict.fromkeys(UNCERTAINTY, 0.0)), parameters.expand("standard", robot()))
    assert len(caught.value.problems) == 1


def test_values_round_trip():
    """Values go into the robot and come back."""
    bench = robot()
    names = [name for name in parameters.names_of(2) if parameters.field_of(name).path]
    values = parameters.values(bench)[[parameters.names_of(2).index(name) for name in names]]
    for i in (1, 2):
        values[names.index(f"tubes.{i}.bending_stiffness")] = 0.01
    changed = parameters.applied(bench, names, 1.01 * values)
    again = parameters.values(changed)[[parameters.names_of(2).index(name) for name in names]]
    np.testing.assert_allclose(again, 1.01 * values, rtol=1e-12)
    assert changed.actuation.recorded_home_translation_mm == bench.actuation.home_translation_mm
    assert bench.tubes[0].length_mm == 400.0


def test_truth_recovered():
    """A fit finds the robot that was measured."""
    bench = robot()
    names = ["tubes.1.curvature", "actuation.home_rotation.2", "tracker.position.x", "tracker.rotation.y"]
    truth = parameters.applied(bench, names, [10.4, np.deg2rad(11.0), -0.0475, 0.004])
    readings = table(truth)
    held_out = readings.run == 3
    fit = joint.fit(bench, readings, names, rows=~held_out, noise=NOISE)
    assert fit.converged and fit.names == parameters.expand(names, bench)
    expected = dict(zip(names, [10.4, np.deg2rad(11.0), -0.0475, 0.004], strict=True))
    error = fit.values - [expected[name] for name in fit.names]
    assert (np.abs(error) < 4 * fit.sd).all()
    assert 0.7 < fit.reduced_chi_square < 1.3 and 0.001 < fit.p_value
    assert fit.nominal_rms_mm() > 5 * fit.rms_mm()
    assert fit.rms_mm(held_out) == pytest.approx(fit.expected_mm(held_out), rel=0.3)
    assert not fit.used[held_out].any() and np.isfinite(fit.residual[held_out]).all()
    # The fitted robot predicts what the fit says it does.
    again = joint.fit(fit.apply(bench), readings, "tracker.position.x", noise=NOISE)
    np.testing.assert_allclose(again.nominal_residual, fit.residual, atol=1e-7)


def test_jitter_nearly_as_stated():
    """Readings that scatter by a tenth more than stated agree with the noise, by a half more they do not, and more
    scatter never agrees better."""
    bench = robot()
    noises = [
        changed(NOISE, position_jitter=k * NOISE.position_jitter, rotation_jitter=k * NOISE.rotation_jitter)
        for k in (1.0, 1.1, 1.25, 1.5)
    ]
    stated = noises[0]
    fits = [joint.fit(bench, table(bench, 400, 1, one), ["tracker.position.x"], noise=stated) for one in noises]
    p_values = [joint.linear_fit(fit, weights=fit.weights, inflation=np.ones(2)).p_value for fit in fits]
    assert p_values == sorted(p_values, reverse=True)
    assert p_values[1] > 0.1 and p_values[-1] < 1e-4


def test_whitening():
    """Whitened residual and derivatives reproduce chi-square and covariance."""
    bench = robot()
    fit = joint.fit(bench, table(bench), ["tubes.*.length", "tracker.frame"])
    residual, jacobian = fit.whitened()
    assert residual @ residual == pytest.approx(fit.chi_square, rel=1e-6)
    information = jacobian.T @ jacobian + np.diag(1 / fit.prior_sd**2)
    np.testing.assert_allclose(np.linalg.inv(information), fit.covariance, rtol=1e-4, atol=1e-15)
    np.testing.assert_allclose(fit.whiten(fit.residual)[:, 0], residual)
    # They take rows that were fitted alone; all that is said of every row is said after them, too.
    some = joint.fit(bench, table(bench), "tracker.frame", rows=table(bench).run < 2)
    residual, jacobian = some.whitened()
    slope = some.derivative_where_used("tracker.position.x")
    assert np.isnan(some._of_used[0].reshape(-1, 6)[~some.used]).all() and np.isfinite(some.residual).all()
    np.testing.assert_allclose(some.whiten(some.residual)[:, 0], residual, atol=1e-9)
    column = some.names.index("tracker.position.x")
    np.testing.assert_allclose(some.whiten(slope)[:, 0], jacobian[:, column], atol=1e-9)
    every = some.jacobian_all[:, column].reshape(-1, 6)
    np.testing.assert_allclose(slope[some.used], every[some.used])
    assert not slope[~some.used].any() and every[~some.used].any()


def test_gauge_named():
    """The gauge of a robot is named."""
    bench = robot()
    fit = joint.fit(bench, table(bench), "standard", starts=1)
    assert any(d.text.startswith("common rotation of all tubes = yaw") for d in fit.directions)
    assert any(d.text.startswith("translation offset of tube 2 against its length") for d in fit.directions)


def test_model_error():
    """A model error inflates the noise, and a warning says so."""
    bench = robot()
    readings = table(bench)
    bent = replace(readings, position=readings.position + 2e-3 * np.sin(40 * readings.alpha[:, :1]))
    fit = joint.fit(bench, bent, "tracker.frame", noise=NOISE)
    assert fit.reduced_chi_square > 100 and fit.inflation[0] > 10 and fit.inflation[1] == 1
    assert any("something is missing in the model" in text for text in fit.warnings)
    assert np.abs(fit.shift).max() < 4
    same = joint.fit(bench, bent, "tracker.frame", noise=NOISE, weights=fit.weights, inflation=fit.inflation)
    assert same.log_evidence == pytest.approx(fit.log_evidence, abs=0.01)


def test_outliers():
    """Outliers count for little."""
    bench = robot()
    readings = table(bench)
    clean = joint.fit(bench, readings, "tracker.frame", noise=NOISE)
    readings.position[::10] += 3e-3
    fit = joint.fit(bench, readings, "tracker.frame", noise=NOISE)
    assert (fit.weights[::10, 0] < 0.1).all() and (fit.weights[1::10, 0] > 0.5).all()
    assert (np.abs(fit.values - clean.values) < clean.sd).all()


def test_admissible_joints():
    """Tips that are recorded flush, grasped points at the plate, tubes curved over all their length."""
    bench = robot()
    bench.tubes[1].curved_length_mm = 300.0
    readings = table(bench)
    flush = np.column_stack([np.full(80, -0.1), np.zeros(80)])
    names = parameters.expand("standard", bench)
    limits = {
        text: (dict(zip(names, row, strict=True)), low) for text, row, low in parameters.admissible(bench, flush, names)
    }
    assert limits["the tips of tubes 1 and 2 are flush"][1] == pytest.approx(0, abs=1e-12)
    assert limits["tube 2 is grasped at the plate"][1] == 0
    assert limits["tube 2 is curved over all its length"][1] == 0
    assert limits["tubes 1 and 2 are grasped at one place"][1] == pytest.approx(-0.1)
    row = {name: part for name, part in limits["the tips of tubes 1 and 2 are flush"][0].items() if part}
    assert row == {
        "tubes.1.length": 1,
        "tubes.2.length": -1,
        "actuation.home_translation.1": 1,
        "actuation.home_translation.2": -1,
    }

    angles = np.linspace(-3, 3, 80)
    tips = Model(bench).predict(flush, np.column_stack([angles, 0.3 * angles]))
    position, quaternion = base_to_tracker(bench.tracker, tips.position, tips.quaternion)
    readings = replace(
        readings,
        beta=flush,
        alpha=np.column_stack([angles, 0.3 * angles]),
        quaternion=quaternion,
        position=position + 4e-4 * np.random.default_rng(1).standard_normal((80, 3)),
    )
    fit = joint.fit(bench, readings, "standard", noise=NOISE)
    assert fit.converged and not fit.excluded
    after = fit.apply(bench)
    beta = after.joints_of_table(flush, readings.alpha)[0]
    tip = beta + [tube.length for tube in after.tubes]
    assert (tip[:, 0] > tip[:, 1] - 1e-9).all() and (beta[:, 1] <= 1e-9).all()
    assert after.tubes[1].curved_length <= after.tubes[1].length + 1e-9


def test_missing_rows():
    """Missing and unsolved rows are left out."""
    bench = robot()
    readings = table(bench)
    readings.position[3] = np.nan
    readings.quaternion[4] = np.nan
    readings.beta[5] = [0.01, 0.02]
    fit = joint.fit(bench, readings, "tracker.frame", noise=NOISE)
    assert fit.excluded == [5] and any(f"row {readings.row[5]}:" in text for text in fit.warnings)
    assert (fit.weights[3] == [0, fit.weights[3, 1]]).all() and fit.weights[3, 1] > 0
    assert np.isnan(fit.residual[5]).all() and np.isnan(fit.residual[3, :3]).all()
    only_positions = joint.fit(bench, replace(readings, quaternion=None), "tracker.frame", noise=NOISE)
    assert only_positions.observations == 3 * 78 and np.isnan(only_positions.residual[:, 3:]).all()


def test_doubtful_tables():
    """Warnings name the shortcomings of a table."""
    bench = robot()
    readings = table(bench, rows=5)
    one = replace(readings, run=np.zeros(5, int), beta=readings.beta[[0] * 5], alpha=readings.alpha[[0] * 5])
    text = " ".join(joint.fit(bench, one, "standard").warnings)
    assert "all joints are the same" in text and "only one run" in text
    text = " ".join(joint.fit(bench, table(bench, rows=2), "standard").warnings)
    assert "only 12 numbers were measured for 18 parameters" in text
    with pytest.raises(InputError, match="no reading is left"):
        joint.fit(bench, replace(readings, position=None, quaternion=None), "standard")
    bench.tracker.jitter_mm = None
    with pytest.raises(InputError, match="jitter_mm: a fit needs"):
        joint.fit(bench, readings, "standard")


def test_any_model():
    """Any model can be fitted."""
    slope = np.random.default_rng(1).standard_normal((60, 2))
    measured, zero = slope @ [1.0, -0.5], np.zeros(2)
    model = LinearModel(measured, -slope, zero, zero)
    noise = Noise(position_jitter=0.01, rotation_jitter=0.01)
    fit = joint.fit_joint(model, Priors(["a", "b"], zero, zero + 1, zero - inf, zero + inf), noise, np.zeros((10, 3)))
    np.testing.assert_allclose(fit.values, [1, -0.5], atol=1e-3)


def _with_field(readings, noise, random):
    """The same readings with the tracker's smooth error."""
    distance = np.linalg.norm(readings.position[:, None] - readings.position[None], axis=2)
    covariance = np.exp(-(distance**2) / (2 * noise.correlation_length**2)) + 1e-9 * np.eye(len(readings))
    field = np.linalg.cholesky(covariance) @ random.standard_normal((len(readings), 6))
    readings.position[:] += noise.position_field * field[:, :3]
    turn = quaternion_from_rotation_vector(noise.rotation_field * field[:, 3:])
    readings.quaternion[:] = product(turn, readings.quaternion)
    return readings


@pytest.mark.slow
def test_coverage():
    """A long study over 200 robots."""
    nominal = robot()
    names = parameters.expand("standard", nominal)
    mean, sd, _, _ = parameters.priors(nominal, names)
    noise = noise_of(nominal)
    within, chi_square, p_values, errors, floors = [], [], [], [], []
    for seed in range(200):
        random = np.random.default_rng(seed)
        truth = parameters.applied(nominal, names, mean + sd * random.standard_normal(len(names)))
        readings = _with_field(table(truth, 80, seed, noise), noise, random)
        held_out = readings.run % 4 == 3
        fit = joint.fit(nominal, readings, names, rows=~held_out, noise=noise, starts=1)
        assert fit.converged, fit.status
        true_values = _values(truth, nominal, names)
        within.append(np.abs(fit.values - true_values) < 2 * fit.sd)
        chi_square.append(fit.reduced_chi_square)
        p_values.append(fit.p_value)
        errors.append(fit.rms_mm(held_out) ** 2)
        floors.append(fit.expected_mm(held_out) ** 2)
    assert 0.90 < np.mean(within) < 0.98
    assert np.mean(chi_square) == pytest.approx(1, abs=0.03)
    assert np.mean(np.array(p_values) < 0.05) < 0.12
    assert np.sqrt(np.mean(errors) / np.mean(floors)) == pytest.approx(1, abs=0.1)


def _values(truth, nominal, names):
    """The truth in the parameters of a fit that starts from the nominal robot."""
    from scipy.spatial.transform import Rotation

    known = parameters.names_of(truth.n_tubes)
    values = parameters.values(truth)[[known.index(name) for name in names]]
    turn = Rotation.from_matrix(truth.tracker.rotation @ nominal.tracker.rotation.T).as_rotvec()
    for i, name in enumerate(names):
        if name.startswith("tracker.rotation."):
            values[i] = turn["xyz".index(name[-1])]
    return values


def test_many_rows(monkeypatch):
    """Where the starts are compared on a part of the rows, the fit of all of them is the same."""
    nominal = robot()
    readings = table(nominal, rows=200)
    at_once = joint.fit(nominal, readings, noise=NOISE)
    monkeypatch.setattr(settings, "FEW_ROWS", 50)
    from_a_part = joint.fit(nominal, readings, noise=NOISE)
    assert from_a_part.starts and from_a_part.evaluations < at_once.evaluations
    np.testing.assert_array_less(np.abs(from_a_part.values - at_once.values), 0.05 * at_once.sd + 1e-12)


def test_only_some_rows():
    """A linearised fit of some rows alone is that of the table without the others, and whitens alike."""
    nominal = robot()
    readings = table(nominal, rows=60)
    fit = joint.fit(nominal, readings, noise=noise_of(nominal), starts=1)
    some = readings.run < 3
    alone = joint.linear_fit(fit, only=some, inflation=np.ones(2))
    among = joint.linear_fit(fit, rows=some, inflation=np.ones(2))
    assert len(alone.weights) == np.sum(some) and alone.observations == among.observations
    assert alone.log_evidence == pytest.approx(among.log_evidence, abs=0.05)
    np.testing.assert_array_less(np.abs(alone.values - among.values), 0.05 * among.sd + 1e-12)
    square = [np.sum(a.whiten(x) ** 2) for a, x in ((alone, fit.residual[some]), (among, fit.residual))]
    assert square[0] == pytest.approx(square[1], rel=0.02)


def test_growing_parts(monkeypatch):
    """Where ever larger parts of very many rows start one another, outliers among them, the fit of all is the same."""
    nominal = robot()
    readings = table(nominal, rows=1500)
    strays = np.random.default_rng(1).choice(1500, 40, replace=False)
    readings.position[strays] += 2e-3
    at_once = joint.fit(nominal, readings, noise=NOISE, starts=1)
    monkeypatch.setattr(settings, "FEW_ROWS", 50)
    parts = [int(np.sum(part)) for part in folds.growing(np.ones(1500, bool))]
    assert len(parts) == 3 and parts == sorted(parts) and parts[-1] == 1500
    grown = joint.fit(nominal, readings, noise=NOISE, starts=1)
    np.testing.assert_array_less(np.abs(grown.values - at_once.values), 0.05 * at_once.sd + 1e-12)
    np.testing.assert_allclose(grown.sd, at_once.sd, rtol=0.01)
    assert set(np.flatnonzero(grown.weights[:, 0] < settings.OUTLIER_WEIGHT)) == set(strays)


def test_frame_first():
    """A tracker frame that is far off is fitted before the other parameters."""
    bench = robot()
    readings = table(bench, rows=40)
    moved = bench.model_copy(deep=True)
    moved.tracker.position_mm = [p + s for p, s in zip(bench.tracker.position_mm, (80, -60, 90), strict=True)]
    moved.tracker.rotation_vector_rad = [1.0, 1.5, -1.3]
    found = joint.fit(moved, readings, "standard", noise=NOISE, starts=1, sd={"tracker.frame": inf})
    assert found.nominal_rms_mm() > 100 and found.rms_mm() < 0.1
    assert found.evaluations <= 6  # twice as many where the rest is dragged along
