"""The release of the emergency stop, with which a person says that its cause has been mended."""

from contextlib import closing
from pathlib import Path

from ctcr.bench.devices import emergency_stop
from ctcr.bench.devices.bus_lock import bus_lock
from ctcr.bench.devices.bus_process import last_bus
from ctcr.bench.devices.fault import DeviceFault


def release(folder: Path) -> list[str]:
    """Resets the terminals that report an error, then lets the motors move again; what was done, in words.

    The terminals are those that a program drove last. Where they cannot be asked, the next program asks them. Raises
    DeviceFault where one keeps its error, or while another program drives them: then the stop stays.
    """
    said = _reset(folder)
    reason = emergency_stop.reason(folder)
    emergency_stop.release(folder)
    return [*said, f"released; the reason of the stop was: {reason}" if reason else "nothing was stopped"]


def _reset(folder: Path) -> list[str]:
    bus = last_bus(folder)
    if bus is None:
        return []
    with bus_lock(folder), closing(bus):
        try:
            bus.connect()
        except DeviceFault as fault:
            return [f"terminals were not reset: {fault}"]
        return [f"terminal {drive.position} ({drive.slave.name}): reset" for drive in bus.reset()]
