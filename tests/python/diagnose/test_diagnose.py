"""`diagnose` names what was hidden, says so where nothing was, and where the data cannot tell."""

import json
from dataclasses import replace

import numpy as np
import pytest
from ctcr.diagnose import add, diagnose
from ctcr.diagnose.linearised import Linear
from ctcr.diagnose.outliers import down_weighted
from ctcr.diagnose.pipeline import _undetermined_groups
from ctcr.effects import catalogue
from ctcr.fit.folds import groups
from hidden_sessions import measured

IDS = set(
    (
        "friction backlash_rotation backlash_translation delay tip_load precurvature_profile softening anisotropy "
        "straight_curvature clearance torsional_compliance sensor_offset field_distortion frame_drift frame_jump "
        "periodic_rotation periodic_translation entry_compliance entry_clearance helical_precurvature contact "
        "creep"
    ).split()
)


def test_stable_ids():
    """Files of robots and diagnoses name effects by their ids."""
    assert IDS <= set(catalogue.all_effects(1))


def test_nothing_missing(robot):
    """Where nothing was hidden nothing is found, and the error on held-out runs is noise."""
    result = diagnose(robot, measured(robot, np.random.default_rng(1), {}))
    assert result.verdict.word == "nothing_missing"
    assert not result.accepted and not result.widened
    assert result.rms_mm["with_effects"] < 1.2 * result.rms_mm["noise_floor"]
    json.dumps(result.as_dict(), allow_nan=False)


def names_what_was_hidden(result, hidden, identity):
    assert result.accepted[0].ids[0] == identity
    assert result.verdict.word in ("identified", "probable")
    found = result.as_dict()["effects"][0]
    assert found["class"][0] == identity and found["delta_log_evidence"] > 8
    rms = result.rms_mm
    assert rms["with_effects"] < 1.2 * rms["noise_floor"] < rms["calibrated"] * 1.2
    for name, value in hidden.items():
        i = result.final.names.index(name)
        assert abs(result.final.values[i] - value) < 4 * result.final.sd[i]


def test_backlash(robot):
    """Play of the drives is named, with its values within their uncertainty."""
    hidden = {"effects.backlash_rotation.play.1": 0.01, "effects.backlash_rotation.play.2": 0.008}
    names_what_was_hidden(
        diagnose(robot, measured(robot, np.random.default_rng(2), hidden)), hidden, "backlash_rotation"
    )


def test_creep(robot):
    """So is curvature that tubes lose or regain with time, which no frame that drifts explains."""
    hidden = {"effects.creep.loss.1": 0.04, "effects.creep.loss.2": -0.03}
    names_what_was_hidden(diagnose(robot, measured(robot, np.random.default_rng(3), hidden)), hidden, "creep")


@pytest.mark.parametrize("seed", [1, 2])
def test_heavy_cap(robot, seed):
    """So is a force that is always there, and not a surface which the tip never leaves."""
    result = diagnose(robot, measured(robot, np.random.default_rng(seed), {"effects.tip_load.force_y": -0.15}))
    assert [accepted.ids for accepted in result.accepted] == [["tip_load"]]


def test_outliers_of_a_part(robot):
    """Where a part of the readings is far off, as where the robot snapped or a run went wrong, something is missing."""
    plain = measured(robot, np.random.default_rng(3), {})
    leap = 0.02 * np.random.default_rng(4).normal(size=(len(plain), 3))
    for bad in (plain.run == 4, np.random.default_rng(5).random(len(plain)) < 0.2):
        result = diagnose(robot, replace(plain, position=plain.position + np.where(bad[:, None], leap, 0.0)))
        assert result.verdict.word == "not_in_catalogue"
        assert any("outliers" in sentence for sentence in result.verdict.sentences)


def test_tip_load(tip_load):
    """A weight at the tip is named, with its mass within its uncertainty."""
    names_what_was_hidden(tip_load, {"effects.tip_load.mass": 2e-3}, "tip_load")


