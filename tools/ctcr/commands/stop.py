"""`ctcr stop`: the emergency stop of the bench."""

import click

from ctcr.commands import options


@click.command(name="stop")
@click.option("--release", is_flag=True, help="Release the stop, after its cause has been mended.")
@options.folder
def command(release: bool, folder) -> None:
    """Stop all motors of the bench at once.

    They stay stopped until `ctcr stop --release`, which also resets the terminals that report an error. This stops by
    software. The switch that cuts the motors' power is the emergency stop of the bench.

    Example: ctcr stop
    """
    from ctcr.bench.devices import emergency_stop

    if release:
        from ctcr.bench.devices.release import release as released

        options.Output().say(*released(folder))
        return
    emergency_stop.stop(folder, "ctcr stop was called")
    options.Output().say("stopped; release with `ctcr stop --release`")
