"""The drivers without hardware: limits, motions, stops, the bench file, records shared between processes."""

import multiprocessing
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import cli
from ctcr.bench.devices import bench_file, emergency_stop, motors, stepper_drive
from ctcr.bench.devices.axis_control import AxisControl
from ctcr.bench.devices.bus_lock import bus_lock
from ctcr.bench.devices.bus_process import HOME_COUNT, _Owner, last_bus
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.bench.devices.motion import StraightMove, VelocityMove
from ctcr.bench.devices.stepper_drive import StepperDrive
from ctcr.bench.shared import ethercat
from ctcr.bench.shared.folder import private_folder
from ctcr.bench.shared.real_time import BUS, TRACKER, Lateness, real_time
from ctcr.bench.shared.shared_record import SharedRecord
from ctcr.effects import catalogue
from ctcr.errors import InputError
from ctcr.model import simulation
from ctcr.model.moving import RECENT_S, MovingModel
from ctcr.robot import robot_file
from ctcr.table import measurements

ROOT = Path(__file__).parents[3]
DATA = ROOT / "examples" / "data"
BENCH = DATA / "bench" / "bench.yaml"
DT = 0.004


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(DATA / "demo" / "robot.yaml")


@pytest.fixture(scope="module")
def settings(robot):
    return bench_file.load(BENCH).axis_settings(robot)


HOME = np.array([-0.298, -0.2205, -0.145, 0, 0, 0])


# ---- limits


def test_limits(settings):
    """Each violated limit is named with its value."""
    limits: JointLimits = settings.limits
    assert limits.problem(HOME) is None
    for way, text in (
        ([0, 0, 0.09, 0, 0, 0], "beta3 = -55.00 mm: may be -200.00 to -100.00 mm"),
        ([0, 0, 0, 0, 8, 0], "alpha2 = 458.37 deg: may be"),
        ([0.04, -0.035, 0, 0, 0, 0], "carriages of tubes 1 and 2 come too near: 2.50 mm"),
        ([-0.06, 0, 0, 0, 0, 0], "tube 1 would end 5.00 mm inside tube 2"),
        ([np.inf, 0, 0, 0, 0, 0], "not a number"),
    ):
        assert text in limits.problem(HOME + way)
    wide = replace(limits, travel=np.tile([-1.0, 1.0], (3, 1)))
    assert "in front of the plate" in wide.problem([-0.2, -0.1, 0.01, 0, 0, 0])
    assert "the tip of tube 3 would be 1.00 mm behind" in wide.problem([-0.4, -0.3, -0.2, 0, 0, 0])


def test_limits_are_convex(settings):
    """A straight move between two allowed positions is allowed all the way."""
    rng, limits = np.random.default_rng(5), settings.limits
    scale = np.array([0.1, 0.08, 0.05, 3, 3, 3])
    places = [place for place in HOME + scale * rng.uniform(-1, 1, (4000, 6)) if not limits.problem(place)]
    assert len(places) > 100
    for a, b in zip(places[:100], places[100:], strict=False):
        assert all(limits.problem(a + s * (b - a)) is None for s in rng.uniform(0, 1, 5))


# ---- motions


@pytest.mark.parametrize("seed", range(20))
def test_straight_move(seed):
    """In one line, from rest to rest, no joint faster than allowed; its velocity is the derivative of its position."""
    rng = np.random.default_rng(seed)
    start, end = rng.standard_normal((2, 6)) * 10 ** rng.uniform(-3, 0)
    speeds, ramp = rng.uniform(0.1, 2, 6), rng.uniform(0.05, 0.5)
    move = StraightMove(start, end, speeds, ramp)
    places, rates = (
        np.array(rows) for rows in zip(*(move.advance(1e-3) for _ in range(int(1e3 * move.duration) + 2)), strict=True)
    )
    assert move.is_finished
    np.testing.assert_allclose(places[-1], end, atol=1e-12)
    share = (places - start) @ (end - start) / np.sum((end - start) ** 2)
    np.testing.assert_allclose(places, start + share[:, None] * (end - start), atol=1e-12)
    assert (np.diff(share) >= -1e-12).all() and (np.abs(rates) <= speeds + 1e-9).all()
    np.testing.assert_allclose(
        np.diff(places, axis=0)[:-2] / 1e-3, (rates[1:] + rates[:-1])[:-2] / 2, atol=0.02 * np.abs(rates).max()
    )
    assert (np.abs(np.diff(rates, axis=0)) <= 1.01 * speeds / ramp * 1e-3 + 1e-9).all()


