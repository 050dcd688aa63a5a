"""Independent EtherCAT masters drive the simulated terminals, inside of `ctcr sim bench` (see on_bench.py)."""

import struct
import subprocess
import sys
import time

import pytest
from ctcr.bench.shared.folder import MASTER
from simulated_bench import mended_bench

SAFEOP, OP = 4, 8  # states of a terminal


@pytest.fixture
def folder():
    return mended_bench()


@pytest.fixture
def master(folder):
    pysoem = pytest.importorskip("pysoem", reason="pysoem is not installed")
    pysoem.settings.timeouts.ret = 20000
    master = pysoem.Master()
    master.open(MASTER)
    yield master
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


def to_op(master):
    """The shortest way to OP with the default process data."""
    assert master.config_init() == 7
    master.config_map()
    assert master.state_check(SAFEOP, 50000) == SAFEOP
    master.send_processdata()
    master.receive_processdata(20000)
    master.state = OP
    master.write_state()
    for _ in range(200):
        master.send_processdata()
        count = master.receive_processdata(20000)
        if master.state_check(OP, 2000) == OP:
            return count
    raise AssertionError([hex(slave.al_status) for slave in master.slaves])


def test_pysoem_objects(master):
    """SDO transfers and their abort codes."""
    import pysoem

    assert master.config_init() == 7
    assert [slave.name for slave in master.slaves] == ["EK1100", *["EL7041"] * 6]
    first = master.slaves[1]
    assert first.man == 2 and first.id == 0x1B813052
    assert first.sdo_read(0x1008, 0) == b"EL7041"
    assert struct.unpack("<H", first.sdo_read(0x8010, 1))[0] == 5000
    first.sdo_write(0x8010, 1, struct.pack("<H", 1000))
    assert struct.unpack("<H", first.sdo_read(0x8010, 1))[0] == 1000
    whole = first.sdo_read(0x1601, 0, ca=True)
    assert struct.unpack("<H6I", whole)[0] == 6
    for (index, subindex), code in {(0x9999, 0): 0x06020000, (0x1018, 9): 0x06090011}.items():
        with pytest.raises(pysoem.SdoError) as caught:
            first.sdo_read(index, subindex)
        assert caught.value.abort_code == code
    for subindex, data, code in ((1, b"\0", 0x06070010), (1, struct.pack("<H", 6000), 0x06090030)):
        with pytest.raises(pysoem.SdoError) as caught:
            first.sdo_write(0x8010, subindex, data)
        assert caught.value.abort_code == code
    with pytest.raises(pysoem.SdoError) as caught:
        first.sdo_write(0x1018, 1, struct.pack("<I", 1))
    assert caught.value.abort_code == 0x06010002


def test_pysoem_watchdog(master):
    """Without process data the terminals leave OP with 0x001B, and return to it once acknowledged."""
    assert to_op(master) == master.expected_wkc == 18
    for _ in range(20):
        master.send_processdata()
        assert master.receive_processdata(20000) == 18
        time.sleep(0.002)
    time.sleep(0.15)
    master.read_state()
    assert [slave.state for slave in master.slaves[1:]] == [SAFEOP | 0x10] * 6
    assert {slave.al_status for slave in master.slaves[1:]} == {0x001B}
    for slave in master.slaves[1:]:
        slave.state = SAFEOP | 0x10  # acknowledges
        slave.write_state()
        assert slave.state_check(SAFEOP, 50000) == SAFEOP
    master.state = OP
    master.write_state()
    for _ in range(100):
        master.send_processdata()
        master.receive_processdata(20000)
        if master.state_check(OP, 2000) == OP:
            break
    assert master.read_state() == OP


def test_kickcat(folder):
    """Another master: mailbox, mapping, OP, fifty cycles with the right working counter."""
    pytest.importorskip("kickcat", reason="kickcat is not installed")
    script = f"""
import time
import kickcat as k
link = k.create_link({MASTER!r}, "")
link.set_timeout(0.05)
bus = k.Bus(link)
bus.init(2.0)
slaves = bus.slaves()
assert bus.read_sdo(slaves[1], 0x1008, 0, k.Access.PARTIAL, 32, 2.0) == b"EL7041"
try:
    bus.read_sdo(slaves[1], 0x9999, 0, k.Access.PARTIAL, 32, 0.3)
    raise AssertionError("no abort")
except (RuntimeError, k.ErrorCoE):
    pass
bus.create_mapping()
sizes = [(s.input_size, s.output_size) for s in slaves]
assert sizes == [(0, 0)] + [(8, 8)] * 6, sizes
bus.request_state(k.State.SAFE_OP)
bus.wait_for_state(k.State.SAFE_OP, 2.0)
for s in slaves[1:]:
    s.set_output_bytes(bytes(s.output_size))
bus.process_data_no_check()
bus.request_state(k.State.OPERATIONAL)
bus.wait_for_state(k.State.OPERATIONAL, 2.0, lambda: bus.process_data_no_check())
for _ in range(50):
    bus.process_data()  # raises where the working counter is wrong
    time.sleep(0.002)
assert all(bus.get_state(s) == k.State.OPERATIONAL for s in slaves)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
