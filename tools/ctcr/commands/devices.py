"""`ctcr devices`: the devices of a bench and their state."""

import click

from ctcr.commands import options


@click.command(name="devices")
@options.bench("Where the devices are connected.")
@options.folder
@options.json
def command(bench_path: str, folder, out) -> int:
    """Show the devices of a bench.

    Which of them answer, their versions and their faults. Nothing moves. The exit code is 1 where a device has a fault,
    or where the emergency stop is on.

    Example: ctcr devices --bench bench.yaml
    """
    from ctcr.bench.devices import bench_file, emergency_stop
    from ctcr.bench.devices.health import health_of

    found = health_of(bench_file.load(bench_path), folder)
    reason = emergency_stop.reason(folder)
    out.write_json({"devices": [vars(device) for device in found], "stopped": reason})
    rows = [[d.name, d.place, "ok" if d.is_well else "FAULT", d.about] for d in found]
    out.table("Devices", ["", "where", "", "report"], rows, text_columns=4)
    if reason:
        out.say(f"The emergency stop is on: {reason}")
    return 0 if all(device.is_well for device in found) and not reason else 1
