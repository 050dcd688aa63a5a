"""The tracker: protocol, driver, simulator, and two independent clients that take the simulator for an Aurora."""

import itertools
import signal
import struct
import subprocess
import sys
import time
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr import cli
from ctcr.bench.devices import health, tracker_process
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.shared import ndi
from ctcr.bench.shared.control import request
from ctcr.bench.shared.folder import private_folder
from ctcr.bench.shared.ndi import Garbled, parse_bx, parse_tx
from ctcr.bench.shared.shared_record import shared_motors
from ctcr.bench.shared.transmission import joints_of_turns, turns_of_joints
from ctcr.bench.simulators.aurora import FAULTS
from ctcr.bench.simulators.aurora_device import AuroraDevice, Sight
from ctcr.bench.simulators.simulator import checked, load_scenario
from ctcr.errors import InputError
from ctcr.frames import angle_between, base_to_tracker
from ctcr.model.model import Model
from ctcr.robot import robot_file
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from simulated_bench import ROBOT, ctcr, running, survives_messages

SENSOR = 0x0A


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a running simulator of the demo robot, without noise."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    folder = tmp_path_factory.mktemp("bench")
    with running(*ctcr("sim", "aurora", ROBOT, "--noise", "none", "--folder", folder)):
        yield folder


@pytest.fixture
def port(folder):
    """The port of a tracker without faults, just switched on."""
    request(folder, "aurora", {"faults": dict(FAULTS), "break": True})
    time.sleep(0.3)
    return str(folder / "aurora")


def tracker(port, **options):
    from ctcr.bench.devices.aurora import Aurora

    return Aurora(port, **options)


def set_faults(folder, **faults):
    return request(folder, "aurora", {"faults": faults})


# ---- protocol


def test_crc():
    """Against frames of the manual."""
    assert ndi.framed(b"INIT:") == b"INIT:E3A5\r"
    assert ndi.framed(b"OKAY") == b"OKAYA896\r"
    assert ndi.framed(b"RESET") == ndi.RESET_MESSAGE


def tracking_device(see) -> AuroraDevice:
    device = AuroraDevice(see)
    for command in (b"INIT ", b"PINIT 0A", b"PINIT 0B", b"PINIT 0C", b"PENA 0AD", b"PENA 0BD", b"TSTART 80"):
        assert device.answer(command) == ndi.framed(b"OKAY"), command
    return device


