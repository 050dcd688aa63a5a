"""Whether the devices of a bench answer, with their versions or their faults."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ctcr.bench.devices.aurora import Aurora
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.bus_process import bus_lock
from ctcr.bench.devices.fault import DeviceFault


@dataclass(frozen=True)
class Health:
    """One device and what it reports, or its fault and the remedy."""

    name: str
    place: str
    is_well: bool
    about: str


def health_of(bench: Bench, folder: Path) -> list[Health]:
    """Connects to every device in turn; motors stay off."""
    found, port, interface = [], bench.port(folder), bench.interface
    for name, place, devices in (("tracker", port, _tracker(bench, port)), ("", interface, _bus(bench, folder))):
        try:
            found += devices
        except DeviceFault as fault:
            found.append(Health(name or fault.device, place, False, f"{fault.what}: {fault.remedy}"))
    return found


def _tracker(bench: Bench, port: str) -> Iterator[Health]:
    with Aurora(port, bench.tracker.baud, bench.tracker.replies) as aurora:
        aurora.connect()
        frame = aurora.read()
        tag = next((line for line in aurora.version.splitlines() if "Freeze Tag" in line), aurora.version)
        yield Health("tracker", port, True, tag.strip())
        for tool, reading in zip(aurora.tools, frame.readings, strict=True):
            seen = "out of volume" if reading.out_of_volume else "seen" if reading.position else "not seen"
            text = f"{seen}, serial number {tool.serial_number}, part {tool.part_number}"
            yield Health(f"tool {tool.handle:02X}", port, True, text)


def _bus(bench: Bench, folder: Path) -> Iterator[Health]:
    bus = Bus(bench.interface, bench.positions, bench.motors)
    with bus_lock(folder):
        try:
            bus.connect()
            inputs = bus.exchange()
            used = {drive.position: (drive, said) for drive, said in zip(bus.drives, inputs or [], strict=False)}
            for position, name in enumerate(bus.names):
                drive, said = used.get(position, (None, None))
                broken = said is not None and said.error
                text = "answers" if said is None else drive.diagnosis().what if broken else f"counter {said.counter}"
                yield Health(name, f"{bench.interface}, position {position}", not broken, text)
        finally:
            bus.close()
