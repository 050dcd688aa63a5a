"""Tests on the simulated bench, of ROBOT_FILE without noise: test_ethercat.py runs them in `ctcr sim bench`."""

import os
import signal
import socket
import struct
import subprocess
import time

import numpy as np
import pytest
from ctcr.bench.devices import bus_lock, emergency_stop, homing
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.health import health_of
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import SimulatedPerson
from ctcr.bench.devices.release import release
from ctcr.bench.shared.control import request
from ctcr.bench.shared.folder import MASTER, private_folder
from ctcr.bench.simulators import ethercat
from ctcr.errors import InputError
from simulated_bench import ctcr, survives_messages

ROBOT = os.environ["ROBOT_FILE"]
BENCH = os.environ["BENCH_FILE"]
OP = 8  # state of a terminal


@pytest.fixture(scope="class")
def connected(robot, bench):
    with Motors(bench, robot, private_folder()) as motors:
        motors.connect()
        if not motors.state["homed"]:
            motors.set_joints(motors.settings.home)
        yield motors


@pytest.fixture
def motors(connected, folder):
    """Motors that stand at home."""
    go(connected, np.zeros(6))
    connected.wait()
    return connected


def go(motors, way, **options):
    motors.move(motors.settings.home + np.array(way), **options)


SMALL = [-2e-3, -1e-3, -1e-3, 0.2, -0.1, 0.1]


# ---- driver


def test_settings(bench, folder):
    """Motor current, feedback and encoder are written before a motor is enabled."""
    bus = Bus(MASTER, [1, 2], bench.motors)
    bus.connect()
    try:
        for drive in bus.drives:
            assert struct.unpack("<H", drive.slave.sdo_read(0x8010, 1))[0] == 1000
            assert drive.slave.sdo_read(0x8012, 8) == b"\0"  # feedback from the encoder
            assert struct.unpack("<H", drive.slave.sdo_read(0x8010, 7))[0] == 4096
        assert bus.exchange() is not None and bus.check_states() is None
    finally:
        bus.close()


@pytest.mark.slow
def test_interrupted_move(robot, bench, folder):
    """Ctrl+C brings the joints to rest on their way."""
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        if not motors.state["homed"]:
            motors.set_joints(motors.settings.home)
    start = np.array(request(folder, "ethercat", {})["turns"])
    command = ctcr("move", ROBOT, "--bench", BENCH, "--alpha-deg", "300,300,300", "--speed", 0.2)
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 20
    while np.abs(request(folder, "ethercat", {})["turns"] - start).max() < 0.02 and time.monotonic() < end:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 130 and "stopped" in process.stderr.read()
    moved = np.abs(np.array(request(folder, "ethercat", {})["turns"]) - start)
    assert 0.02 <= moved.max() < 0.5
    assert request(folder, "ethercat", {})["states"][1] < OP


def test_bus_lock(robot, bench, folder, monkeypatch):
    """A second program is refused; the first one goes on."""
    monkeypatch.setattr(bus_lock, "LOCK_S", 0.2)
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        tracker, *_, bus = health_of(bench, folder)
        assert tracker.is_well and not bus.is_well and "another program drives it" in bus.about
        assert motors.state["cycles"] > 0 and not motors.state["stopped"]


def test_wrong_messages(folder):
    """As those to the tracker."""
    survives_messages(folder, "ethercat")
    motors = len(request(folder, "ethercat", {})["turns"])
    for message in ({"faults": {"stall": motors + 1}}, {"faults": {"lost_after": motors + 2}}, {"force": [0, -0.1, 0]}):
        with pytest.raises(InputError):
            request(folder, "ethercat", message)


def test_wrong_terminal(bench, folder):
    """Wrong positions and interfaces are named."""
    for positions, text in (([0, 1], "no stepper terminal"), ([1, 9], "none at position 9")):
        bus = Bus(MASTER, positions, bench.motors)
        with pytest.raises(DeviceFault, match=text):
            bus.connect()
        bus.close()
    with pytest.raises(DeviceFault, match="cannot be opened"):
        Bus("nothing0", [1], bench.motors).connect()


