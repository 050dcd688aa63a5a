"""Runs both simulators around one robot during some work, in a network namespace that needs no privileges."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from threading import Thread

from ctcr.bench.shared.folder import AURORA, BUS, ETHERCAT, MASTER, VARIABLE
from ctcr.bench.simulators.aurora import AuroraSimulator
from ctcr.bench.simulators.ethercat import EthercatSimulator
from ctcr.bench.simulators.robot import SimulatedRobot
from ctcr.bench.simulators.simulator import Simulator
from ctcr.errors import InputError, Problem
from ctcr.show.output import Terminal

READY_S = 20.0
_INSIDE = "CTCR_OWN_NETWORK"
_PAIR = ["ip", "link", "add", MASTER, "type", "veth", "peer", "name", BUS]


def run(
    work: Callable[[], int],
    robot: SimulatedRobot,
    folder: Path,
    scenarios: tuple[str | None, str | None] = (None, None),
    seed: int = 1,
) -> int:
    """Runs `work` beside the simulators of tracker and bus, and returns its result; `scenarios` are theirs.

    Where permitted, the command line starts again in a network of its own: call this before anything else.
    """
    os.environ[VARIABLE] = str(folder.resolve())
    enter_own_network(sys.argv[1:])
    make_cable()
    motors = 2 * robot.robot.n_tubes
    served = [
        _start(AURORA, lambda: AuroraSimulator(robot, folder, scenarios[0], seed)),
        _start(ETHERCAT, lambda: EthercatSimulator(BUS, folder, motors, scenario=scenarios[1], seed=seed)),
    ]
    try:
        for _, ready in served:
            problem = ready.recv() if ready.poll(READY_S) else InputError([])
            if problem:
                raise problem
        with _watched([process for process, _ in served]) as ended:
            code = work()
        return code or int(bool(ended))
    finally:
        for process, _ in served:
            process.terminate()
            process.join(READY_S)


@contextmanager
def _watched(processes: list[BaseProcess]) -> Iterator[list[str]]:
    """The names of those that end before the block does: each is said at once on standard error."""
    ended: list[str] = []
    errors = Terminal(stderr=True, soft_wrap=True)
    here, there = multiprocessing.Pipe()

    def watch() -> None:
        left = {process.sentinel: process.name for process in processes}
        while there not in (ready := wait([there, *left])):
            for sentinel in ready:
                ended.append(left.pop(sentinel))
                errors.print(f"Error: the simulator {ended[-1]} has ended: nothing answers in its place")

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield ended
    finally:
        here.close()
        watcher.join()


def serve(simulator: Simulator, ready: Callable[[], object]) -> None:
    """Runs a simulator until SIGTERM, or Ctrl+C; calls `ready` when it answers to both."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    with closing(simulator):
        ready()
        simulator.run()


def _start(name: str, make: Callable[[], Simulator]) -> tuple[BaseProcess, Connection]:
    """A process that serves, and the pipe in which it sends None once it answers, or what is wrong."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(make, theirs), name=name, daemon=True)
    process.start()
    return process, ours


def _serve(make: Callable[[], Simulator], ready: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the program beside it decides when to end
    try:
        simulator = make()
    except InputError as problem:
        ready.send(problem)
        return
    try:
        serve(simulator, lambda: ready.send(None))
    except InputError as problem:  # such as an oracle that does not answer
        sys.exit(f"Error: {problem}")


# ---- network: a pair of virtual interfaces, joined like by a cable


def make_cable() -> None:
    """Makes the pair, or finds it there. Raises InputError where this is not permitted."""
    if not shutil.which("ip"):
        raise InputError(Problem("the command `ip` is missing: install iproute2"))
    if subprocess.run(["ip", "link", "show", MASTER], capture_output=True).returncode == 0:
        return
    settings = (["addrgenmode", "none"], ["up"])  # the first: no IPv6 traffic
    for command in (_PAIR, *(["ip", "link", "set", name, *to] for to in settings for name in (MASTER, BUS))):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode and "File exists" not in done.stderr:
            reason = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "refused"
            raise InputError(Problem(f"cannot make virtual network interfaces: {reason}", MASTER))


def enter_own_network(arguments: list[str]) -> None:
    """Starts this program again in a network namespace of its own, where that is permitted and not done yet."""
    if not os.environ.get(_INSIDE) and is_permitted():
        os.environ[_INSIDE] = "1"
        os.execvp("unshare", [*_unshare(), sys.executable, "-m", "ctcr", *arguments])


def is_permitted() -> bool:
    """Whether the user may make a network namespace with the pair in it."""
    return bool(shutil.which("unshare")) and subprocess.run([*_unshare(), *_PAIR], capture_output=True).returncode == 0


def _unshare() -> list[str]:
    """Root needs no user namespace, and without one keeps the right to real-time priority."""
    return ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-Urn"]