@pytest.mark.parametrize("seed", range(20))
def test_replies(seed):
    """Parsed replies hold the poses, states and bits that the device sent."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    position = rng.uniform(-0.5, 0.5, 3)
    sights = {0x0A: Sight((position, quaternion), bool(rng.integers(2))), 0x0B: Sight(None)}
    device = tracking_device(lambda handle: sights[handle])
    text, binary = device.answer(b"TX 0801"), device.answer(b"BX 0801")
    assert text[-5:] == b"%04X\r" % ndi.crc16(text[:-5])
    for readings, precision in ((parse_tx(text[:-5])[0], 6e-6), (parse_bx(binary[6:-2])[0], 1e-7)):
        seen, missing = readings[:2]
        assert seen.handle == SENSOR and missing.position is None and missing.handle == 0x0B
        assert seen.out_of_volume == sights[SENSOR].out_of_volume
        np.testing.assert_allclose(seen.position, position, atol=precision)
        np.testing.assert_allclose(seen.quaternion, quaternion, atol=6e-5)
    assert len(parse_tx(text[:-5])[0]) == 3  # 0C is told as disabled
    assert device.answer(b"TX 0001")[2:11] == (b"0AMISSING" if sights[SENSOR].out_of_volume else text[2:11])


def test_garbled_replies():
    """A reply cut anywhere is refused."""
    device = tracking_device(lambda handle: Sight((np.zeros(3), np.array([1.0, 0, 0, 0]))))
    text, body = device.answer(b"TX 0801")[:-5], device.answer(b"BX 0801")[6:-2]
    for cut in range(1, len(text) - 4, 7):
        with pytest.raises(Garbled):
            parse_tx(text[:cut])
    for cut in range(len(body) - 1):
        with pytest.raises(Garbled):
            parse_bx(body[:cut])


@pytest.mark.parametrize(
    ("before", "command", "code"),
    [
        ([], b"PHSR 00", 0x10),
        ([], b"NOPE ", 0x01),
        ([], b"INIT:0000", 0x04),
        ([], b"INIT:12", 0x03),
        ([], b"COMM 90000", 0x06),
        ([], b"COMM 5", 0x07),
        ([b"INIT "], b"TX 0001", 0x0C),
        ([b"INIT "], b"PINIT 77", 0x08),
        ([b"INIT "], b"PINIT 0B", 0x08),
        ([b"INIT "], b"PENA 0AD", 0x0E),
        ([b"INIT ", b"PINIT 0A"], b"PENA 0AX", 0x09),
        ([b"INIT ", b"TSTART 80"], b"PINIT 0A", 0x0C),
        ([b"INIT "], b"PHRQ 1", 0x2D),
    ],
)
def test_refusals(before, command, code):
    """The error code of each wrong command."""
    device = AuroraDevice(lambda handle: Sight(None))
    for earlier in before:
        device.answer(earlier)
    assert device.answer(command) == ndi.framed(b"ERROR%02X" % code)
    assert code in ndi.ERRORS


# ---- driver on the simulator


@pytest.mark.parametrize("replies", ["BX", "TX"])
def test_driver(port, folder, replies):
    """It reads the pose of the model at the joints of the motors."""
    robot = robot_file.load(ROBOT)
    joints = np.array([-0.31, -0.23, -0.15, 0.4, -1.2, 2.0])
    turns = np.zeros(8)
    turns[:6] = turns_of_joints(robot, joints)
    np.testing.assert_allclose(joints_of_turns(robot, turns[:6]), joints, atol=1e-15)
    shared_motors(folder, writer=True).write(t=time.monotonic(), turns=turns)
    expected = Model(robot, steps=2).predict(joints[None, :3], joints[None, 3:])
    position, quaternion = base_to_tracker(robot.tracker, expected.position[0], expected.quaternion[0])
    with tracker(port, replies=replies) as aurora:
        aurora.connect()
        assert [tool.handle for tool in aurora.tools] == [0x0A, 0x0B, 0x0C]
        assert "Freeze Tag" in aurora.version and aurora.tools[0].serial_number == "1B0E8C01"
        time.sleep(0.1)
        reading = aurora.read().readings[0]
    np.testing.assert_allclose(reading.position, position, atol=2e-5)
    assert angle_between(np.array(reading.quaternion), quaternion) < 1e-3
    (folder / "motors").unlink()


@pytest.mark.slow  # asks that nothing else keeps the machine busy
def test_frame_rate(port):
    """40 Hz, no frame is missed."""
    with tracker(port) as aurora:
        aurora.connect()
        frames, end = [], time.monotonic() + 1.0
        while time.monotonic() < end:
            frames.append(aurora.read().readings[0].frame)
    numbers = sorted(set(frames))
    assert 36 <= len(numbers) <= 42
    assert len(numbers) >= 0.9 * (numbers[-1] - numbers[0] + 1)


@pytest.mark.slow
def test_line_rate(port):
    """A reply of 200 bytes takes its time at 9600 baud."""
    with tracker(port, baud=9600, replies="TX") as aurora:
        aurora.connect()
        start = time.monotonic()
        aurora.read()
        assert time.monotonic() - start > 200 * 10 / 9600


def test_unseen_tools(port, folder):
    """Missing and out of volume are told apart."""
    with tracker(port) as aurora:
        aurora.connect()
        set_faults(folder, missing=1.0)
        time.sleep(0.06)
        assert aurora.read().readings[0].position is None
        set_faults(folder, missing=None, out_of_volume=True)
        time.sleep(0.06)
        reading = aurora.read().readings[0]
        assert reading.out_of_volume and reading.position is not None


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["garbage", "wrong_crc"])
@pytest.mark.parametrize("replies", ["BX", "TX"])
def test_damaged_replies(port, folder, fault, replies):
    """They are asked for again; a line that damages all is a fault."""
    with tracker(port, replies=replies, answer_s=0.1, tries=20) as aurora:
        aurora.connect()
        good = aurora.read().readings[0].position
        set_faults(folder, **{fault: 0.3})
        for _ in range(12):
            np.testing.assert_allclose(aurora.read().readings[0].position, good, atol=1e-5)
        assert aurora.damaged_answers > 0
        set_faults(folder, garbage=None, wrong_crc=1.0)
        with pytest.raises(DeviceFault, match="answers in a row came damaged: check the cable"):
            aurora.read()


@pytest.mark.parametrize(
    ("fault", "says"),
    [("unplugged", "the port is gone"), ("hang", "no answer within"), ("wrong_baud", "no answer within|came damaged")],
)
def test_reconnects(port, folder, fault, says):
    """After each fault `connect` works again."""
    with tracker(port, answer_s=0.3) as aurora:
        aurora.connect()
        set_faults(folder, **{fault: True})
        with pytest.raises(DeviceFault, match=says) as caught:
            aurora.read()
        assert caught.value.remedy
        set_faults(folder, **{fault: None})
        aurora.connect()
        assert aurora.read().readings[0].position is not None


def test_slow_host(port, monkeypatch):
    """A host that follows a change of the baud rate late has not sent a break."""
    from ctcr.bench.devices import aurora

    slow = SimpleNamespace(sleep=lambda seconds: time.sleep(10 * seconds), monotonic=time.monotonic)
    monkeypatch.setattr(aurora, "time", slow)
    with tracker(port) as one:
        one.connect()
        assert one.read().readings[0].position is not None


@pytest.mark.slow
def test_bad_line(port, folder):
    """Connects with 10 % of the replies damaged."""
    set_faults(folder, garbage=0.1)
    with tracker(port, answer_s=0.1, tries=20) as aurora:
        for _ in range(4):
            aurora.connect()
        assert aurora.damaged_answers > 0


@pytest.mark.parametrize("fault", ["garbage", "wrong_crc"])
def test_all_damaged(port, folder, fault):
    """Where each answer is damaged already at the first connection, that is the fault, and the cable its remedy."""
    set_faults(folder, **{fault: 1.0})
    with tracker(port) as aurora, pytest.raises(DeviceFault, match="came damaged .*: check the cable"):
        aurora.connect()


def test_exclusive_port(port):
    """A second program cannot open the port."""
    with tracker(port) as aurora:
        aurora.connect()
        with pytest.raises(DeviceFault, match="cannot open the port"):
            tracker(port).connect()
        aurora.read()


def test_no_device(tmp_path):
    """The message names the likely causes."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    with pytest.raises(DeviceFault, match="cannot open the port .*dialout"):
        tracker(str(tmp_path / "nothing")).connect()


