"""`ctcr export`: a recording for other programs."""

import click


@click.command(name="export")
@click.argument("folder")
@click.option("-o", "--output", "target", required=True, metavar="FILE.mcap", help="The file to write.")
def command(folder, target) -> None:
    """Write the recording in FOLDER, of ctcr record or ctcr track --live, as MCAP.

    Joints, measurements and, of a controlled robot, references are channels of JSON messages, a message a row.
    """
    from ctcr.show import output
    from ctcr.track.mcap_file import write_mcap

    counts = write_mcap(folder, target)
    rows = [[channel, str(count)] for channel, count in counts.items()]
    output.console().print(output.table(target, ["channel", "messages"], rows))
