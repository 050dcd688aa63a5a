"""Whether the devices of a bench answer, with their versions or their faults."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from ctcr.bench.devices.aurora import Aurora
from ctcr.bench.devices.bench_file import Bench
from ctcr.bench.devices.bus import Bus
from ctcr.bench.devices.bus_lock import bus_lock
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.shared.ndi import NOT_TRACKED, ToolReading, system_faults


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
        tag = next((line for line in aurora.version.splitlines() if "Freeze Tag" in line), aurora.version).strip()
        faults = [f"{what}: {remedy}" for what, remedy in system_faults(frame.system_status)]
        if "aurora" not in aurora.version.lower():
            faults.append("calls itself no Aurora: is this the tracker's port?")
        yield Health("tracker", port, not faults, "; ".join([tag, *faults]))
        readings = {reading.handle: reading for reading in frame.readings}
        for tool in aurora.tools:
            reading = readings.get(tool.handle)
            text = f"{_sight(reading)}, serial number {tool.serial_number}, part {tool.part_number}"
            yield Health(f"tool {tool.handle:02X}", port, reading is not None, text)


def _sight(reading: ToolReading | None) -> str:
    if reading is None:
        return NOT_TRACKED
    return "out of volume" if reading.out_of_volume else "seen" if reading.position else "not seen"


def _bus(bench: Bench, folder: Path) -> Iterator[Health]:
    with bus_lock(folder), closing(Bus(bench.interface, bench.positions, bench.motors)) as bus:
        bus.connect()
        inputs = bus.exchange()
        used = {drive.position: (drive, said) for drive, said in zip(bus.drives, inputs or [], strict=False)}
        for position, name in enumerate(bus.names):
            drive, said = used.get(position, (None, None))
            broken = said is not None and said.error
            text = "answers" if said is None else drive.diagnosis().what if broken else f"counter {said.counter}"
            yield Health(name, f"{bench.interface}, position {position}", not broken, text)