@pytest.mark.parametrize(
    "hidden", [{}, {"effects.backlash_rotation.play.1": 0.012, "effects.backlash_rotation.play.2": 0.01}]
)
def test_wrong_sheet(robot, hidden):
    """Of a robot file that is wrong by many times what it says, the faults are named, and what is hidden besides; the
    error falls to noise."""
    table = measured(robot, np.random.default_rng(3), hidden)
    file = robot.model_copy(deep=True)
    file.tracker.position_mm = (np.array(file.tracker.position_mm) + [6.0, -7.0, 5.0]).tolist()
    for tube, factor in zip(file.tubes, (1.18, 0.83, 0.85), strict=True):
        tube.curvature_per_m *= factor
    table = replace(table, alpha=table.alpha + np.radians([7.0, -8.0, 6.0]))
    result = diagnose(file, table)
    assert [a.id for a in result.accepted] == (["backlash_rotation"] if hidden else [])
    assert hidden or result.verdict.word == "nothing_missing"
    said = {one["uncertainty"]: one["factor"] for one in result.as_dict()["widened"]}
    assert {"tracker_frame_mm", "rotation_offset_deg"} <= said.keys() and min(said.values()) > 1
    assert any("the home rotations, 1 deg, is contradicted by the data: widened" in text for text in result.notices)
    assert result.rms_mm["with_effects"] < 1.2 * result.rms_mm["noise_floor"]


def test_positions_alone(robot):
    """Readings without orientations need no jitter of orientations."""
    plain = robot.model_copy(deep=True)
    plain.tracker.jitter_deg = plain.tracker.accuracy_95_deg = None
    table = replace(measured(robot, np.random.default_rng(2), {"effects.tip_load.mass": 3e-3}), quaternion=None)
    result = diagnose(plain, table)
    assert result.accepted[0].ids[0] == "tip_load"
    assert add.add(plain, table, ["tip_load"]).fit.rms_mm() < 1.5 * result.rms_mm["noise_floor"]


@pytest.mark.parametrize("play", [0.0, 0.1])
def test_contact_of_few_readings(robot, play):
    """A wall that few tips touch is named, also beside a larger effect: its readings are not dropped as outliers."""
    tips = measured(robot, np.random.default_rng(4), {}, calibration=0).position
    base = (tips - robot.tracker.position) @ robot.tracker.rotation
    azimuth = 2.0
    reach = base @ [np.cos(azimuth), np.sin(azimuth), 0]
    wall = {"stiffness": 60.0, "distance": np.quantile(reach, 0.85), "azimuth": azimuth}
    hidden = {f"effects.contact.{name}": value for name, value in wall.items()}
    hidden |= {f"effects.backlash_rotation.play.{i}": play for i in (1, 2, 3) if play}
    result = diagnose(robot, measured(robot, np.random.default_rng(4), hidden))
    found = [set(a.ids) for a in result.accepted]
    assert found[-1] == {"contact"} and len(found) == (2 if play else 1)
    assert not play or "backlash_rotation" in found[0]
    assert not result.residual.strays
    assert down_weighted(result.final).sum() <= 0.01 * (result.final.weights[:, 0] > 0).sum()
    floor, seen = result.rms_mm["noise_floor"], ~result.held_out
    assert result.final.rms_mm(seen) < 1.1 * floor < 2 * floor < result.calibrated.rms_mm(seen)


def test_linear_gain():
    """The gain is exact for a linear model: the difference of two log evidences."""
    random = np.random.default_rng(3)
    for _ in range(20):
        A, B, r = random.normal(size=(30, 4)), random.normal(size=(30, 2)), random.normal(size=30)
        z = -np.linalg.solve(A.T @ A + np.eye(4), A.T @ r)  # the most probable calibration, prior of unit variance

        def log_evidence(columns, r=r):
            covariance = np.eye(30) + columns @ columns.T
            return -0.5 * (r @ np.linalg.solve(covariance, r) + np.linalg.slogdet(covariance)[1])

        gain = Linear(r + A @ z, A).gain(B)
        assert gain.log_evidence == pytest.approx(log_evidence(np.hstack([A, B])) - log_evidence(A), abs=1e-9)


@pytest.mark.parametrize(
    ("identity", "judges"), [("friction", False), ("backlash_rotation", False), ("softening", True)]
)
def test_first_run_and_history(tip_load, identity, judges):
    """The first run does not judge an effect that depends on the history: how the robot came there is unknown."""
    (one,) = tip_load.accepted
    accepted = [replace(one, best=replace(one.best, candidate=replace(one.best.candidate, id=identity)))]
    group = groups(tip_load.measurements)
    for held_out in ({0, 5}, {2, 5}):
        found = replace(tip_load, accepted=accepted, held_out=np.isin(group, list(held_out)))
        assert (0 in _undetermined_groups(found)) == (0 in held_out and not judges)