def test_end(tmp_path):
    """SIGTERM is the end of a simulator, Ctrl+C an interruption as of any command."""
    for sign, code in ((signal.SIGTERM, 0), (signal.SIGINT, cli.STOPPED)):
        with running(*ctcr("sim", "aurora", ROBOT, "--folder", tmp_path / "wires")) as process:
            process.send_signal(sign)
            assert process.wait(20) == code and not list((tmp_path / "wires").glob("*.sock"))


# ---- driver on a line of the test's


class Line:
    """A serial port whose device answers at once, by answer(name, arguments) of a command: a text, or raw bytes."""

    baudrate, timeout, in_waiting = ndi.RESET_BAUD, 0, 0

    def __init__(self, answer):
        self.answer, self.reply, self.commands = answer, b"", 0

    def write(self, data: bytes) -> None:
        self.commands += 1
        assert self.commands < 10_000, "it never ends"
        name, _, arguments = data[:-5].decode().partition(":")
        reply = self.answer(name, arguments)
        self.reply = reply if isinstance(reply, bytes) else ndi.framed(reply.encode("latin-1"))

    def send_break(self, seconds: float) -> None:
        self.reply = ndi.RESET_MESSAGE

    def read_until(self, end: bytes) -> bytes:
        line, found, self.reply = self.reply.partition(end)
        return line + found

    def read(self, count: int) -> bytes:
        data, self.reply = self.reply[:count], self.reply[count:]
        return data

    def reset_input_buffer(self) -> None:
        self.reply = b""

    def close(self) -> None: ...


@pytest.fixture
def on_line(monkeypatch):
    """on_line(answer): a tracker whose device answers so, and its line."""
    from ctcr.bench.devices import aurora

    def make(answer):
        line = Line(answer)
        monkeypatch.setattr(aurora, "needed", lambda *_: SimpleNamespace(Serial=lambda *_, **options: line))
        monkeypatch.setattr(aurora, "time", SimpleNamespace(sleep=lambda seconds: None, monotonic=time.monotonic))
        return tracker("/dev/nothing"), line

    return make


def test_stuck_tool(on_line):
    """A tool that waits for ever, though its initialisation was confirmed, is a fault that names it and a remedy."""
    aurora, line = on_line(lambda name, arguments: "010A001" if (name, arguments) == ("PHSR", "02") else "00OKAY")
    with pytest.raises(DeviceFault, match="tool 0A waits again .*: unplug the tool"):
        aurora.connect()
    assert line.commands < 20


