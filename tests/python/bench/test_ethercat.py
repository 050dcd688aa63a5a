"""The bus: object dictionary and frames of the simulated terminals, and what needs a running bench (on_bench.py)."""

import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from ctcr.bench.shared.ethercat import ProcessImage, signed
from ctcr.bench.shared.folder import BUS
from ctcr.bench.simulators.object_dictionary import Entry, ObjectDictionary, ServiceDataServer
from ctcr.bench.simulators.segment import Segment
from ctcr.bench.simulators.slave_controller import SlaveController
from ctcr.bench.simulators.stepper_terminal import StepperTerminal, coupler
from simulated_bench import ROBOT, ROOT, ctcr, run_on_bench, skip_without_bench  # noqa: E402

sys.path.insert(0, str(ROOT / "tools"))
from bench_faults import near_the_plate  # noqa: E402

ON_BENCH = [Path(__file__).parent / f"on_bench{name}.py" for name in ("_masters", "_doors", "", "_recording")]


# ---- service data, with a client of its own


class Client:
    """Reads and writes objects as the CANopen standard says, in segments where needed."""

    def __init__(self, dictionary, mailbox):
        self._server = ServiceDataServer(dictionary, mailbox)

    def ask(self, body: bytes) -> bytes:
        (answer,) = self._server.answer(struct.pack("<H", 2 << 12) + body)
        if answer[2] == 0x80:
            raise RuntimeError(hex(struct.unpack_from("<I", answer, 6)[0]))
        return answer[2:]

    def read(self, index, subindex, complete=False) -> bytes:
        answer = self.ask(struct.pack("<BHBI", 0x40 | complete << 4, index, subindex, 0))
        if answer[0] & 2:
            return answer[4 : 8 - (answer[0] >> 2 & 3)]
        size, data, toggle = struct.unpack_from("<I", answer, 4)[0], answer[8:], 0
        while len(data) < size:
            answer = self.ask(bytes([0x60 | toggle]) + bytes(7))
            assert answer[0] & 0x10 == toggle
            part = answer[1:]
            data += part[: 7 - (answer[0] >> 1 & 7)] if len(part) == 7 else part
            toggle ^= 0x10
            assert bool(answer[0] & 1) == (len(data) >= size)
        return data

    def write(self, index, subindex, data, complete=False, room=12):
        if len(data) <= 4 and not complete:
            head = 0x23 | 4 - len(data) << 2
            self.ask(struct.pack("<BHB", head, index, subindex) + data.ljust(4, b"\0"))
            return
        head = struct.pack("<BHBI", 0x21 | complete << 4, index, subindex, len(data))
        self.ask(head + data[:room])
        data, toggle = data[room:], 0
        while data:
            part, data = data[:room], data[room:]
            head = 0x00 | toggle | (not data) | max(0, 7 - len(part)) << 1
            self.ask(bytes([head]) + part.ljust(7, b"\0"))
            toggle ^= 0x10


@pytest.fixture
def dictionary():
    made = ObjectDictionary()
    made.variable(0x1000, "I", 0x1389, "type")
    made.variable(0x1008, "s", "a name that does not fit into one mail of this mailbox", "name")
    made.record(0x2000, "record", {i: Entry("H", 100 * i, True) for i in range(1, 21)}, resizable=True)
    made.variable(0x2001, "s", "", "text", writable=True)
    return made


@pytest.mark.parametrize("mailbox", [24, 32, 128])
def test_segmented_transfer(dictionary, mailbox):
    """Objects longer than a mail come and go whole."""
    client = Client(dictionary, mailbox)
    assert client.read(0x1000, 0) == struct.pack("<I", 0x1389)
    assert client.read(0x1008, 0).decode() == dictionary.value(0x1008, 0)
    whole = struct.pack("<H20H", 20, *(100 * i for i in range(1, 21)))
    assert client.read(0x2000, 0, complete=True) == whole
    assert client.read(0x2000, 1, complete=True) == whole[2:]
    for room in (3, 7, 12, 60):
        text = f"a long text in pieces of {room} bytes, and some more".encode()
        client.write(0x2001, 0, text, room=room)
        assert dictionary.value(0x2001, 0).encode() == text
        numbers = struct.pack("<20H", *range(room, room + 20))
        client.write(0x2000, 1, numbers, complete=True, room=room)
        assert dictionary.value(0x2000, 20) == room + 19
    client.write(0x2000, 0, b"\x03")
    assert client.read(0x2000, 1, complete=True) == struct.pack("<3H", *range(60, 63))


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (struct.pack("<BHBI", 0x40, 0x9999, 0, 0), "0x6020000"),
        (struct.pack("<BHBI", 0x40, 0x2000, 50, 0), "0x6090011"),
        (struct.pack("<BHBI", 0x2B, 0x1000, 0, 0), "0x6010002"),
        (struct.pack("<BHBI", 0x2F, 0x2000, 1, 0), "0x6070010"),
        (struct.pack("<BHBI", 0x50, 0x2000, 2, 0), "0x6010000"),
        (bytes([0x70]) + bytes(7), "0x5030000"),
        (bytes([0xA0]) + bytes(7), "0x5040001"),
    ],
)
def test_aborts(dictionary, body, code):
    """The abort code of each wrong request."""
    with pytest.raises(RuntimeError, match=code):
        Client(dictionary, 128).ask(body)


