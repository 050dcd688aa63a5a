"""All commands of `ctcr`, and the examples of their help."""

import shlex
from collections.abc import Iterator

import click
from ctcr import cli

Path = tuple[str, ...]  # of a command: ("calibrate", "fit")


def commands(group: click.Group = cli.cli, path: Path = ()) -> Iterator[tuple[Path, click.Command]]:
    """Every command that does something, those of groups too."""
    return ((way, found) for way, found in all_pages(group, path) if not isinstance(found, click.Group))


def all_pages(command: click.Command = cli.cli, path: Path = ()) -> Iterator[tuple[Path, click.Command]]:
    """Every command and every group, `ctcr` itself too: what has a help page."""
    yield path, command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from all_pages(command.get_command(context, name), (*path, name))


def example(command: click.Command) -> list[str]:
    """The words of the example at the end of a help, behind `ctcr`; none without one."""
    return shlex.split(" ".join((command.help or "").split()).partition("Example: ctcr")[2])


def parse(words: list[str]) -> Path:
    """The path of the command that accepts these words. Raises click's errors where none does."""
    command, path, rest = cli.cli, (), words
    while isinstance(command, click.Group) and rest:
        name, command, rest = command.resolve_command(click.Context(command), rest)
        path = (*path, name)
    with command.make_context(" ".join(path), list(rest)) as context:
        program = list(context.params.get("program", ()))
    if program[:1] == ["ctcr"]:  # a command that runs another one
        parse(program[1:])
    return path