def whole(name, arguments):
    """What an Aurora with one tool answers while it is connected."""
    waiting = {"01": "00", "02": "00", "03": "010A001"}
    return waiting[arguments] if name == "PHSR" else "OKAY"


def pose_reply(*numbers, frame=7, status=0) -> bytes:
    """A whole BX reply of one tool: quaternion, position [mm], error."""
    return bx_reply(struct.pack("<BBB8fIIH", 1, SENSOR, ndi.BX_VALID, *numbers, 0x31, frame, status))


def bx_reply(body) -> bytes:
    head = struct.pack("<HH", ndi.BX_START, len(body))
    return head + struct.pack("<H", ndi.crc16(head)) + body + struct.pack("<H", ndi.crc16(body))


@pytest.mark.parametrize(
    ("command", "reply", "says"),
    [
        ("VER", "ERROR", "answers ERROR without a code: switch"),
        ("PHSR", b"FF" + b"0A001" * 1000, "answers in a row came damaged"),
        ("PHSR", "FF0A001", "answers belong to other commands"),
        ("VER", b"\r", "answers in a row came damaged"),
        ("VER", b"", "no answer within"),
        ("BX", b"", "no answer within"),
        ("BX", b"\xc4\xa5", "answers in a row came damaged"),
        ("BX", "ER", "answers in a row came damaged"),
        ("BX", "ERROR", "answers ERROR without a code"),
    ],
)
def test_wrong_replies(on_line, command, reply, says):
    """What a device answers wrongly is named: silence, damage, a refusal."""
    aurora, line = on_line(lambda name, arguments: reply if name == command else whole(name, arguments))
    with pytest.raises(DeviceFault, match=says):
        aurora.connect()
        aurora.read()
    assert line.commands < 100


BAD_FLOAT = -3.697314e28  # NDI's


@pytest.mark.parametrize(
    "numbers",
    [
        (float("nan"), 0, 0, 0, 1, 2, 3),
        (1, 0, 0, 0, 1, float("inf"), 3),
        (0, 0, 0, 0, 1, 2, 3),
        (1, 0, 0, 0, 1e30, 1e30, 1e30),
        (BAD_FLOAT,) * 7,
        (0.01, 0.002, 0, 0, 1, 2, 3),
        (5, 5, 5, 5, 1, 2, 3),
    ],
)
def test_no_pose(on_line, numbers):
    """Numbers that are no pose count as missing; others are kept."""
    for sent, is_seen in ((numbers, False), ((1, 0, 0, 0, 1, 2, 3), True)):
        aurora, _ = on_line(lambda *asked, sent=sent: pose_reply(*sent, 0) if asked[0] == "BX" else whole(*asked))
        aurora.connect()
        (reading,) = aurora.read().readings
        assert reading.is_seen is is_seen and (reading.quaternion is not None) is is_seen


POSE = (1, 0, 0, 0, 1, 2, 3, 0)


@pytest.mark.parametrize(
    ("version", "reply", "well", "says"),
    [
        ("AURORA Rev 007", pose_reply(*POSE), [True, True], ["AURORA Rev 007", "seen, serial"]),
        ("AURORA Rev 007", bx_reply(bytes(3)), [True, False], ["AURORA", "not tracked: disabled, or unplugged"]),
        ("AURORA Rev 007", pose_reply(*POSE, status=4), [False, True], ["failure of the hardware: switch", "seen"]),
        ("Polaris Rev 024", pose_reply(*POSE), [False, True], ["Polaris Rev 024; calls itself no Aurora", "seen"]),
    ],
)
def test_tracker_health(on_line, monkeypatch, version, reply, well, says):
    """Faults in the system status, tools that a reply leaves out, and other devices are not well."""
    aurora, _ = on_line(lambda *asked: {"BX": reply, "VER": version}.get(asked[0]) or whole(*asked))
    monkeypatch.setattr(health, "Aurora", lambda *_: aurora)
    bench = SimpleNamespace(tracker=SimpleNamespace(baud=9600, replies="BX"))
    found = list(health._tracker(bench, "port"))
    assert [one.is_well for one in found] == well
    assert all(text in one.about for text, one in zip(says, found, strict=True))


class Pipe:
    """The reader's end, closed after the given number of polls; holds what was sent."""

    def __init__(self, polls):
        self.polls, self.sent = polls, []

    def poll(self, _):
        self.polls -= 1
        return self.polls < 0

    def send(self, message): ...

    def send_bytes(self, data):
        self.sent.append(tracker_process.TrackedFrame.unpacked(data))