# ---- process data, frames


def test_process_image():
    """Values at their bits, with padding and two's complement."""
    image = ProcessImage([0x70000101, 0x70000201, 0x0000000E, 0x70001120, 0x70102110])
    assert image.length == 8 and image.fields[0x7000, 0x11].offset == 16
    values = {(0x7000, 1): 1, (0x7000, 2): 0, (0x7000, 0x11): 0xDEADBEEF, (0x7010, 0x21): -2}
    data = image.pack(values)
    assert data == struct.pack("<HIh", 1, 0xDEADBEEF, -2)
    read = image.unpack(data)
    assert read[0x7000, 0x11] == 0xDEADBEEF and signed(read[0x7010, 0x21], 16) == -2


def frame(command, target, address, data) -> bytearray:
    datagram = struct.pack("<BBHHHH", command, 7, target, address, len(data), 0) + data + b"\0\0"
    head = b"\xff" * 6 + b"\x01" * 6 + struct.pack(">H", 0x88A4) + struct.pack("<H", len(datagram) | 1 << 12)
    return bytearray(head + datagram)


def working_counter(made) -> int:
    return struct.unpack_from("<H", made, len(made) - 2)[0]


def test_addressing():
    """Auto-increment, fixed, broadcast and read-multiple-write addressing, by their working counters."""
    segment = Segment([SlaveController(coupler()), SlaveController(StepperTerminal(0)), SlaveController(coupler())])
    made = frame(7, 0, 0x0130, bytes(2))  # BRD of the AL status
    assert segment.pass_through(made, 0.0) and working_counter(made) == 3
    assert struct.unpack_from("<H", made, 18)[0] == 3 and made[26] == 1 and made[6] & 2
    for i in range(3):  # APWR of station addresses
        made = frame(2, -i & 0xFFFF, 0x0010, struct.pack("<H", 1001 + i))
        segment.pass_through(made, 0.0)
        assert working_counter(made) == 1
    made = frame(4, 1002, 0x0010, bytes(2))  # FPRD
    segment.pass_through(made, 0.0)
    assert working_counter(made) == 1 and made[26:28] == struct.pack("<H", 1002)
    made = frame(14, 1001, 0x0910, bytes(8))  # FRMW: one reads, two write
    segment.pass_through(made, 0.0)
    assert working_counter(made) == 3
    segment.connect(1)
    made = frame(7, 0, 0x0130, bytes(2))
    assert segment.pass_through(made, 0.0) and working_counter(made) == 1
    assert not segment.pass_through(bytearray(60), 0.0)
    broken = frame(7, 0, 0x0130, bytes(2))
    struct.pack_into("<H", broken, 22, 700)  # longer than the frame
    assert not segment.pass_through(broken, 0.0)


@pytest.mark.parametrize(("variant", "status"), [("EL7041", 0x1A06), ("EL7031", 0x1A05)])
def test_variants(variant, status):
    """The first POS status of the one is no first POS status of the other."""
    terminal = StepperTerminal(0, variant)
    other = 0x1A06 + 0x1A06 - 1 - status  # the first of the one is no first of the other
    assert terminal.objects[status].name == "POS Status compact"
    assert other not in terminal.objects or terminal.objects[other].name != "POS Status compact"
    assert terminal.lengths() == (8, 8)


