"""`ctcr export`: a recording for other programs."""

import click

from ctcr.commands import options


@click.command(name="export")
@click.argument("folder")
@click.option(
    "-o", "--output", "target", type=options.written, required=True, metavar="FILE.mcap", help="The file to write."
)
def command(folder, target) -> None:
    """Write a recording as MCAP.

    FOLDER holds a recording of ctcr record or ctcr track --live. The channels /joints, /measurements and, for a
    controlled robot, /reference hold one JSON message a row, with the columns of the recording; the names of the
    columns carry their units. Needs the package mcap.

    Example: ctcr export recording -o recording.mcap
    """
    from ctcr.track.recording import write_mcap

    rows = [[channel, str(count)] for channel, count in write_mcap(folder, target).items()]
    options.Output().table(target, ["channel", "messages"], rows)