@pytest.mark.parametrize("way", [5e-5, 5e-4, 0.5])
def test_ramp_under_a_millisecond(way):
    """It holds as it is: the joint goes forward to its end, in the time of a trapezoid or triangle."""
    move = StraightMove([0.0], [way], [1.0], 1e-4)
    assert move.duration == pytest.approx(way + 1e-4 if way > 1e-4 else 2e-4 * (way / 1e-4) ** 0.5)
    places = [0.0, *(move.advance(move.duration / 100)[0][0] for _ in range(101))]
    assert (np.diff(places) >= 0).all() and places[-1] == pytest.approx(way)


def test_move_of_no_length():
    """It stays where it is."""
    move = StraightMove(HOME, HOME, np.ones(6), 0.2)
    place, rate = move.advance(DT)
    assert np.array_equal(place, HOME) and not rate.any()


def test_braking_distance():
    """`rest` predicts where a velocity move ends."""
    move = VelocityMove(np.zeros(2), np.zeros(2), [0.5, -1.0], np.array([2.0, 1.0]), valid_s=1.0)
    while move._left > 0:
        move.advance(1e-4)
    rest = move.rest()
    while not move.is_finished:
        place, _ = move.advance(1e-4)
    np.testing.assert_allclose(place, rest, atol=1e-3)


# ---- control of the axes


class Motors:
    """Ideal motors: joints integrate the speeds they are given. `stuck` ones do not."""

    def __init__(self, control, stuck=()):
        self.control, self.joints, self.stuck = control, control.joints.copy(), list(stuck)

    def run(self, seconds):
        for _ in range(int(seconds / DT)):
            speeds = self.control.cycle(DT, self.joints.copy())
            speeds[self.stuck] = 0.0
            self.joints += DT * speeds
            if not self.control.is_moving:
                break


def test_axis_move(settings):
    """It arrives within the resolution of the encoders; a second one must wait."""
    control = AxisControl(settings, HOME, homed=True)
    motors, target = Motors(control), HOME + [-0.01, -0.01, -0.01, 1, 0, -1]
    control.move(target)
    with pytest.raises(DeviceFault, match="still moving"):
        motors.run(0.1)
        control.move(HOME)
    motors.run(9)
    assert not control.is_moving
    np.testing.assert_allclose(motors.joints, target, atol=1e-3)
    np.testing.assert_allclose(motors.joints[:3], target[:3], atol=1.1e-5)
    with pytest.raises(DeviceFault, match="nothing has moved"):
        control.move(HOME - 1)


@pytest.mark.parametrize("seed", range(4))
def test_velocities_keep_limits(settings, seed):
    """Random velocities never leave the limits, also where cycles of the bus come late."""
    rng = np.random.default_rng(seed)
    control, limited = AxisControl(settings, HOME, homed=True), 0
    for _ in range(60):
        control.velocity(rng.uniform(-3, 3, 6) * settings.speeds, 5.0)
        for dt in DT * rng.choice([1, 10], rng.integers(10, 400), p=[0.9, 0.1]):
            control.cycle(dt, control.setpoint.copy())  # ideal motors
            assert control.fault is None and settings.limits.problem(control.setpoint) is None
        limited += control.limited
    assert limited


def test_stuck_axis(settings):
    """The following error stops all joints for good."""
    control = AxisControl(settings, HOME, homed=True)
    motors = Motors(control, stuck=[4])
    control.move(HOME + [-0.01, -0.01, -0.01, 1, 1, 1])
    motors.run(9)
    assert "rotation of tube 2: it does not follow" in str(control.fault)
    at_rest = motors.joints.copy()
    motors.run(1)
    np.testing.assert_array_equal(motors.joints, at_rest)
    for request in (
        lambda: control.move(HOME),
        lambda: control.velocity(np.zeros(6), 1),
        lambda: control.jog(np.zeros(6)),
    ):
        with pytest.raises(DeviceFault, match="does not follow"):
            request()


