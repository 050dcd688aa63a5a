"""`ctcr stop`: the emergency stop of the bench."""

import click

from ctcr.commands import options


@click.command(name="stop")
@click.option("--release", is_flag=True, help="Release the stop, after its cause has been mended.")
@options.folder
def command(release: bool, folder) -> None:
    """Stop all motors of the bench at once.

    It is an error where no program drives a bus from this folder: another one may do so from its own. Motors stay
    stopped until `ctcr stop --release`, which also resets the terminals that report an error. This stops by
    software. The switch that cuts the motors' power is the emergency stop of the bench.

    Example: ctcr stop
    """
    from ctcr.bench.devices import emergency_stop
    from ctcr.bench.devices.bus_lock import driven_folders, is_driven
    from ctcr.errors import InputError, Problem

    if release:
        from ctcr.bench.devices.release import release as released

        options.Output().say(*released(folder))
        return
    was_driven = is_driven(folder)  # before: a program that is stopped ends at once
    emergency_stop.stop(folder, "ctcr stop was called")
    if was_driven:
        options.Output().say("stopped; release with `ctcr stop --release`")
        return
    text = "no program drives a bus from this folder: nothing that moves was stopped, and nothing moves here until "
    text += "a release; name the folder of a bench that moves with --folder or CTCR_BENCH"
    for other in driven_folders():
        text += f"; a program drives one from {other}: `ctcr stop --folder {other}`"
    raise InputError(Problem(text, str(folder)))
