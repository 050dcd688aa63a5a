"""Control and calibration with devices; tests that need a running bench are in on_bench_live.py."""

import io
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.bench.devices import bench_file
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person
from ctcr.bench.record.row_file import RowFile
from ctcr.calibrate import tables
from ctcr.calibrate.live import (
    POINT_COLUMNS,
    ROTATION_COLUMNS,
    Circles,
    Desk,
    _Turner,
    point_table,
    rotation_table,
    still_reading,
)
from ctcr.calibrate.procedures import CAD_POINTS, ROTATION_OFFSETS, tracker_noise
from ctcr.calibrate.tables import Column
from ctcr.effects.one_tube import one_tube
from ctcr.errors import InputError
from ctcr.frames import base_to_tracker
from ctcr.robot import robot_file
from ctcr.table import measurements
from ctcr.track import scenario as scenario_file
from ctcr.track.live import within
from ctcr.track.recording import COLUMNS, runs_of
from ctcr.track.runs import run_once, system_values
from ruamel.yaml import YAML
from simulated_bench import HOMES, ROBOT, ROOT, T_REF, run_on_bench

ON_BENCH = Path(__file__).parent / "on_bench_live.py"
DATA = ROOT / "examples" / "data"


@pytest.fixture
def robot():
    return robot_file.load(ROBOT)


@pytest.fixture
def bench():
    return bench_file.load(DATA / "bench" / "bench.yaml")


@pytest.fixture
def scenario():
    return scenario_file.load(DATA / "bench" / "track.yaml", 3)


class Ideal:
    """A device in Python that moves at once and reads what the model says."""

    def __init__(self, robot, start):
        from ctcr import Model
        from ctcr.frames import base_to_tracker, matrix_from_quaternion

        self.robot, self.joints, self.rows = robot, np.array(start), []
        self._model, self._to_tracker, self._matrix = Model(robot), base_to_tracker, matrix_from_quaternion

    def measure(self):
        n = self.robot.n_tubes
        tip = self._model.predict(self.joints[None, :n], self.joints[None, n:], np.zeros((1, 3)))
        position, quaternion = self._to_tracker(self.robot.tracker, tip.position, tip.quaternion)
        known = self.robot.actuation
        ratios = np.repeat([known.translation_mm_per_rev / 2e3 / np.pi, known.rotation_rev_per_rev], n)
        self._ratios = ratios
        homes = np.concatenate([1e-3 * np.array(known.home_translation_mm), np.deg2rad(known.home_rotation_deg)])
        return (self.joints - homes) / ratios, position[0], self._matrix(quaternion[0])

    def record(self, so_far, row):
        self.rows.append(so_far.tip[row].copy())

    def move(self, velocity, period):
        self.joints += self._ratios * velocity * period


def test_python_device(robot, scenario):
    """A device in Python is controlled as the simulated robot is."""
    scenario.noise_mm, values = 0.0, system_values(robot)
    start = [*(1e-3 * np.array(scenario.start.beta_mm)), *np.deg2rad(scenario.start.alpha_deg)]
    device = Ideal(robot, start)
    here, there = run_once(scenario, values, device, 0.0), run_once(scenario, values, values, 0.0)
    np.testing.assert_allclose(here.tip, there.tip, atol=1e-7)  # the integrators differ
    np.testing.assert_allclose(here.joints, there.joints, atol=1e-5)
    np.testing.assert_array_equal(device.rows, here.tip)


@pytest.mark.parametrize("where", ["measure", "record", "move"])
def test_device_raises(robot, scenario, where):
    """The exception of a device ends the run and reaches the caller."""
    start = [*(1e-3 * np.array(scenario.start.beta_mm)), *np.deg2rad(scenario.start.alpha_deg)]
    device = Ideal(robot, start)

    def fails(*_):
        raise InputError([])

    setattr(device, where, fails)
    with pytest.raises(InputError):
        run_once(scenario, system_values(robot), device, 0.0)
    assert len(device.rows) == 0


