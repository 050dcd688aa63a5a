"""Starts simulators as processes of their own, as a user does, and stops them again."""

import json
import os
import socket
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from ctcr.bench.devices import emergency_stop
from ctcr.bench.shared.control import request
from ctcr.bench.shared.folder import private_folder
from ctcr.bench.simulators import aurora, bench, ethercat

ROOT = Path(__file__).parents[3]
HOMES = [3.0, -1.5, 2.5]  # rotations [deg] of the robot on the bench of test_live.py; its file says 0
T_REF = [-59.6, 20.3, -180.5], [0.004, 1.203, 0.297]  # [mm], [rad]
# As master and terminals say it.
BUS_STARVED = ("no terminal answers", "no frame came back whole", "no process data for 100 ms")
ROBOT = ROOT / "examples" / "data" / "demo" / "robot.yaml"


def ctcr(*arguments) -> list[str]:
    return [sys.executable, "-m", "ctcr", *map(str, arguments)]


def skip_without_bench() -> None:
    """Skips the test that asks, where no bench can be simulated."""
    if not bench.is_permitted():
        pytest.skip("this system does not permit networks of one's own (unshare -Urn), or iproute2 is missing")
    for package in ("pysoem", "serial"):
        pytest.importorskip(package, reason=f"{package} is not installed")


def was_starved(said: str) -> bool:
    """Whether the bus stopped because simulators slept: they have no real-time priority in a network of their own, and
    a computer busy with other tests may let them sleep. Only then a test is run once more."""
    return any(sign in said for sign in BUS_STARVED)


def run_before_others(command: list[str], **options) -> subprocess.CompletedProcess:
    """Runs a command, with its children, before other tests, where that is permitted."""

    def raise_priority() -> None:
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, -15)

    return subprocess.run(command, capture_output=True, text=True, preexec_fn=raise_priority, **options)


def run_on_bench(folder: Path, bench: list, tests: list, **environment: Path) -> None:
    """Runs pytest beside the simulators that `ctcr sim bench` starts with `bench`; tests find what they need in the
    environment, and the fixtures of bench_fixtures.py. Processes of different folders do not meet."""
    skip_without_bench()
    paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    known = {"PYTHONPATH": os.pathsep.join(paths), **environment}
    for attempt in (1, 2):
        pytest_command = "-m pytest -q --durations=9 -p no:cacheprovider -p no:xdist -p bench_fixtures".split()
        program = ["--folder", folder / str(attempt), "--", sys.executable, *pytest_command, *tests]
        environ = os.environ | {name: str(value) for name, value in known.items()}
        done = run_before_others(ctcr("sim", "bench", *bench, *program), cwd=ROOT, timeout=900, env=environ)
        print(done.stdout)
        if done.returncode == 0 or not was_starved(done.stdout):
            break
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


@contextmanager
def running(*command):
    """A process that says on its standard output when it is ready; ended when the block ends."""
    process = subprocess.Popen(
        list(command), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | {"COLUMNS": "200"}
    )
    try:
        first = process.stdout.readline()
        if process.poll() is not None:
            raise RuntimeError(first + process.stdout.read())
        yield process
    finally:
        process.terminate()
        process.wait(10)
        process.stdout.close()


FAULT_NAMES = "missing latency_ms lost_frames late_ms stall lost_after hang unplugged".split()
NO_NUMBERS = "NaN Infinity -1 1.5e300 1" + 400 * "0" + ' [] "1"'
NO_VECTORS = "0|[]|[0, 0, null]|[0, 0, NaN]|[1e308, 0, 0]|[[1, 2], 3, 4]|[true, 0, 0]".split("|")
WRONG_MESSAGES = [
    *(
        b"",
        b"\xff\0",
        b"[" * 60_000,
        b"3",
        b"null",
        b"[]",
        b'"faults"',
        b'{"faults": 3}',
        b'{"faults": {"\\ud800": 1}}',
    ),
    *(f'{{"faults": {{"{name}": {value}}}}}'.encode() for name in FAULT_NAMES for value in NO_NUMBERS.split()),
    *(f'{{"{name}": {value}}}'.encode() for name in ("force", "probe") for value in NO_VECTORS),
    *(f'{{"fasten": {value}}}'.encode() for value in ("true", "1.0", "-1", "99", "{}", "NaN")),
]


def survives_messages(folder: Path, name: str) -> None:
    """The simulator answers each of WRONG_MESSAGES, and is as it was before."""

    def state() -> dict:
        return {
            key: value for key, value in request(folder, name, {}).items() if key in ("faults", "force", "deployed")
        }

    before = state()
    for message in WRONG_MESSAGES:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
            client.connect(str(folder / f"{name}.sock"))
            client.send(message)
            json.loads(client.recv(1 << 16))
    assert state() == before


def mended_bench() -> Path:
    """The folder of the bench on which this program runs, with every fault of the simulators mended."""
    folder = private_folder()
    request(folder, "ethercat", {"faults": dict(ethercat.FAULTS)})
    request(folder, "aurora", {"faults": dict(aurora.FAULTS), "force": [0, 0, 0]})
    emergency_stop.release(folder)
    return folder