def test_encoder_jump(settings):
    """It is a fault of its own."""
    control = AxisControl(settings, HOME, homed=True)
    control.cycle(DT, HOME)
    control.cycle(DT, HOME + [0.8e-3, 0, 0, 0, 0, 0])
    assert "translation of tube 1: its encoder jumped" in str(control.fault)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_no_numbers(settings, wrong):
    """A request that is not finite is refused and changes nothing; a stop ends also a motion that has no numbers."""
    control = AxisControl(settings, HOME, homed=True)
    for request in (
        lambda: control.move(HOME, speed=wrong),
        lambda: control.jog(np.full(6, wrong)),
        lambda: control.velocity(np.full(6, wrong), 1.0),
        lambda: control.velocity(np.zeros(6), wrong),
    ):
        with pytest.raises(DeviceFault, match="not a number"):
            request()
        assert not control.is_moving
    control._go_at(np.full(6, wrong), 1.0, wrong)
    control.stop(DeviceFault("a test", "stop", "none"))
    Motors(control).run(2)
    assert not control.is_moving
    control = AxisControl(settings, HOME, homed=True)
    control._go_at(np.full(6, np.nan), 1.0, 9.0)
    assert not control.cycle(DT, HOME).any() and "not numbers" in str(control.fault) and not control.is_moving


@pytest.mark.parametrize("encoder_counts", [400, 4096, 40000, 0xFFFF])
def test_homing_is_kept(robot, tmp_path, encoder_counts):
    """Counters show a robot as homed wherever its joints may be, and after power on as not homed, wherever they are."""
    bench = bench_file.load(BENCH)
    bench.motors.encoder_counts = encoder_counts
    settings = motors.Motors(bench, robot, tmp_path).settings
    for homed in (True, False):
        for way in np.repeat([0.5, 4 * np.pi], 3) * np.array([[1], [-1], [0]]):  # [m], [rad]
            counts = np.round(way / settings.ratios * encoder_counts) + homed * HOME_COUNT
            bus = SimpleNamespace(inputs=lambda counts=counts: [SimpleNamespace(counter=int(one)) for one in counts])
            control = _Owner(settings, tmp_path, None, bus, False)._control
            assert control.homed == homed
            np.testing.assert_allclose(control.joints, settings.home + way, atol=0.02)


def test_drive_at_rest():
    """A speed that is not a number is commanded as 0, not as the full speed."""
    entries = [(0x7010 << 16) + (1 << 8) + 8, (0x7010 << 16) + (2 << 8) + 8, (0x7010 << 16) + (0x21 << 8) + 16]
    drive = StepperDrive(SimpleNamespace(name="EL7041"), 1, None, ())
    drive.full_speed, drive._images = 10.0, {stepper_drive._RX: ethercat.ProcessImage(entries)}
    for speed, expected in ((np.nan, 0), (-np.inf, 0), (5.0, 16384), (99.0, 32767)):
        drive.command(True, speed)
        assert ethercat.ProcessImage(entries).unpack(drive.slave.output)[(0x7010, 0x21)] == expected


OUTSIDE = {  # where: joints, what the message says of joints farther out, their way
    "tips": (HOME - [0.06, 0, 0, 0, 0, 0], "6.00 mm inside tube 2", [-1e-3, 0, 0, 0, 0, 0]),
    "one alone": ([-0.463, -0.2805, -0.2, 0, 0, 0], "tube 1 would end 51.00 mm inside", [0, 1e-3, 0, 0, 0, 0]),
    "travel": (HOME + [0.1, 0.1, 0.05, 0, 0, 0], "beta1 = -197.00 mm: may be", [1e-3, 0, 0, 0, 0, 0]),
    "rotation": (HOME + [0, 0, 0, 0, 8, 0], "alpha2", [0, 0, 0, 0, 0.1, 0]),
}


@pytest.mark.parametrize("where", OUTSIDE)
def test_start_outside_limits(settings, where):
    """Joints come back from there, in steps or at once, and do not go farther out; homing is possible too."""
    start, says, farther = OUTSIDE[where]
    start = np.array(start)
    control = AxisControl(settings, start, homed=True)
    with pytest.raises(DeviceFault, match=says):
        control.move(start + farther)
    motors = Motors(control)
    for target in ((start + HOME) / 2, HOME):
        control.move(target)
        motors.run(99)
        assert control.fault is None
        np.testing.assert_allclose(motors.joints, target, atol=1e-3)
    with pytest.raises(DeviceFault, match="nothing has moved"):
        control.move(start)
    control = AxisControl(settings, start, homed=True)
    control.cycle(DT, start)
    assert control.fault is None
    control.jog(np.array(farther))
    Motors(control).run(9)
    control.set_joints(start)
    control.cycle(DT, start)
    assert control.fault is None and control.homed


def test_driven_outside_limits(settings):
    """A limit that is violated at the start, and then more, stops all joints."""
    start = HOME - [0.06, 0, 0, 0, 0, 0]
    control = AxisControl(settings, start, homed=True)
    for far in np.linspace(0, 0.9e-3, 50):
        control.cycle(DT, start - [far, 0, 0, 0, 0, 0])
    assert "inside tube 2: its tip must stand out: move back" in str(control.fault)


