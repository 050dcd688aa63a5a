"""Both simulators around one robot, while some work is done beside them."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from ctcr.bench.shared.folder import BUS, VARIABLE
from ctcr.bench.simulators import network
from ctcr.bench.simulators.aurora import AuroraSimulator
from ctcr.bench.simulators.ethercat import EthercatSimulator
from ctcr.bench.simulators.robot import SimulatedRobot
from ctcr.bench.simulators.simulator import Simulator
from ctcr.errors import InputError

READY_S = 20.0


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
    network.enter_own_network(sys.argv[1:])
    network.make_cable()
    motors = 2 * robot.robot.n_tubes
    served = [
        _start(lambda: AuroraSimulator(robot, folder, scenarios[0], seed)),
        _start(lambda: EthercatSimulator(BUS, folder, motors, scenario=scenarios[1], seed=seed)),
    ]
    try:
        for _, ready in served:
            problem = ready.recv() if ready.poll(READY_S) else InputError([])
            if problem:
                raise problem
        return work()
    finally:
        for process, _ in served:
            process.terminate()
            process.join(READY_S)


def serve(simulator: Simulator) -> None:
    """Runs a simulator until SIGTERM or Ctrl+C."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with closing(simulator), suppress(KeyboardInterrupt):
        simulator.run()


def _start(make: Callable[[], Simulator]) -> tuple[BaseProcess, Connection]:
    """A process that serves, and the pipe in which it sends None once it answers, or what is wrong."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(make, theirs), daemon=True)
    process.start()
    return process, ours


def _serve(make: Callable[[], Simulator], ready: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the program beside it decides when to end
    try:
        simulator = make()
    except InputError as problem:
        ready.send(problem)
        return
    ready.send(None)
    serve(simulator)
