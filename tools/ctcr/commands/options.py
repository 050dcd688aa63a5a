"""Options that the commands of the bench share."""

import click

folder_option = click.option(
    "--folder", metavar="FOLDER", help="Where the processes of one bench meet (mode 0700); one of this user's."
)