def test_positioning_interface():
    """A rising edge of execute starts a move on the counter, a falling one ends it."""
    terminal = StepperTerminal(0)
    for index, assigned in ((0x1C12, (0x1601, 0x1602, 0x1605)), (0x1C13, (0x1A01, 0x1A03, 0x1A06))):
        terminal.objects.set(index, 0, 3)
        for i, pdo in enumerate(assigned, start=1):
            terminal.objects.set(index, i, pdo)
    assert terminal.lengths() == (14, 14)
    terminal.objects.set(0x8010, 1, 1000)
    terminal.entered(8)
    now = 0.0

    def run(execute, target, seconds, stop=0):
        nonlocal now
        outputs = struct.pack("<HiHHi", 0, 0, 1, execute | stop << 1, target)
        for _ in range(int(seconds / 0.002)):
            now += 0.002
            inputs = terminal.cycle(now, outputs, 14)
        _, counter, _, _, status = struct.unpack("<HiiHH", inputs)
        return counter, status

    run(0, 0, 0.01)
    assert run(1, 25600, 0.86)[1] & 1  # two turns with a ramp of 10 turns/s^2 take 0.894 s
    counter, status = run(1, 25600, 0.2)
    assert abs(counter - 25600) <= 2 and status & 0x02 and not status & 1
    run(0, 0, 0.01)
    run(1, 0, 0.3)
    halted = run(0, 0, 1.0)[0]
    assert 0 < halted < 25600 and run(0, 0, 0.1)[0] == halted


def test_overcurrent():
    """The terminal's default current is five times that of the motor: it reports an error until it is reset."""
    terminal = StepperTerminal(0)
    terminal.entered(8)
    inputs = [terminal.cycle(0.01 * i, struct.pack("<HHHh", 0, 0, 1, 0), 8) for i in range(40)]
    ready, error = ([struct.unpack("<4H", data)[3] >> bit & 1 for data in inputs] for bit in (1, 3))
    assert ready[5] and not error[5] and error[-1] and not ready[-1]
    assert terminal.objects.value(0xA010, 2) == 1
    assert struct.unpack("<4H", terminal.cycle(1.0, struct.pack("<HHHh", 0, 0, 2, 0), 8))[3] >> 3 & 1 == 0


# ---- on a bench


def on_bench(tmp_path, *options):
    robot, bench = tmp_path / "robot.yaml", tmp_path / "bench.yaml"
    near_the_plate(robot, bench)
    around = [robot, "--noise", "none"]
    run_on_bench(tmp_path / "bench", around, [*ON_BENCH, *options], ROBOT_FILE=robot, BENCH_FILE=bench)


@pytest.mark.alone
def test_on_bench(tmp_path):
    """The tests of ON_BENCH beside running simulators."""
    on_bench(tmp_path)


def test_ended_simulator(tmp_path):
    """`sim bench` says at once when a simulator ends, and fails in the end."""
    skip_without_bench()
    kill = "kill -9 $(cut -d' ' -f2 /proc/$PPID/task/$PPID/children); sleep 1; echo over"
    command = ctcr("sim", "bench", ROBOT, "--folder", tmp_path / "bench", "--", "sh", "-c", f"{kill} >&2")
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.splitlines() == ["Error: the simulator ethercat has ended: nothing answers in its place", "over"]


def test_second_simulator(tmp_path):
    """A second simulator on the same interface is refused, also one with a folder of its own."""
    skip_without_bench()
    second = ctcr("sim", "ethercat", "--interface", BUS, "--folder", tmp_path / "second")
    command = ctcr("sim", "bench", ROBOT, "--folder", tmp_path / "bench", "--", *second)
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert f"{BUS}: another simulator answers there" in done.stderr


@pytest.mark.slow
def test_more_on_bench(tmp_path):
    """Those that take long."""
    on_bench(tmp_path, "-m", "slow")


@pytest.mark.slow
def test_guide(tmp_path):
    """The first session of docs/hardware.md runs as it is written there."""
    skip_without_bench()
    for name, target in (("examples", ROOT / "examples"), (".venv", Path(sys.prefix))):
        (tmp_path / name).symlink_to(target)
    command = re.search(r"```bash\n(\S+ sim bench .*?)\n```", (ROOT / "docs" / "hardware.md").read_text())[1]
    environment = os.environ | {"CTCR_BENCH": str(tmp_path / "bench")}
    done = subprocess.run(
        ["sh", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for said in ("18 rows measured", "The model is wrong by", "There is hysteresis", "Possible causes: friction"):
        assert said in done.stdout


@pytest.mark.slow
def test_faults(tmp_path):
    """Every fault of docs/bench_faults.md, and some kills: survived, or stopped with the right message."""
    skip_without_bench()
    table = tmp_path / "faults.md"
    command = [sys.executable, ROOT / "tools" / "bench_faults.py", "--kills", "5", "-o", table]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stdout + done.stderr
    assert table.read_text().count("\n| ") >= 22