# ---- bench file


def test_bench_file_faults(tmp_path):
    """All faults come in one error, with their lines."""
    path = tmp_path / "bench.yaml"
    text = BENCH.read_text().replace("port:", "prot:").replace("current_mA: 1000", "current_mA: none")
    path.write_text(text.replace("clearance_mm: 5", "clearance_mm: -5"))
    with pytest.raises(InputError) as caught:
        bench_file.load(path)
    said = str(caught.value)
    assert "did you mean port?" in said and "motors.current_mA" in said and "limits.clearance_mm" in said
    assert "line 3" in said


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("rotation_terminals: [4,", "rotation_terminals: [3,", "rotation_terminals: 3 stands there twice: needs"),
        ("[1, 2, 3]", "[1, -2, 3]", "translation_terminals.1.: -2 does not fit: needs positions on the bus"),
        ("[4, 5, 6]", "[4, 5, 0]", "rotation_terminals.2.: .*the coupler is 0"),
        ("1000", "500000", "motors.current_mA: 500000 is impossible: needs a number in mA, > 0 and <= 5000"),
        ("1000", "1000\n  encoder_counts: 70000", "motors.encoder_counts: 70000 is impossible: .* <= 65535"),
        ("1000", "1000\n  full_steps: 400000", "motors.full_steps: 400000 is impossible: .* <= 65535"),
        ("1000", "1000\n  period_ms: 1000", "motors.period_ms: 1000 is impossible: .* in ms, > 0 and <= 50"),
        ("[-335, -180]", "[-180, -335]", "translation_mm.1.: the highest is below the lowest: needs a pair .* mm"),
    ],
)
def test_impossible_bench(tmp_path, old, new, says):
    """What a terminal cannot take, or limits that exclude all joints, are named with field, unit and range."""
    path, text = tmp_path / "bench.yaml", BENCH.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=says):
        bench_file.load(path)


def test_bench_of_other_robot(robot):
    """The number of tubes must agree."""
    two = robot.model_copy(update={"tubes": robot.tubes[:2]})
    with pytest.raises(InputError, match="has 3 entries, the robot has 2 tubes"):
        bench_file.load(BENCH).axis_settings(two)


# ---- stop


def test_stop_and_release(tmp_path, capfd):
    """The first reason stays until the release."""
    folder = private_folder(tmp_path / "bench")
    with bus_lock(folder):
        assert cli.run(["stop", "--folder", str(folder)]) == 0
    emergency_stop.stop(folder, "a later reason")
    assert emergency_stop.is_stopped(folder) and "ctcr stop was called" in str(emergency_stop.stop_fault(folder))
    assert cli.run(["stop", "--release", "--folder", str(folder)]) == 0
    assert not emergency_stop.is_stopped(folder) and emergency_stop.reason(folder) is None
    cli.run(["stop", "--release", "--folder", str(folder)])
    assert "nothing was stopped" in capfd.readouterr().out


def test_stop_elsewhere(tmp_path, capfd):
    """Where nothing moves from the folder of the stop, the stop latches, fails, and names the folder of what moves."""
    here, there = private_folder(tmp_path / "here"), private_folder(tmp_path / "there")
    with bus_lock(there):
        assert cli.run(["stop", "--folder", str(here)]) == 1
    said = capfd.readouterr().err
    assert "no program drives a bus from this folder" in said and f"ctcr stop --folder {there}" in said
    assert emergency_stop.is_stopped(here) and not emergency_stop.is_stopped(there)


