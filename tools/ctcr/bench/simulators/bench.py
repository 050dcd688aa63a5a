"""Both simulators around one robot, for as long as something is done beside them."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

from ctcr.bench.devices.private_folder import VARIABLE
from ctcr.bench.simulators import network
from ctcr.bench.simulators.aurora import AuroraSimulator
from ctcr.bench.simulators.ethercat import EthercatSimulator
from ctcr.bench.simulators.robot import SimulatedRobot
from ctcr.errors import InputError

READY_S = 20.0


def run(
    work: Callable[[], int],
    robot: SimulatedRobot,
    folder: Path,
    scenarios: tuple[str | None, str | None] = (None, None),
    seed: int = 1,
) -> int:
    """What `work` returns, done beside the simulators of tracker and bus; `scenarios` are theirs.

    The command line is run again in a network of its own, where that is permitted: call this before anything else.
    """
    os.environ[VARIABLE] = str(folder.resolve())
    if network.is_permitted():
        network.in_own_network(sys.argv[1:])
    network.make_cable()
    motors = 2 * robot.robot.n_tubes
    makers = (
        lambda: AuroraSimulator(robot, folder, scenarios[0], seed),
        lambda: EthercatSimulator(network.BUS, folder, motors, scenario=scenarios[1], seed=seed),
    )
    context = multiprocessing.get_context("fork")
    served = [_start(context, make) for make in makers]
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


def _start(context, make):
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(make, theirs), daemon=True)
    process.start()
    return process, ours


def _serve(make, ready: Connection) -> None:
    """A simulator until it is terminated; says None once it answers, or what is wrong."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the program beside it decides when to end
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        simulator = make()
    except InputError as problem:
        ready.send(problem)
        return
    ready.send(None)
    try:
        simulator.run()
    except KeyboardInterrupt:
        pass
    finally:
        simulator.close()