def test_frame_numbers(on_line):
    """Missed frames are counted; numbers that run backward, as of a device that began anew, miss none."""
    numbers = iter([5, 6, 9, 2, 3])
    aurora, _ = on_line(lambda *asked: pose_reply(*POSE, frame=next(numbers)) if asked[0] == "BX" else whole(*asked))
    aurora.connect()
    pipe = Pipe(5)
    tracker_process._read(aurora, SENSOR, pipe)
    assert [frame.missed for frame in pipe.sent] == [0, 0, 2, 0, 0]


@pytest.mark.parametrize(("handle", "says"), [(SENSOR, "0A is not tracked"), (0x0B, "handle 0B .there are 0A")])
def test_absent_tool(on_line, handle, says):
    """A tool that the device knows but does not track is told from one that it does not know."""
    aurora, _ = on_line(lambda *asked: bx_reply(bytes(3)) if asked[0] == "BX" else whole(*asked))
    aurora.connect()
    with pytest.raises(DeviceFault, match=says):
        tracker_process._read(aurora, handle, Pipe(5))


def test_endless_tools(on_line):
    """A device with ever new tools is a fault that names one."""
    handles = itertools.count()
    aurora, _ = on_line(lambda name, arguments: f"01{next(handles) % 256:02X}001" if arguments == "02" else "00")
    with pytest.raises(DeviceFault, match="waits again"):
        aurora.connect()


@pytest.mark.parametrize(
    ("noise", "says"),
    [
        (b"", "no answer at any"),
        (b"\xff\x00", r"came damaged \(cut short\)"),
        (b"OKAY0000\r", r"came damaged \(wrong CRC\)"),
        (b"OK\x50YA896\r", r"came damaged \(wrong CRC\)"),
    ],
)
def test_no_rate(on_line, monkeypatch, noise, says):
    """Damaged answers at every baud rate are told from silence, also instead of the message after a reset."""
    monkeypatch.setattr(Line, "send_break", lambda line, seconds: setattr(line, "reply", noise))
    aurora, _ = on_line(lambda name, arguments: noise)
    with pytest.raises(DeviceFault, match=says):
        aurora.connect()


REPLIES = ["OKAY", "", "00", "010A001", "020A0010B001", "FF" + "0A001" * 255, "ERROR0C", "ERROR", "ERRORxx", "-1", "1"]


@settings(
    max_examples=300,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data(), kinds=st.lists(st.sampled_from(REPLIES) | st.text(st.characters(codec="latin-1")), min_size=1))
def test_any_replies(on_line, data, kinds):
    """Whatever a device answers, connecting ends soon: well, or with a fault."""
    source = data.draw(st.randoms(use_true_random=False))
    aurora, _ = on_line(lambda name, arguments: source.choice(kinds).replace("\r", ""))
    with suppress(DeviceFault):
        aurora.connect()
        aurora.read()


# ---- clients written by others