def test_reading_age(robot, scenario, tmp_path):
    """Runs at constant speed, exactly on their paths but read late, have no error once the age is known."""
    age, period, speed, count = 0.036, 0.025, 0.02, 20
    t = period * np.arange(count)
    along = np.array([0.6, 0.0, 0.8])
    folder = SimpleNamespace(path=tmp_path, about={"runs": []})
    rows, control = (
        RowFile(tmp_path / "measurements.csv", measurements.column_names(3)),
        RowFile(tmp_path / "control.csv", COLUMNS),
    )
    with closing(rows), closing(control):
        for run in (1, 2):
            entry = {"run": run, "mass_g": 0, "repetition": run, "ended": "finished", "status": "ok"}
            folder.about["runs"].append(entry | {"settled_m": 0.0})
            for now in t:
                wanted, seen = ([*(run * 0.01 + speed * when * along)] for when in (now, now - age))
                seen, quaternion = base_to_tracker(robot.tracker, np.array([seen]), np.array([[1.0, 0, 0, 0]]))
                clock = 100.0 * run + now
                joints = [-0.4, -0.3, -0.2, 0, 0, 0]
                rows.append([[clock, run, *joints, 0, 0, 0, *map(float, [*seen[0], *quaternion[0]])]])
                control.append([[clock, run, now, *map(repr, map(float, wanted)), *[0.0] * (len(COLUMNS) - 6)]])
    for run in runs_of(folder, scenario, robot, age):
        assert run.error[:-2].max() < 1e-6
    for run in runs_of(folder, scenario, robot):
        np.testing.assert_allclose(run.error, speed * age, rtol=1e-3)


def test_within(robot, bench, scenario):
    """The tighter limit of bench and scenario holds, less the braking distance."""
    scenario.limits.beta_high_mm = [-250.0, -210.0, 0.0]
    scenario.limits.base_gap_mm = 56.5
    scenario.tasks.feedback_per_s = 30.0
    limits = within(scenario, bench, robot).limits
    braking = 10**2 / (2 * 10 / 0.2)  # mm
    assert limits.base_gap_mm == 56.5 and limits.tip_gap_mm == pytest.approx(2 * braking)
    assert limits.translation_mm_s == 10 and limits.rotation_deg_s == pytest.approx(60)
    np.testing.assert_allclose(limits.beta_high_mm, [-250, -210, -101])
    np.testing.assert_allclose(limits.beta_low_mm, [-464, -334, -199])
    assert within(scenario, bench, robot).tasks.feedback_per_s == 15
    scenario.rate_Hz = 100.0
    with pytest.raises(InputError, match="the tracker sets the pace, 40 Hz"):
        within(scenario, bench, robot)


# ---- calibration


def test_one_tube(robot):
    """A tube alone is that of a robot whose other tubes end at the plate; effects between tubes do not act."""
    from ctcr import Model

    for tube in range(3):
        alone = one_tube(robot, tube)
        beta = -np.array([one.length for one in alone.tubes]) + 0.05
        tip = Model(alone).predict(beta[None], np.array([[0.3]]), np.zeros((1, 3)))
        assert tip.solved.all()
        if tube == 0:
            lengths = np.array([one.length for one in robot.tubes])
            beta = -lengths + [0.05, 0.0, 0.0]
            whole = Model(robot).predict(beta[None], np.array([[0.3, 0, 0]]), np.zeros((1, 3)))
            np.testing.assert_allclose(whole.position, tip.position, atol=1e-6)
    hidden = robot.model_copy(
        update={"effects": {"backlash_rotation": {"play": [0.1, 0.2, 0.3]}, "delay": {"delay": 0.02}}}
    )
    alone = one_tube(hidden, 1)
    assert alone.effects == {"backlash_rotation": {"play": [0.2]}, "delay": {"delay": 0.02}}
    scalar = alone.model_copy(update={"effects": {"friction": {"coefficient": 0.02}}})  # as a file of one tube may say
    assert one_tube(scalar, 0).effects == {"friction": {"coefficient": [0.02]}}
    with pytest.raises(InputError, match="needs 3 number"):
        one_tube(robot.with_effects(scalar.effects), 0)


