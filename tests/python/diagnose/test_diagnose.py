"""`diagnose` names what was hidden, says so where nothing was, and where the data cannot tell."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import add, decision, diagnose
from ctcr.diagnose import race as racing
from ctcr.diagnose.analysis import _beyond_judging
from ctcr.diagnose.engine import Linear
from ctcr.diagnose.far_off import come_together, far_off
from ctcr.diagnose.leftover import Leftover
from ctcr.diagnose.verdict import judge
from ctcr.effects import catalogue
from ctcr.fit import folds
from ctcr.fit.coverage import Coverage
from ctcr.fit.folds import groups, held_out_rows
from ctcr.model import parameters, recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from hidden_sessions import measured, measured_session, session

ROBOT = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"
IDS = {
    "friction",
    "backlash_rotation",
    "backlash_translation",
    "delay",
    "tip_load",
    "precurvature_profile",
    "softening",
    "anisotropy",
    "straight_curvature",
    "clearance",
    "torsional_compliance",
    "sensor_offset",
    "field_distortion",
    "frame_drift",
    "frame_jump",
    "periodic_rotation",
    "periodic_translation",
    "entry_compliance",
    "entry_clearance",
    "helical_precurvature",
    "contact",
}


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


def test_the_catalogue_has_its_stable_ids():
    assert IDS <= set(catalogue.known_effects())


def test_nothing_is_missing_where_nothing_was_hidden(robot):
    result = diagnose(robot, measured(robot, np.random.default_rng(1), {}))
    assert result.verdict.word == "nothing_missing"
    assert not result.accepted
    assert result.rms_mm["with_effects"] < 1.2 * result.rms_mm["noise_floor"]
    json.dumps(result.as_json(), allow_nan=False)


@pytest.mark.parametrize(
    ("hidden", "identity"),
    [
        ({"effects.backlash_rotation.play.1": 0.01, "effects.backlash_rotation.play.2": 0.008}, "backlash_rotation"),
        ({"effects.tip_load.mass": 2e-3}, "tip_load"),
    ],
)
def test_a_hidden_effect_is_named(robot, hidden, identity):
    result = diagnose(robot, measured(robot, np.random.default_rng(2), hidden))
    assert result.accepted[0].ids[0] == identity
    assert result.verdict.word in ("identified", "probable")
    found = result.as_json()["effects"][0]
    assert found["class"][0] == identity and found["delta_log_evidence"] > 8
    rms = result.rms_mm
    assert rms["with_effects"] < 1.2 * rms["noise_floor"] < rms["calibrated"] * 1.2
    for name, value in hidden.items():
        place = result.final.names.index(name)
        assert abs(result.final.values[place] - value) < 4 * result.final.sd[place]


def test_positions_alone_need_no_jitter_of_orientations(robot):
    plain = robot.model_copy(deep=True)
    plain.tracker.jitter_deg = plain.tracker.accuracy_95_deg = None
    table = measured(robot, np.random.default_rng(2), {"effects.tip_load.mass": 3e-3})
    result = diagnose(plain, dataclasses.replace(table, quaternion=None))
    assert result.accepted[0].ids[0] == "tip_load"
    added = add.add(plain, dataclasses.replace(table, quaternion=None), ["tip_load"])
    assert added.fit.rms_mm() < 1.5 * result.rms_mm["noise_floor"]


def test_a_wall_that_few_tips_touch_is_no_set_of_outliers(robot):
    """The fit would drop the readings that touch it, and then find nothing."""
    tips = measured(robot, np.random.default_rng(4), {}, calibration=0).position
    base = (tips - robot.tracker.position) @ robot.tracker.rotation
    azimuth = 2.0
    reach = base @ [np.cos(azimuth), np.sin(azimuth), 0]
    hidden = {"stiffness": 60.0, "distance": np.quantile(reach, 0.85), "azimuth": azimuth}
    table = measured(
        robot, np.random.default_rng(4), {f"effects.contact.{name}": value for name, value in hidden.items()}
    )
    result = diagnose(robot, table)
    assert result.accepted[0].ids == ["contact"]
    assert racing.outliers(result.final) <= racing.MOST_OUTLIERS
    floor, seen = result.rms_mm["noise_floor"], ~result.locked
    assert result.final.rms_mm(seen) < 1.1 * floor < 2 * floor < result.calibrated.rms_mm(seen)


@pytest.mark.parametrize(
    ("score", "is_further", "is_rejected", "accepts"),
    [
        (9, False, True, True),
        (9, False, False, False),
        (14, False, False, True),
        (14, True, False, False),
        (19, True, False, True),
    ],
)
def test_more_evidence_is_needed_where_noise_explains_what_is_left(score, is_further, is_rejected, accepts):
    round_ = decided(score, 1.0, is_further, is_rejected)
    assert (round_.accepted is not None) == accepts
    assert accepts or "below" in round_.reason


def test_a_round_is_hopeless_only_where_all_readings_could_not_change_it():
    round_ = decided(3.0, 1.0, is_further=False, is_rejected=False)
    assert round_.accepted is None
    assert round_.is_hopeless(2) and not round_.is_hopeless(3)
    round_ = decided(100.0, 0.01, is_further=True, is_rejected=True)
    assert round_.accepted is None and not round_.is_hopeless(1.5)
    share = decision.SHARE - 0.05
    assert decided(100.0, share, True, True, spread=0.02).is_hopeless(1.5)
    assert not decided(100.0, share, True, True, spread=0.03).is_hopeless(1.5)
    assert racing.Round("a fit", [], {}).is_hopeless(1e6)


def leftover(rejected, places=()):
    return Leftover(rejected, list(places), None, SimpleNamespace(chosen=[]), None)


@pytest.mark.parametrize(
    ("rejected", "struck", "word"),
    [
        (False, "nothing", "nothing_missing"),
        (True, "nothing", "not_in_catalogue"),
        (False, "readings", "nothing_missing"),
        (False, "places", "not_in_catalogue"),
    ],
)
def test_what_happens_at_a_place_is_missing_and_what_strikes_a_reading_is_not(robot, rejected, struck, word):
    table = measured_session(robot)  # every run is driven out and back
    fit = fit_with(table, struck, np.random.default_rng(3))
    assert far_off(fit).sum() == (0 if struck == "nothing" else 8)
    left = leftover(rejected, table.row[come_together(table, fit)])
    said = judge(fit, fit, [], left, np.zeros(len(table), bool), {}, False)
    assert said.word == word and left.structured == (word == "not_in_catalogue")
    assert (struck == "places") == ("8 readings (rows" in " ".join(said.sentences))


def test_a_model_that_is_wrong_everywhere_is_not_wrong_at_a_place(robot):
    table = measured_session(robot)
    fit = fit_with(table, "places", np.random.default_rng(3))
    assert come_together(table, fit).sum() == 8
    fit.inflation[:] = 20.0
    assert not come_together(table, fit).any()
    fit.inflation[:], fit.weights[:] = 1.0, 1.0  # nor is what nobody took for outliers
    assert not come_together(table, fit).any()


def fit_with(table, struck, random):
    """Residuals of noise, of which 8 are 0.5 mm: single readings, or both visits to four places."""
    error = np.hstack([3e-5 * random.standard_normal((len(table), 3)), np.zeros((len(table), 3))])
    joints = np.column_stack([table.beta, table.alpha, table.force])
    visits = [np.flatnonzero((joints == row).all(axis=1)) for row in np.unique(joints, axis=0)]
    pairs = random.permutation([visit for visit in visits if len(visit) == 2])
    if struck == "places":
        error[pairs[:4, 0], 0] = error[pairs[:4, 1], 0] = 5e-4
    if struck == "readings":
        error[pairs[:8, 0], 0] = 5e-4
    weights = np.ones((len(table), 2))
    weights[np.abs(error[:, 0]) > 3e-4, 0] = 1e-4
    return SimpleNamespace(
        residual=error,
        weights=weights,
        expected_square=np.full((len(table), 2), 3 * 3e-5**2),
        inflation=np.ones(2),
        noise=SimpleNamespace(position_jitter=3e-5),
        rms_mm=lambda rows: 0.06,
    )


def test_linear_gain_is_the_evidence_of_a_linear_model():
    random = np.random.default_rng(3)
    for _ in range(20):
        A, B, r = random.normal(size=(30, 4)), random.normal(size=(30, 2)), random.normal(size=30)
        z = -np.linalg.solve(A.T @ A + np.eye(4), A.T @ r)  # the most probable calibration, prior of unit variance

        def log_evidence(columns, r=r):
            covariance = np.eye(30) + columns @ columns.T
            return -0.5 * (r @ np.linalg.solve(covariance, r) + np.linalg.slogdet(covariance)[1])

        gain = Linear(r + A @ z, A).gain(B)
        assert gain.log_evidence == pytest.approx(log_evidence(np.hstack([A, B])) - log_evidence(A), abs=1e-9)


def test_rows_are_locked_by_run(robot):
    table = measured_session(robot)
    locked = held_out_rows(robot, table)
    assert 0.2 <= locked.mean() <= 0.3
    for run in np.unique(table.run):
        assert np.ptp(locked[table.run == run].astype(int)) == 0
    one = dataclasses.replace(table, run=np.zeros_like(table.run))
    assert len(np.unique(groups(one))) == 12 and np.all(np.diff(groups(one)) >= 0)


def test_what_is_locked_follows_no_plan_that_alternates(robot):
    table = measured_session(robot, runs=16)
    for turn in range(4):
        runs = np.unique(table.run[held_out_rows(robot, table, turn)])
        assert len(runs) == 4
        for period in (2, 4):
            assert len(set(runs % period)) > 1, (turn, period)


def with_one_odd_run(robot, odd):
    """Only in the run `odd` the outermost tube shows where its curve starts."""
    table = measured_session(robot, runs=12)
    length = robot.tubes[2].length
    shown = np.where(table.run == odd, 0.06, np.minimum(table.beta[:, 2] + length, 0.044))
    beta = np.column_stack([table.beta[:, :2], shown - length])
    return dataclasses.replace(table, beta=beta)


def test_a_run_that_goes_where_no_other_went_judges_nothing(robot):
    odd = np.unique(session(robot, np.random.default_rng(0), runs=12).run)[2]
    table = with_one_odd_run(robot, odd)
    coverage = Coverage(robot, table, folds.measured_rows(table), groups(table))
    assert coverage.undetermined([odd])[0] > 100 * settings.MOST_UNDETERMINED
    locked = held_out_rows(robot, table)
    assert not locked[table.run == odd].any() and len(np.unique(table.run[locked])) == 3
    assert coverage.undetermined(np.unique(table.run[locked])).max() <= settings.MOST_UNDETERMINED
    # What was read has no say.
    moved = np.random.default_rng(1).normal(size=(len(table), 3))
    np.testing.assert_array_equal(locked, held_out_rows(robot, dataclasses.replace(table, position=moved)))


@pytest.mark.parametrize(
    ("identity", "judges"), [("friction", False), ("backlash_rotation", False), ("softening", True)]
)
def test_the_first_run_judges_no_effect_that_remembers(robot, identity, judges):
    table = measured_session(robot)
    accepted = [SimpleNamespace(entry=SimpleNamespace(id=identity))]
    fit = SimpleNamespace(expected_square=np.ones((len(table), 2)))
    for locked in ({0, 5}, {2, 5}):
        result = SimpleNamespace(robot=robot, measurements=table, with_effects=fit, accepted=accepted)
        result.locked = np.isin(groups(table), list(locked))
        assert _beyond_judging(result) == (set() if judges else {0} & locked)


def test_what_is_left_open_is_the_variance_of_a_prediction(robot):
    """Against that of fits to readings with noise alone."""
    random, table = np.random.default_rng(5), with_one_odd_run(robot, 3)
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    noise = noise_of_readings(robot, table, field=False)
    core = recording.recording_of(robot, table, names)
    core.activate([True] * len(table))
    slopes = np.nan_to_num(core.residual(mean, True)[1]).reshape(len(table), 6, -1)
    fitted, jitter = table.run != 7, np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    A = (slopes[fitted] / jitter[:, None]).reshape(-1, len(names)) * sd
    seen = []
    for _ in range(400):
        truth, error = random.normal(size=len(names)), random.normal(size=len(A))
        found = np.linalg.solve(A.T @ A + np.eye(len(names)), A.T @ (A @ truth + error))
        missed = slopes[~fitted][:, :3] @ (sd * (found - truth))
        seen.append(np.mean(np.sum(missed**2, axis=1)))
    open_ = Coverage(robot, table, folds.measured_rows(table), groups(table)).undetermined([7])[0]
    part = np.mean(seen) / (3 * noise.position_jitter**2) / open_
    assert 0.6 < part < 1.15, part  # open_ is the worst of three lengths of the curves


def test_what_is_locked_holds_poses(robot):
    """Rows without a pose, such as way points, make no group of their own."""
    table = measured_session(robot)
    for part in (table, dataclasses.replace(table, run=np.zeros_like(table.run))):
        for turn in range(4):
            seen = ~held_out_rows(robot, part, turn)
            blind = dataclasses.replace(part, position=np.where(seen[:, None], part.position, np.nan))
            for again in range(4):
                assert (held_out_rows(robot, blind, again) & seen).any(), (turn, again)


@pytest.mark.parametrize(("scores", "kept"), [([40.0, 33.0, 15.0], [0, 1]), ([-9.0, -3.0], [1])])
def test_of_many_rows_the_best_candidate_is_always_refitted(monkeypatch, scores, kept):
    """Also where a few rows alone do not speak for it."""
    entries = [dataclasses.replace(blank, refit=score) for score in scores]
    monkeypatch.setattr(racing, "refitted", lambda engine, base, tried, fixed, progress: tried)
    monkeypatch.setattr(folds, "few_of", lambda rows: rows)
    engine = ManyRows(np.ones(4, bool))
    before = SimpleNamespace(names=[], values=[], noise=None, weights=None, inflation=None)
    found = racing._in_reach(engine, before, entries, {}, lambda _: None)
    assert [entries.index(entry) for entry in found] == kept


blank = racing.Entry(candidate=None, gain=None)


def decided(score, share, is_further, is_rejected, spread=np.inf):
    """The round of one candidate among 21."""
    delay = SimpleNamespace(id="delay", shape=())
    only = dataclasses.replace(blank, candidate=delay, refit=score, share=share, spread=spread, fit="a fit")
    round_ = racing.Round("a fit", [only], {})
    decision.decide(round_, 21, is_further, is_rejected)
    return round_


@dataclasses.dataclass
class ManyRows:
    """Stands for an engine whose fits nobody looks at."""

    rows: np.ndarray

    @property
    def fitted(self):
        return self.rows

    def fit_like(self, *_, **__):
        return None
