"""Where the devices of a bench are connected: what the bench file says, or where the simulators answer."""

from pathlib import Path

from ctcr.bench.devices.bench_file import SIMULATED, Bench
from ctcr.bench.simulators import aurora, network


def port_of(bench: Bench, folder: Path) -> str:
    """Serial port of the tracker."""
    return str(folder / aurora.NAME) if bench.tracker.port == SIMULATED else bench.tracker.port


def interface_of(bench: Bench) -> str:
    """Network interface of the bus."""
    return network.MASTER if bench.motors.interface == SIMULATED else bench.motors.interface