def test_one_by_one(robot, bench):
    """Only one tube may stand out of the plate, on all of its way."""
    limits = bench.axis_settings(robot).limits
    one_by_one = replace(limits, one_by_one=True)
    flush = np.concatenate([-limits.length, np.zeros(3)])
    for tube in range(3):
        place = flush + 0.05 * (np.arange(6) == tube)
        assert one_by_one.problem(place) is None and (limits.problem(place) is None) == (tube == 0)
        assert all(one_by_one.problem(flush + s * (place - flush)) is None for s in np.linspace(0, 1, 9))
    two = flush + [0, 0.05, 0.06, 0, 0, 0]
    assert "tube 1 would end 50.00 mm inside tube 2" in one_by_one.problem(two)


def test_straight_tube(robot, bench, tmp_path):
    """It is named and left out: a whole table of the other tubes needs no device."""
    robot.tubes[0].curvature_per_m = 0.0
    table, said = tmp_path / "circles.csv", []
    desk = Desk(bench, tmp_path, None, said.append)
    turner = _Turner(robot, Motors(bench, robot, tmp_path, one_by_one=True), None, None, Circles(np.pi, 8))
    jobs = [(tube, turner._motor_deg(tube, turner._alone(tube, a)), s) for tube in (1, 2) for a, s in turner.jobs]
    rows = "".join(f"{tube + 1},{motor},{sign},0,0,0,0.03,8\n" for tube, motor, sign in jobs)
    table.write_text(",".join(ROTATION_COLUMNS) + "\n" + rows)
    rotation_table(table, robot, desk, Circles(np.pi, 8))
    assert len(said) == 1 and "tube 1 is straight" in said[0]


def test_tube_not_retractable(robot, bench, tmp_path):
    """The error comes before any motion and names the tubes."""
    bench.limits.translation_mm[0] = [-450.0, -245.0]
    desk = Desk(bench, tmp_path, None, print)
    with pytest.raises(InputError) as caught:
        rotation_table(tmp_path / "circles.csv", robot, desk, Circles(0.3, 8))
    assert len(caught.value.problems) == 2  # tubes 2 and 3
    assert "tube 2 cannot stand out alone: beta1 = -463.00 mm: may be -450.00 to" in str(caught.value)


def test_tube_not_rotatable(robot, bench, tmp_path):
    """Limits that leave no angle to turn to are an error, before any motion."""
    bench.limits.rotation_deg[1] = [-5.0, 5.0]
    with pytest.raises(InputError, match="rotation_deg: .* common range of more than 20 deg"):
        rotation_table(tmp_path / "circles.csv", robot, Desk(bench, tmp_path, None, print), Circles(0.3, 8))


def test_other_points(bench, tmp_path):
    """A table of the probe is resumed with its own points alone; where all are touched no device is needed."""
    table, touched = tmp_path / "points.csv", "A,0,0,0,1,2,3,0.03,8\nB,60,-40,-20.1,1,2,3,0.03,8\n"
    table.write_text(",".join(POINT_COLUMNS) + "\n" + touched)
    for name, z, words in (("B", -20.1, None), ("B", 20.1, "row 3: holds rows of other points"), ("C", -20.1, "other")):
        (tmp_path / "cad.csv").write_text(f"point,cad_x_mm,cad_y_mm,cad_z_mm\nA,0,0,0\n{name},60,-40,{z}\n")
        points = tables.read(tmp_path / "cad.csv", CAD_POINTS)
        with pytest.raises(InputError, match=words) if words else nullcontext():
            point_table(table, points, Desk(bench, tmp_path, None, print), 8, 1)


def test_person(tmp_path, monkeypatch, capfd):
    """The person at the bench is asked for each action."""
    monkeypatch.setattr("sys.stdin", io.StringIO("\n\n\n"))
    person = Person(tmp_path)
    person.fasten(1)
    person.fasten(None)
    person.touch("B", np.array([0.06, -0.04, -0.02]))
    said = capfd.readouterr().err
    assert "Fasten the sensor to the tip of tube 2" in said and "Take the sensor off the tube" in said
    assert "Touch point B (CAD 60, -40, -20 mm) with the tip of the probe" in said