class TestMotors:
    """One connection for all: two masters cannot share the bus."""

    def test_move(self, motors, robot, folder):
        """Joints, shafts and tips arrive together, within the resolution of the encoders."""
        n = robot.n_tubes
        target = motors.settings.home + SMALL
        motors.move(target)
        motors.wait()
        assert np.abs(motors.joints - target)[:n].max() < 1.1e-5
        assert np.abs(motors.joints - target)[n:].max() < 2e-3
        shafts = np.array(request(folder, "ethercat", {})["turns"])
        expected = (target - motors.settings.home) / motors.settings.ratios
        np.testing.assert_allclose(shafts, expected, atol=6e-3)
        deployed = request(folder, "aurora", {})["deployed"]
        np.testing.assert_allclose(deployed, target[:n] + [t.length for t in robot.tubes], atol=1.2e-5)

    def test_forbidden_moves(self, motors):
        """Nothing moves where a limit forbids the target."""
        start = motors.joints.copy()
        for way, text in (
            ([0, 0, -40e-3, 0, 0, 0], "may be"),
            ([-10e-3, 0, 0, 0, 0, 0], "its tip must stand out"),
            ([0, 0, 0, 9, 0, 0], "alpha1"),
            ([np.nan, 0, 0, 0, 0, 0], "not a number"),
        ):
            with pytest.raises(DeviceFault, match=text):
                go(motors, way)
        assert not motors.state["moving"]
        np.testing.assert_allclose(motors.joints, start, atol=1e-4)

    def test_velocity(self, motors, bench):
        """It ends when its time is over, and before a limit."""
        start = motors.joints.copy()
        motors.velocity([2e-3, 2e-3, 2e-3, 0.1, 0, 0], 0.3)
        motors.wait()
        moved = motors.joints - start
        assert moved[:3] == pytest.approx(0.3 * 2e-3, rel=0.5) and not motors.state["limited"]
        motors.velocity([-10e-3, 0, 0, 0, 0, 0], 9.0)  # until its tip would be inside the next tube
        motors.wait()
        lengths = [463e-3, 330.5e-3]
        gap = motors.joints[0] + lengths[0] - motors.joints[1] - lengths[1]
        assert motors.state["limited"] and -1e-4 < gap < 5e-4

    def test_lost_frames(self, motors, folder):
        """5 % lost and 5 % late frames stop nothing."""
        request(folder, "ethercat", {"faults": {"lost_frames": 0.05, "late_frames": 0.05}})
        go(motors, SMALL)
        motors.wait()
        assert motors.state["bad_cycles"] > 0 and not motors.state["stopped"]

    def test_silent_client(self, motors, folder):
        """A client of a simulator that sends nothing does not hold up the bus."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
            client.connect(str(folder / "ethercat.sock"))
            go(motors, SMALL)
            motors.wait()
            assert request(folder, "ethercat", {})["states"][1] == OP
        motors.check()

    def test_missed_steps(self, motors, folder):
        """The position loop, closed on the encoders, corrects them."""
        request(folder, "ethercat", {"faults": {"missed_steps": 1}})
        go(motors, SMALL)
        motors.wait()
        time.sleep(0.1)
        assert abs(motors.joints[0] - motors.settings.home[0] - SMALL[0]) < 1.1e-5

    def test_stop_latches(self, motors, folder):
        """A stop by another program holds for this one."""
        emergency_stop.stop(folder, "a test")
        with pytest.raises(DeviceFault, match="a test: .*ctcr stop --release"):
            motors.move(motors.settings.home)


def test_homing(robot, bench, folder):
    """After a power cycle flush retraction finds the joints again; a new connection keeps them."""
    request(folder, "ethercat", {"faults": {"power_loss": True}})
    request(folder, "ethercat", {"faults": {"power_loss": False}})
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        assert not motors.state["homed"]
        with pytest.raises(DeviceFault, match="home first"):
            go(motors, SMALL)
        with pytest.raises(DeviceFault, match="at most"):
            motors.jog([0.1, 0, 0, 0, 0, 0])
        said = []
        homing.home(motors, robot, SimulatedPerson(folder), said.append)
        assert len(said) == 3 and motors.state["homed"]
        deployed = np.array(request(folder, "aurora", {})["deployed"])
        lengths = np.array([tube.length for tube in robot.tubes])
        np.testing.assert_allclose(motors.joints[:3] + lengths, deployed, atol=1e-4)
        go(motors, np.zeros(6))
        motors.wait()
    with Motors(bench, robot, folder) as again:  # the terminals have kept their counters
        again.connect()
        assert again.state["homed"]


FAULTS = {  # fault: its value, what the message says
    "stall": (2, "translation of tube 2: it does not follow"),
    "unplugged": (True, "no terminal answers"),
    "emergency stop": (None, "somebody stopped it"),
}
MORE_FAULTS = {
    "encoder_jump": (4, "rotation of tube 1: (its encoder jumped|it does not follow)"),
    "over_current": (3, r"terminal 3 \(EL7041\): short circuit or over-current in coil A \(A010:06\)"),
    "under_voltage": (5, "motor supply too low"),
    "lost_after": (4, r"terminal 4 \(EL7041\): does not answer"),
    "power_loss": (True, "no terminal answers"),
}


def check_fault(robot, bench, folder, fault, value, says):
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        if not motors.state["homed"]:
            motors.set_joints(motors.settings.home)
        go(motors, np.zeros(6))
        motors.wait()
        go(motors, [-5e-3, -5e-3, -5e-3, 0.9, 0.9, 0.9], speed=0.3)
        time.sleep(0.3)
        if fault == "emergency stop":
            emergency_stop.stop(folder, "somebody stopped it")
        else:
            request(folder, "ethercat", {"faults": {fault: value}})
        with pytest.raises(DeviceFault, match=says):
            motors.wait()
        with pytest.raises(DeviceFault, match="ctcr stop --release"):
            motors.move(motors.settings.home)
    time.sleep(0.15)  # terminals that were cut off stop by their own watchdog
    at_rest = request(folder, "ethercat", {"faults": dict(ethercat.FAULTS)})["turns"]
    time.sleep(0.1)
    np.testing.assert_allclose(request(folder, "ethercat", {})["turns"], at_rest, atol=1e-9)


@pytest.mark.parametrize("fault", FAULTS)
def test_fault(robot, bench, folder, fault):
    """The motors stop, the message names the cause, and nothing moves before the release."""
    check_fault(robot, bench, folder, fault, *FAULTS[fault])


def break_terminal(robot, bench, folder, **fault):
    """A terminal reports an error while the joints rest."""
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        request(folder, "ethercat", {"faults": fault})
        end = time.monotonic() + 5
        while not motors.state["stopped"] and time.monotonic() < end:
            time.sleep(0.01)
        with pytest.raises(DeviceFault, match="A010"):
            motors.check()


def test_release(robot, bench, folder):
    """It resets a terminal once the cause is mended, and says when only switching off and on helps; else it holds."""
    break_terminal(robot, bench, folder, over_current=3)
    with pytest.raises(DeviceFault, match=r"terminal 3 .*coil A \(A010:06\), also after a reset: switch off, check"):
        release(folder)
    assert emergency_stop.is_stopped(folder)
    request(folder, "ethercat", {"faults": {"over_current": None}})
    said = release(folder)
    assert said[0] == "terminal 3 (EL7041): reset" and "coil A" in said[1] and not emergency_stop.is_stopped(folder)
    with Motors(bench, robot, folder) as motors:
        motors.connect()
        motors.check()
    break_terminal(robot, bench, folder, internal_error=2)
    with pytest.raises(DeviceFault, match="also after a reset: switch the terminals off and on"):
        release(folder)
    for off in (True, False):
        request(folder, "ethercat", {"faults": {"power_loss": off}})
    assert len(release(folder)) == 1  # the terminals have forgotten their errors


@pytest.mark.slow
@pytest.mark.parametrize("fault", MORE_FAULTS)
def test_more_faults(robot, bench, folder, fault):
    """As test_fault."""
    check_fault(robot, bench, folder, fault, *MORE_FAULTS[fault])
    request(folder, "ethercat", {"faults": {"power_loss": True}})  # counters and settings of this fault are gone
    request(folder, "ethercat", {"faults": {"power_loss": False}})


@pytest.mark.slow
def test_bring_ups(bench, folder):
    """Forty in a row, under load."""
    for _ in range(40):
        bus = Bus(MASTER, [1, 2, 3, 4, 5, 6], bench.motors)
        bus.connect()
        bus.close()


def test_health(bench, folder):
    """Every device is listed; an unplugged one is named."""
    found = health_of(bench, folder)
    assert [device.name for device in found] == ["tracker", "tool 0A", "tool 0B", "tool 0C", "EK1100", *["EL7041"] * 6]
    assert all(device.is_well for device in found)
    request(folder, "aurora", {"faults": {"unplugged": True}})
    request(folder, "ethercat", {"faults": {"unplugged": True}})
    assert [device.is_well for device in health_of(bench, folder)] == [False, False]