def test_ndicapi(port, folder):
    """Its client takes the simulator for an Aurora and reads the same pose."""
    pytest.importorskip("ndicapy", reason="ndicapi is not installed")
    script = f"""
import ndicapy as ndi, time
assert ndi.ndiProbe({port!r}) == ndi.NDI_OKAY
device = ndi.ndiOpen({port!r})
print(ndi.ndiCommand(device, "INIT:"), ndi.ndiCommand(device, "COMM:50000"))
ndi.ndiCommand(device, "PHSR:02")
for i in range(ndi.ndiGetPHSRNumberOfHandles(device)):
    handle = ndi.ndiGetPHSRHandle(device, i)
    print(ndi.ndiCommand(device, f"PINIT:{{handle:02X}}"), ndi.ndiCommand(device, f"PENA:{{handle:02X}}D"))
print(ndi.ndiCommand(device, "TSTART:"))
frames = set()
end = time.monotonic() + 1
while time.monotonic() < end:
    answer = ndi.ndiCommand(device, "TX:0801")
    frames.add(answer[63:71])
print(answer[4:55])
print(len(frames), ndi.ndiGetError(device))
ndi.ndiClose(device)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    *setup, transform, last = done.stdout.splitlines()
    assert " ".join(setup).split() == ["OKAY"] * 7
    distinct, error = map(int, last.split())
    assert distinct >= 36 and error == 0
    with tracker(port, replies="TX") as aurora:
        aurora.connect()
        reading = aurora.read().readings[0]
    np.testing.assert_allclose([1e-5 * int(transform[24 + 7 * i : 31 + 7 * i]) for i in range(3)], reading.position)


def test_scikit(port, folder):
    """Its client reads poses, and NaN for a missing sensor."""
    pytest.importorskip("sksurgerynditracker", reason="scikit-surgerynditracker is not installed")
    from sksurgerynditracker.nditracker import NDITracker

    client = NDITracker({"tracker type": "aurora", "serial port": port})
    try:
        client.start_tracking()
        _, _, frames, poses, _ = client.get_frame()
        assert np.isfinite(poses[0]).all() and len(frames) == 3
        set_faults(folder, missing=1.0)
        time.sleep(0.1)
        assert np.isnan(client.get_frame()[3][0]).any()
        client.stop_tracking()
    finally:
        client.close()


# ---- faults, control, privacy


def test_checked_faults():
    """All wrong names and values in one error; null ends a fault."""
    with pytest.raises(InputError) as caught:
        checked({"mising": 0.5, "hang": 3, "garbage": "x", "missing": 0.5}, FAULTS)
    assert len(caught.value.problems) == 3 and "did you mean missing?" in str(caught.value)
    assert checked({"missing": 0.5, "hang": None}, FAULTS) == {"missing": 0.5, "hang": False}


def test_most(tmp_path):
    """A motor that the device does not have cannot fail, at once or later."""
    most = {"stall": 6}
    assert checked({"stall": 6}, {"stall": 0}, most) == {"stall": 6}
    with pytest.raises(InputError, match="0 to 6"):
        checked({"stall": 7}, {"stall": 0}, most)
    path = tmp_path / "scenario.yaml"
    path.write_text("- {at_s: 1, stall: 17}\n")
    with pytest.raises(InputError, match="0 to 6"):
        load_scenario(path, {"stall": 0}, most)


def test_scenario(tmp_path):
    """Changes in order of time; errors name their lines."""
    path = tmp_path / "scenario.yaml"
    path.write_text("- {at_s: 2, hang: true}\n- {at_s: 1, missing: 0.3}\n- {at_s: 3, hang: null}\n")
    assert load_scenario(path, FAULTS) == [(1.0, {"missing": 0.3}), (2.0, {"hang": True}), (3.0, {"hang": None})]
    path.write_text("- {at_s: 2, hung: true}\n- {missing: 0.3}\n")
    with pytest.raises(InputError) as caught:
        load_scenario(path, FAULTS)
    assert [problem.line for problem in caught.value.problems] == [1, 2]


def test_wrong_messages(port, folder):
    """No message ends the simulator or changes it by half; the strongest force that is permitted does not either."""
    survives_messages(folder, "aurora")
    request(folder, "aurora", {"force": [999, -999, 999], "probe": [999, 0, 0]})
    with tracker(port) as aurora:
        aurora.connect()
        assert len(aurora.read().readings) == 3
    with pytest.raises(InputError, match="weight"):  # what it does not know has no effect, and so is refused
        request(folder, "aurora", {"force": [0, 0, 0], "weight": 1})
    assert request(folder, "aurora", {})["force"] == [999, -999, 999]
    request(folder, "aurora", {"force": [0, 0, 0]})


def test_private_folder(folder, port):
    """Nobody else may enter the folder."""
    assert (folder.stat().st_mode & 0o777) == 0o700
    folder.chmod(0o755)
    with pytest.raises(InputError, match="chmod 700"):
        private_folder(folder)
    folder.chmod(0o700)
    made = private_folder(folder / "new")
    assert (made.stat().st_mode & 0o777) == 0o700


def test_set_command(folder, port, capfd):
    """Faults and forces reach the simulator, errors the terminal."""
    assert cli.run(["sim", "set", "aurora", "missing=0.25", "--force", "0", "-0.1", "0", "--folder", str(folder)]) == 0
    assert "0.25" in capfd.readouterr().out
    assert request(folder, "aurora", {})["force"] == [0, -0.1, 0]
    assert cli.run(["sim", "set", "aurora", "mising=1", "--folder", str(folder)]) == 1
    assert "did you mean missing?" in capfd.readouterr().err
    request(folder, "aurora", {"force": [0, 0, 0]})
    assert cli.run(["sim", "aurora", str(ROBOT), "--folder", str(folder)]) == 1
    assert "is running there already" in capfd.readouterr().err