@pytest.mark.parametrize(
    ("last", "words"), [("1,90,1", "row 3: holds rows at other angles"), ("1,90,up", "row 3, direction: 'up' is not a")]
)
def test_other_angles(robot, bench, tmp_path, last, words):
    """A table with rows at other angles, or with a damaged last one, is not resumed."""
    table = tmp_path / "circles.csv"
    table.write_text(",".join(ROTATION_COLUMNS) + f"\n1,180,1,0,0,0,0.03,8\n{last},0,0,0,0.03,8\n")
    with pytest.raises(InputError, match=words):
        rotation_table(table, robot, Desk(bench, tmp_path, None, print), Circles(np.deg2rad(60), 8))


def test_names_with_commas(tmp_path):
    """Names with commas and quotes survive writing and reading."""
    path = tmp_path / "points.csv"
    with closing(RowFile(path, ["point", "x_mm"])) as file:
        file.append([["hole 3, left", 1.5]])
        file.append([['"B"', float("nan")]])
    read = tables.read(path, [Column("point", "text"), Column("x", "length", filled=False)])
    assert read["point"] == ["hole 3, left", '"B"'] and read["x"][0] == 1.5e-3
    with closing(RowFile(path, ["point", "x_mm"])) as again:
        assert again.groups == 2 and again.last == ['"B"', ""]


class Seen:
    """A tracker of a sensor that moves as a function of the frame's number."""

    patience_s = 0.1

    def __init__(self, place):
        self._place, self.count = place, 0

    def discard(self):
        pass

    def seen(self):
        self.count += 1
        return SimpleNamespace(reading=SimpleNamespace(position=tuple(self._place(self.count))))


def test_still_reading():
    """A reading is the mean of frames at rest; a sensor that keeps moving is a fault."""
    rng = np.random.default_rng(4)
    sight = Seen(lambda k: [1e-3 * max(0, 30 - k), 0.2, -0.1] + 3e-5 * rng.standard_normal(3))
    reading = still_reading(sight, 20, 0.5e-3)
    assert 45 < sight.count < 55  # the last frames of the motion lie within the limit
    np.testing.assert_allclose(reading.position, [0, 0.2, -0.1], atol=2e-4)
    resting = still_reading(Seen(lambda k: 3e-5 * rng.standard_normal(3)), 400, 0.5e-3)
    assert resting.scatter == pytest.approx(3e-5, rel=0.1) and np.abs(resting.position).max() < 6e-6
    with pytest.raises(DeviceFault, match="has not rested within 0.5 mm"):
        still_reading(Seen(lambda k: [2e-3 * (k % 2), 0, 0]), 4, 0.5e-3)


def test_scatter(robot, tmp_path):
    """The jitter of means follows from their scatter."""
    table = tmp_path / "circles.csv"
    table.write_text("motor_angle_deg,x_mm,y_mm,z_mm,scatter_mm,readings\n0,0,0,0,0.03,9\n5,0,0,0,0.05,25\n")
    noise = tracker_noise(robot, tables.read(table, ROTATION_OFFSETS))
    assert noise["jitter"] == pytest.approx(1e-5) and noise["field_error"] == tracker_noise(robot)["field_error"]


def on_bench(tmp_path, *options):
    """The tests of ON_BENCH around a robot whose homes and tracker frame are not those of the file that they use."""
    document, known, real = YAML().load(ROBOT), tmp_path / "known.yaml", tmp_path / "real.yaml"
    document["actuation"]["translation_mm_per_rev"] = 20.0  # tubes are in and out in a second
    YAML().dump(document, known)
    document["actuation"]["home_rotation_deg"] = HOMES
    document["tracker"]["position_mm"], document["tracker"]["rotation_vector_rad"] = T_REF
    YAML().dump(document, real)
    run_on_bench(tmp_path / "bench", [real], ["-s", ON_BENCH, *options], ROBOT_FILE=known)


@pytest.mark.alone
def test_on_the_simulated_bench(tmp_path):
    """The tests of this file that need a bus run on the simulated bench."""
    on_bench(tmp_path)


@pytest.mark.slow
def test_more_on_the_simulated_bench(tmp_path):
    """The long ones do, too."""
    on_bench(tmp_path, "-m", "slow")
