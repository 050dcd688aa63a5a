"""`ctcr compare` finds planted errors, finds none in noise, and counts the rows that it left out."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from compare_bench import JITTER_MM, bench, outward, stop_and_go, stream, tips
from ctcr import settings
from ctcr.compare import compare, report, terminal
from ctcr.compare.same_joints import pairs_of_runs
from ctcr.compare.summary import differs, findings, headline, is_noise, limits, quiet
from ctcr.errors import InputError
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.model import status_text
from ctcr.show import output
from scipy.spatial.transform import Rotation

OUT_OF_ORDER, NOT_CONVERGED = 1, 3


def constant(vector_mm):
    return lambda joints, t, run: np.tile(np.array(vector_mm) * 1e-3, (len(run), 1))


def test_false_alarms(monkeypatch):
    """Noise alone gives a finding in 5 % of tables.

    7 or more of 40 come once in 300 times; in every other table the runs share joints.
    """
    monkeypatch.setattr("ctcr.settings.SIGN_TRIALS", 399)
    alarms = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        result = compare(*bench(random, stop_and_go(random, runs=8, stops=6, shared=seed % 2 == 0)))
        alarms += bool(findings(result))
        assert result.position_mm.rms == pytest.approx(JITTER_MM * 3**0.5, rel=0.15)
    assert alarms <= 6


def test_noise():
    """An error of noise alone is called noise, and has no hysteresis."""
    random = np.random.default_rng(1)
    result = compare(*bench(random, stop_and_go(random)))
    assert is_noise(result)
    assert "nothing to explain" in headline(result)
    assert any("There is no hysteresis" in text for text in quiet(result))


@pytest.mark.parametrize("seed", range(3))
def test_offset(seed):
    """A constant offset is found with its size, and nothing else is."""
    random = np.random.default_rng(seed)
    vector = random.normal(0, 0.5, 3)
    result = compare(*bench(random, stop_and_go(random), constant(vector), turn=(0, 0, 0)))
    assert result.shift.p_value <= settings.LEVEL
    np.testing.assert_allclose(result.shift.vector_mm, vector, atol=4 * JITTER_MM / np.sqrt(180))
    assert result.shift.share == pytest.approx(1 - 3 * JITTER_MM**2 / (vector @ vector + 3 * JITTER_MM**2), abs=0.02)
    assert findings(result)[0].text.startswith("A constant offset")
    assert not result.ranking.chosen


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("alpha1", lambda q, t, run: 1e-3 * np.column_stack([np.cos(q[:, 2]), 0 * t, 0 * t])),
        ("alpha12", lambda q, t, run: 1e-3 * np.column_stack([0 * t, 0 * t, np.cos(q[:, 2] - q[:, 3])])),
        ("length2", lambda q, t, run: 0.1 * np.column_stack([0 * t, q[:, 1] + 0.08, 0 * t])),
    ],
)
def test_dependence(name, error):
    """The planted dependence is ranked first, with its size and significance."""
    random = np.random.default_rng(5)
    path = stop_and_go(random, runs=14)
    result = compare(*bench(random, path, error))
    first = result.ranking.alone[0]
    best = next(found for found in result.ranking.alone if found.name == name)
    planted = error(path[0], path[2], path[1])
    variance = np.mean(np.sum((planted - planted.mean(axis=0)) ** 2, axis=1))
    # The tip's position follows the joints: a quantity of it may predict as well and come first by a hair.
    assert best.share > first.share - 0.01
    assert best.p_value <= settings.LEVEL
    assert 0.8 < best.share <= 1
    assert best.size_mm == pytest.approx(np.sqrt(variance) * 1e3, rel=0.1)
    assert result.ranking.chosen[0].name == first.name


def test_two_dependences():
    """The weaker dependence is found in the residual of the stronger one."""
    random = np.random.default_rng(6)

    def error(q, t, run):
        return 1e-3 * np.column_stack([np.cos(q[:, 2]), 0 * t, 0.6 * np.cos(q[:, 2] - q[:, 3])])

    result = compare(*bench(random, stop_and_go(random, runs=20), error))
    first, second = result.ranking.chosen[:2]
    assert "base angle α1" in (first.label, *first.indistinct)
    assert "joint difference α1 − α2" in (second.label, *second.indistinct)
    assert result.ranking.explained > 0.85


def test_indistinct():
    """While the second angle stands still, the data do not distinguish the first angle from the difference."""
    random = np.random.default_rng(7)
    joints, run, t = stop_and_go(random, runs=12)
    joints[:, 3] = 0.4
    result = compare(*bench(random, (joints, run, t), lambda q, t, run: 1e-3 * np.cos(q[:, [2, 2, 2]])))
    first = result.ranking.chosen[0]
    assert {"base angle α1", "joint difference α1 − α2"} <= {first.label, *first.indistinct}
    assert "base angle α2" in result.as_dict()["never_varied"]
    assert any("base angle α2" in text for text in limits(result))


@pytest.mark.parametrize("seed", range(3))
def test_hysteresis(seed):
    """An offset that depends on the direction is found; half of it is the floor of a model without history."""
    random = np.random.default_rng(seed)
    path = stop_and_go(random)
    vector = random.normal(0, 0.3, 3)
    result = compare(*bench(random, path, lambda q, t, run: outward(q, run)[:, None] * vector * 1e-3))
    d = result.direction
    size = np.linalg.norm(vector)
    assert differs(d)
    assert d.p_against_same <= settings.LEVEL
    assert d.typical_rms_mm == pytest.approx(d.rms_mm, rel=0.4)
    assert d.floor_mm == pytest.approx(np.hypot(size, JITTER_MM * np.sqrt(1.5)), rel=0.05)
    assert any("There is hysteresis" in item.text for item in findings(result))


def test_outliers():
    """Three outliers are counted, and are no hysteresis."""
    random = np.random.default_rng(4)
    robot, readings, prediction = bench(random, stop_and_go(random))
    readings.position[[31, 77, 140]] += 0.003
    result = compare(robot, readings, prediction)
    assert not differs(result.direction)
    assert result.direction.outliers == 3
    assert result.direction.typical_rms_mm == pytest.approx(JITTER_MM * 6**0.5, rel=0.15)
    assert any("Pairs far beyond that: 3" in text for text in quiet(result))


@pytest.mark.parametrize("stops, rows, far", [(5, 6, 1), (9, 17, 3)])
def test_few_pairs(stops, rows, far):
    """A few pairs of visits, of which some lie far apart, neither show hysteresis nor rule it out."""
    random = np.random.default_rng(4)
    path = [column[:rows] for column in stop_and_go(random, runs=1, stops=stops)]
    late = np.arange(rows)[:, None] >= rows - far
    result = compare(*bench(random, path, lambda q, t, run: late * np.full(3, 1e-3)))
    assert not differs(result.direction)
    assert not any("hysteresis" in text for text in quiet(result))
    [text] = [text for text in limits(result) if "hysteresis" in text]
    assert text.startswith("Too few joints") and ("(1 pair:" in text) == (rows == 6)


@pytest.mark.parametrize("hours", [0.5, 14])
def test_long_pause(hours):
    """A night inside a run is named with the row after it; one between runs, or a break, is not."""
    random = np.random.default_rng(1)
    joints, run, t = stop_and_go(random, runs=2)
    first = int(np.argmax(run == 1))
    for row in (first, first + 5):
        t[row:] += 3600.0 * hours
    said = [text for text in limits(compare(*bench(random, (joints, run, t)))) if " pauses for " in text]
    assert len(said) == (hours > 1)
    assert not said or said[0].startswith(f"Run 1 pauses for 14.0 h before row {first + 7}. ")


def test_one_pose():
    """Readings at one pose are drawn without a warning, and nothing is a hint on their error."""
    random = np.random.default_rng(1)
    path = [np.repeat(column[:1], 30, axis=0) for column in stop_and_go(random)]
    path[2] = 2.0 * np.arange(30)
    result = compare(*bench(random, path, constant((0.0, 0.0, 2.0))))
    assert not any("hint" in text for text in quiet(result))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert report.page(result)


def test_poor_repeatability():
    """Every visit errs by itself, far beyond the jitter: that is not called noise."""
    random = np.random.default_rng(8)
    result = compare(*bench(random, stop_and_go(random), noise_mm=0.6))
    assert result.direction.p_against_same > settings.LEVEL
    assert differs(result.direction)
    assert "readings repeat only to" in headline(result)
    assert any("do not give the same pose again" in item.text for item in findings(result))


@pytest.mark.parametrize("delay", [0.12, -0.05])
def test_delay(delay):
    """A planted delay is measured within its uncertainty and explains the hysteresis."""
    random = np.random.default_rng(9)
    path = stream(random)

    def late(joints, t, run):
        late_joints = np.column_stack([np.interp(t - delay, t, column) for column in joints.T])
        return tips(late_joints)[0] - tips(joints)[0]

    result = compare(*bench(random, path, late))
    d = result.direction
    assert abs(d.delay_s - delay) < max(4 * d.delay_uncertainty_s, 0.02 * abs(delay))
    assert d.rms_without_delay_mm < 0.2 * d.rms_mm
    assert result.ranking.chosen[0].name == "lag"
    assert any(f"A delay of {d.delay_s:.3f}" in item.text for item in findings(result))


def test_run_offsets():
    """Offsets of runs are found, and dependences are examined without them."""
    random = np.random.default_rng(10)
    offsets = random.normal(0, 2e-3, (10, 3))
    planted = bench(random, stop_and_go(random, shared=True), lambda q, t, run: offsets[run])
    result = compare(*planted)
    assert result.run_offsets.p_value <= settings.LEVEL
    assert result.run_offsets.found
    assert result.run_offsets.share > 0.98
    assert np.linalg.norm(result.ranking.error, axis=1).mean() * 1e3 < 2 * JITTER_MM
    assert not result.ranking.chosen


def off_in_two_runs(q, t, run):
    return np.isin(run, (3, 7))[:, None] * np.array([0.0, 0.04, 0.0]) + 1e-4 * np.cos(q[:, [0, 1, 2]])


def test_outlying_runs():
    """Two runs far from the others are named with their distance."""
    random = np.random.default_rng(11)
    result = compare(*bench(random, stop_and_go(random, runs=12, shared=True), off_in_two_runs))
    assert result.run_offsets.outlying == (3, 7)
    assert result.run_offsets.outlying_mm == pytest.approx(40, rel=0.02)
    assert any("The runs 3, 7 lie about 40.0 mm" in item.text for item in findings(result))


def test_runs_in_their_own_region():
    """An error of runs that no other run came near may belong to their joints."""
    random = np.random.default_rng(11)
    joints, run, t = stop_and_go(random, runs=12, shared=True)
    joints[np.isin(run, (3, 7)), 2] += 100.0
    result = compare(*bench(random, (joints, run, t), off_in_two_runs))
    assert result.run_offsets.outlying == () and result.run_offsets.elsewhere == (3, 7)


def test_one_run_in_its_own_region():
    """Beside a run that surely is off, one that is as far off at joints of its own is named too, and why it is less
    sure."""
    random = np.random.default_rng(11)
    joints, run, t = stop_and_go(random, runs=12, shared=True)
    joints[run == 7, 2] += 100.0
    result = compare(*bench(random, (joints, run, t), off_in_two_runs))
    assert result.run_offsets.outlying == (3,) and result.run_offsets.elsewhere == (7,)
    [text] = [item.text for item in findings(result) if "Run 3 lies about 40.0 mm" in item.text]
    assert "Run 7 lies far from them too" in text


@pytest.mark.parametrize("shared", [True, False])
def test_frame_or_robot(shared):
    """Runs with frames of their own that visit the same joints get the distance that a rigid motion leaves; others
    do not."""
    random = np.random.default_rng(10)
    planted = bench(
        random, stop_and_go(random, runs=6, shared=shared), lambda q, t, run: 1e-3 * run[:, None] * q[:, :3]
    )
    [first, *_] = findings(compare(*planted, sessions=["The runs do not share a frame."]))
    assert first.text.startswith("The runs do not share a frame.")
    assert ("after the rigid motion" in first.text and "median of 15 pairs" in first.text) == shared


@pytest.mark.parametrize("bends_mm", [0.0, 1.0])
def test_same_joints(bends_mm):
    """Frames of the runs change how far the same joints lie apart, but not what a rigid motion leaves of that: nothing
    of one robot, and all of a robot that changes."""
    random = np.random.default_rng(12)
    changes = 1e-3 * bends_mm * random.normal(size=(6, 3))
    path = stop_and_go(random, runs=6, shared=True)
    _, fixed, _ = bench(random, path, lambda q, t, run: changes[run] * np.cos(3 * q[:, 2:3]), noise_mm=0.0)
    moved = fixed.position.copy()
    for number in range(6):
        turn, shift = Rotation.from_rotvec(random.normal(0, 0.05, 3)), random.normal(0, 4e-3, 3)
        moved[path[1] == number] = turn.apply(moved[path[1] == number]) + shift
    before, after = (pairs_of_runs(readings) for readings in (fixed, replace(fixed, position=moved)))
    assert len(after) == 15 and all(pair.joints == 9 for pair in after)
    assert min(pair.apart_mm for pair in after) > 1
    left = [pair.moved_mm for pair in after]
    np.testing.assert_allclose(left, [pair.moved_mm for pair in before], rtol=1e-6, atol=1e-9)
    assert min(left) > 0.1 if bends_mm else max(left) < 1e-9


def test_gross_frame():
    """A tracker frame that is rotated by 90 degrees is named and fitted."""
    random = np.random.default_rng(12)
    robot, readings, prediction = bench(random, stop_and_go(random), turn=(0, 0, 0))
    x, y, z = readings.position.T
    readings = replace(readings, position=np.column_stack([-y, x, z]))
    result = compare(robot, readings, prediction)
    assert result.turn.turn_deg == pytest.approx(90, abs=0.5)
    np.testing.assert_allclose(result.turn.axis, (0, 0, 1), atol=0.01)
    assert result.position_mm.rms > 10
    assert np.linalg.norm(result.sample.error, axis=1).mean() * 1e3 < 3 * JITTER_MM
    assert "Another tracker frame, rotated by 90 degrees" in findings(result)[0].text


@pytest.mark.parametrize("roll", ["known", "unknown"])
def test_orientation(roll):
    """Of a planted rotation, the roll counts only where the roll of the sensor is known."""
    random = np.random.default_rng(13)
    path = stop_and_go(random)
    robot, readings, prediction = bench(random, path, roll=roll)
    count = len(path[1])
    base = quaternion_from_rotation_vector(robot.tracker.rotation_vector_rad)
    seen = product(np.tile(base, (count, 1)), prediction.quaternion)
    turned = {"roll": (0, 0, 0.2), "bend": (0.1, 0, 0)}
    expected = {"roll": np.degrees(0.2) if roll == "known" else 0.0, "bend": np.degrees(0.1)}
    for name, vector in turned.items():
        spin = product(seen, np.tile(quaternion_from_rotation_vector(vector), (count, 1)))
        measured = spin * random.choice([-1.0, 1.0], (count, 1))  # q and -q are one rotation
        readings = replace(readings, quaternion=measured)
        result = compare(robot, readings, prediction)
        assert result.angle_deg.maximum == pytest.approx(expected[name], abs=1e-6)
    assert result.angle_kind == ("orientation" if roll == "known" else "tip direction")


def test_rows_left_out():
    """Rows that are not measured or not solved are listed; a table of nothing else is refused."""
    random = np.random.default_rng(14)
    robot, readings, prediction = bench(random, stop_and_go(random))
    readings.position[[3, 20]] = np.nan
    prediction.status[[5, 20]] = NOT_CONVERGED
    prediction.position[5] = np.nan
    result = compare(robot, readings, prediction)
    assert result.sample.not_measured.tolist() == [5, 22]
    assert result.sample.not_solved.tolist() == [7]
    assert result.position_mm.count == len(readings.row) - 3
    assert result.as_dict()["rows"] == {"compared": 177, "not_measured": [5, 22], "not_solved": [7]}
    said = terminal.left_out(result, 10)
    assert said == ["2 rows not measured: 5, 22", f"1 row not solved ({status_text(NOT_CONVERGED)}): 7"]
    for status, then in ((NOT_CONVERGED, "The model is wrong"), (OUT_OF_ORDER, "Where joints are out of order")):
        prediction.status[5] = status
        first = f"The model has no solution for 1 of 178 readings ({status_text(status)}: 1). {then}"
        assert headline(compare(robot, readings, prediction)).startswith(first)
    prediction.status[:] = OUT_OF_ORDER
    with pytest.raises(InputError, match="compared: 2 rows without .* its home, or its betas may be wrong"):
        compare(robot, readings, prediction)
    readings.position[:] = np.nan
    with pytest.raises(InputError, match="no row can be compared: 180 rows without a measured position.$"):
        compare(robot, readings, prediction)


def test_few_readings():
    """A handful of readings has an error but no finding."""
    random = np.random.default_rng(15)
    joints, run, t = stop_and_go(random, runs=1, stops=9)
    for count in (1, 2, 5):
        planted = bench(random, (joints[:count], run[:count], t[:count]), constant((1, 0, 0)))
        result = compare(*planted)
        assert result.position_mm.count == count
        assert not findings(result)
        [few] = [text for text in limits(result) if "too few to judge" in text]
        assert ("1 independent part," in few) == (count == 1)
        json.dumps(output.plain(result.as_dict()), allow_nan=False)


def test_spread():
    """mean <= RMS <= maximum, and the runs add up to the whole."""
    random = np.random.default_rng(16)
    result = compare(*bench(random, stop_and_go(random), constant((0.2, 0, 0))))
    for spread in (result.position_mm, result.percent_of_length, *(item.position_mm for item in result.runs)):
        assert 0 < spread.mean <= spread.rms <= spread.maximum
        assert spread.p95 <= spread.maximum
    assert sum(item.position_mm.count for item in result.runs) == result.position_mm.count
    square = sum(item.position_mm.count * item.position_mm.rms**2 for item in result.runs)
    assert square == pytest.approx(result.position_mm.count * result.position_mm.rms**2)
    assert result.percent_of_length.count == result.position_mm.count
