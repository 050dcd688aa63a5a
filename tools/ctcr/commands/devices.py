"""`ctcr devices`: what is connected, and how it is."""

import click

from ctcr.commands.options import folder_option


@click.command(name="devices")
@click.option("--bench", "bench_path", required=True, metavar="BENCH.yaml", help="Where the devices are connected.")
@folder_option
@click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output.")
def command(bench_path: str, folder: str | None, json_target: str | None) -> int:
    """Show which devices of a bench answer, their versions, and what is wrong with them. Nothing moves."""
    from ctcr.bench.devices import bench_file, emergency_stop
    from ctcr.bench.devices.health import health_of
    from ctcr.bench.shared.folder import private_folder
    from ctcr.show import output

    place = private_folder(folder)
    found = health_of(bench_file.load(bench_path), place)
    reason = emergency_stop.reason(place)
    if json_target:
        data = {"devices": [vars(device) for device in found], "stopped": reason}
        output.write_json(data, json_target)
    console = output.console(json_target)
    rows = [[d.name, d.place, "ok" if d.is_well else "FAULT", d.about] for d in found]
    console.print(output.table("Devices", ["", "where", "", "what it says"], rows, text_columns=4))
    if reason:
        console.print(f"The emergency stop is on: {reason}", markup=False)
    return 0 if all(device.is_well for device in found) and not reason else 1