def test_stop_on_full_disk(tmp_path, monkeypatch):
    """A stop needs no temporary folder, and holds without its reason where only the name of a file can be written."""
    monkeypatch.setattr(tempfile, "gettempdir", lambda: pytest.fail("no temporary folder"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    folder = private_folder()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    emergency_stop.stop(folder, "a test")
    assert "reason was not written" in str(emergency_stop.stop_fault(folder))
    emergency_stop.release(folder)
    monkeypatch.setattr(Path, "touch", full)
    with pytest.raises(InputError, match="cut the motors' power"):
        emergency_stop.stop(folder, "a test")


def test_latch_is_folder(tmp_path):
    """It stops, and the release names it."""
    (tmp_path / "stop").mkdir()
    emergency_stop.stop(tmp_path, "a test")
    assert emergency_stop.is_stopped(tmp_path) and emergency_stop.reason(tmp_path)
    with pytest.raises(InputError, match="stop: cannot remove it: is a directory"):
        emergency_stop.release(tmp_path)


@pytest.mark.parametrize("text", ["[]", "{", "{}", "3"])
def test_damaged_memory(tmp_path, text):
    """A bus that is not remembered whole counts as none."""
    (tmp_path / "bus.json").write_text(text)
    assert last_bus(tmp_path) is None


def test_codes():
    """Every code has a meaning and a remedy."""
    assert ethercat.state_name(0x14) == "SAFEOP with an error" and ethercat.state_name(0) == "state 0x0"
    assert "watchdog" in ethercat.STATUS_CODES[0x1B][0] and "manual" in ethercat.UNKNOWN_CODE[1]
    assert all(map(all, (*ethercat.STATUS_CODES.values(), *ethercat.DIAGNOSES.values())))


# ---- between processes


def _write_for_a_while(path, seconds):
    record = SharedRecord(path, np.dtype([("number", "i8"), ("copies", "i8", 200)]), writer=True)
    end, number = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        number += 1
        record.write(number=number, copies=number)


def test_shared_record(tmp_path):
    """A reader never sees a write half done."""
    context = multiprocessing.get_context("fork")
    path = tmp_path / "record"
    fields = np.dtype([("number", "i8"), ("copies", "i8", 200)])
    assert SharedRecord(path, fields).read() is None
    writer = context.Process(target=_write_for_a_while, args=(path, 0.5))
    writer.start()
    record, seen = SharedRecord(path, fields), set()
    while writer.is_alive():
        if (values := record.read()) is not None:
            assert (values["copies"] == values["number"]).all()
            seen.add(int(values["number"]))
    writer.join()
    assert len(seen) > 2 and (os.stat(path).st_mode & 0o777) == 0o600


def test_lateness():
    """Quantiles of known delays."""
    late = Lateness()
    for value in np.linspace(0, 1e-3, 1001):
        late.add(value)
    late.add(0.5)
    assert late.quantile(0.5) == pytest.approx(0.5e-3, abs=3e-5)
    assert late.quantile(0.99) == pytest.approx(0.99e-3, abs=3e-5) and late.worst == 0.5
    assert late.as_dict()["count"] == 1002


def scheduling():
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, os.sched_getaffinity(0)


def test_real_time():
    """Priority and core hold inside the block alone."""
    before = scheduling()
    for duty, core in ((BUS, min(before[2])), (TRACKER, max(before[2]))):
        with real_time(duty) as granted:
            assert scheduling() == ((os.SCHED_FIFO, duty.priority, {core}) if granted else before)
        assert scheduling() == before
    with pytest.raises(KeyboardInterrupt), real_time(BUS):
        raise KeyboardInterrupt
    assert scheduling() == before


def test_without_permission(monkeypatch):
    """Scheduling stays as it was."""

    def refused(*_):
        raise PermissionError

    before = scheduling()
    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with real_time(BUS) as granted:
        assert not granted and scheduling() == before


# ---- the model that moves


@pytest.mark.parametrize(
    ("effect", "strength", "shares", "off"),
    [
        ("friction", "coefficient", (), 1e-5),
        ("friction", "coefficient", (0.25, 0.5, 0.75), 1e-5),
        ("backlash_rotation", "play", (0.25, 0.5, 0.75), 1e-6),
    ],
)
def test_moving_model(robot, effect, strength, shares, off):
    """Reading by reading it equals the simulation of the whole path, with effects that have a history."""
    effects = {f"effects.{effect}.{strength}.{i}": 0.02 for i in (1, 2, 3)}
    true = catalogue.with_values(robot, [effect], effects)
    plan = measurements.load(DATA / "plan.csv", 3)
    rows = np.arange(40)
    names = ("t", "run", "beta", "alpha", "force", "row")
    few = replace(plan, **{name: getattr(plan, name)[rows] for name in names}, position=None, quaternion=None)
    few = replace(few, run=np.zeros(len(rows), np.int64), from_home=False)
    expected = simulation.simulate(true, few, "none", steps=2)
    moving = MovingModel(true)
    for i in rows:
        if i:
            for share in shares:
                between = [
                    few.__dict__[n][i - 1] + share * (few.__dict__[n][i] - few.__dict__[n][i - 1])
                    for n in ("t", "beta", "alpha")
                ]
                moving.move(*between, few.force[i])
        moving.move(few.t[i], few.beta[i], few.alpha[i], few.force[i])
        position, quaternion = moving.reading()
        np.testing.assert_allclose(position, expected.position[i], atol=off)
    assert len(moving._turns) < 4 * len(rows) and RECENT_S < 1
