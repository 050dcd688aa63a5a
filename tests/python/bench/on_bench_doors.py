"""Nobody else can reach the devices of a bench: test_ethercat.py runs this in `ctcr sim bench` (see on_bench.py)."""

import os
import socket
import stat
from pathlib import Path

from ctcr.bench.devices import bench_file
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.tracker import Tracker
from ctcr.robot import robot_file
from simulated_bench import mended_bench

DATAGRAM, LISTENING = "0002", "00010000"  # type and flags in /proc/net/unix


def doors(folder) -> list[str]:
    """Sockets of this bench's network, of any process, that let somebody in and are not in the folder."""
    found = []
    for kind in ("tcp", "tcp6", "udp", "udp6"):
        found += Path(f"/proc/net/{kind}").read_text().splitlines()[1:]
    named = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:] if len(line.split()) > 7]
    # A stream that does not listen only holds its name.
    names = [name for *_, flags, kind, _, _, name in named if kind == DATAGRAM or flags == LISTENING]
    return found + [name for name in names if Path(name).parent.resolve() != folder.resolve()]


def test_privacy():
    """Control sockets lie in a folder for this user alone; nothing listens on the network, not even on loopback."""
    folder = mended_bench()
    robot, bench = robot_file.load(os.environ["ROBOT_FILE"]), bench_file.load(os.environ["BENCH_FILE"])
    with Motors(bench, robot, folder) as motors, Tracker(bench, folder, 1.0) as tracker:
        motors.connect()
        tracker.connect()
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700 and folder.stat().st_uid == os.getuid()
        assert {path.name for path in folder.glob("*.sock")} == {"aurora.sock", "ethercat.sock"}
        assert doors(folder) == []
    for kind, address in ((socket.AF_INET, ("127.0.0.1", 0)), (socket.AF_UNIX, "\0ctcr-door")):
        with socket.socket(kind) as planted:
            planted.bind(address)
            planted.listen()
            assert len(doors(folder)) == 1
