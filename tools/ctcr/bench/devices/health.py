"""Whether the devices of a bench answer, and what they say of themselves."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ctcr.bench.devices.aurora import Aurora
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.bus_lock import BusLock
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.places import interface_of, port_of


@dataclass(frozen=True)
class Health:
    """One device: what it says, or what is wrong and what to do."""

    name: str
    place: str
    is_well: bool
    about: str


def health_of(bench: Bench, folder: Path) -> list[Health]:
    """Connects to every device in turn; motors stay off."""
    try:
        with BusLock(folder):
            bus = list(_bus(bench))
    except DeviceFault as fault:
        bus = [Health(fault.device, interface_of(bench), False, f"{fault.what}: {fault.remedy}")]
    return [*_tracker(bench, folder), *bus]


def _tracker(bench: Bench, folder: Path) -> Iterator[Health]:
    port = port_of(bench, folder)
    try:
        with Aurora(port, bench.tracker.baud, bench.tracker.replies) as aurora:
            aurora.connect()
            frame = aurora.read()
            tag = next((line for line in aurora.version.splitlines() if "Freeze Tag" in line), aurora.version)
            yield Health("tracker", port, True, tag.strip())
            for tool, reading in zip(aurora.tools, frame.readings, strict=True):
                seen = "not seen" if reading.position is None else "seen"
                seen = "out of volume" if reading.out_of_volume else seen
                text = f"{seen}, serial number {tool.serial_number}, part {tool.part_number}"
                yield Health(f"tool {tool.handle:02X}", port, True, text)
    except DeviceFault as fault:
        yield Health("tracker", port, False, f"{fault.what}: {fault.remedy}")


def _bus(bench: Bench) -> Iterator[Health]:
    interface, motors = interface_of(bench), bench.motors
    bus = Bus(interface, [*motors.translation_terminals, *motors.rotation_terminals], bench.drive_settings)
    try:
        bus.connect()
        inputs = bus.exchange()
        used = {drive.position: (drive, said) for drive, said in zip(bus.drives, inputs or [], strict=False)}
        for position, name in enumerate(bus.names):
            where = f"{interface}, position {position}"
            if position not in used:
                yield Health(name, where, True, "answers")
                continue
            drive, said = used[position]
            text = drive.diagnosis().what if said.error else f"counter {said.counter}"
            yield Health(name, where, not said.error, text)
    except DeviceFault as fault:
        yield Health(fault.device, interface, False, f"{fault.what}: {fault.remedy}")
    finally:
        bus.close()
