"""The `ctcr` command. Each subcommand is a module of `ctcr.commands`, loaded when it is called."""

import errno
import io
import os
import pkgutil
import sys
from importlib import import_module

import click

from ctcr import commands
from ctcr.effects import watched
from ctcr.show.wording import visible

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
STOPPED = 130  # exit code after Ctrl+C: 128 + SIGINT, as shells have it
FORMATS = "docs/formats.md draws frames, angles and signs and lists every field and column."
FILES = {"robot", "measurements", "table", "tables", "log", "example"}  # arguments and options that name such files


class LazyGroup(click.Group):
    """Finds its subcommands in `ctcr.commands`: a new file there is a new command; `options` is what they share."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({module.name for module in pkgutil.iter_modules(commands.__path__)} - {"options"})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        command = import_module(f"ctcr.commands.{cmd_name}").command
        of_group = command.commands.values() if isinstance(command, click.Group) else ()
        for one in (command, *of_group):
            if FILES & {parameter.name for parameter in one.params}:
                one.epilog = FORMATS
        return command


def _version(ctx: click.Context, _: click.Parameter, asked: bool) -> None:
    if asked:
        import ctcr

        click.echo(f"ctcr {ctcr.__version__}")
        ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Print the version."
)
def cli() -> None:
    """Concentric tube continuum robots: what the model predicts, and how wrong it is.

    Example: ctcr compare robot.yaml measurements.csv --report error.html
    """


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line and exits with 0 when it did what was asked, whatever it found.

    Else standard error says what was wrong: 2 where the command line is wrong, 130 after Ctrl+C, else 1
    (docs/which_command.md).
    """
    # Before numpy loads: its matrices are too small for threads, which only wait for each other. The core has its own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.stdout, sys.stderr = (stream or open(os.devnull, "w") for stream in (sys.stdout, sys.stderr))  # None: closed
    sys.stdout.reconfigure(errors="backslashreplace")  # a letter that this terminal lacks must not stop a command
    given = sys.argv[1:] if arguments is None else arguments
    if any(word.startswith("--effects") for word in given) and (ended := watched.ended()):
        code, fault = ended
        if fault:
            _say(fault)
        sys.exit(code)
    sys.exit(run(given))


def run(arguments: list[str] | None = None) -> int:
    """The exit code of a command line. Set CTCR_DEBUG to see the traceback of an unexpected error."""
    try:
        given = sys.argv[1:] if arguments is None else arguments
        code = cli.main(given, prog_name="ctcr", standalone_mode=False, obj=given)  # a page tells how it was made
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except click.ClickException as error:
        usage = io.StringIO()
        error.show(usage)
        click.echo("\n".join(map(visible, usage.getvalue().split("\n"))), err=True, nl=False)
        return error.exit_code
    except click.Abort as stop:
        if isinstance(stop.__context__, EOFError):  # of a question: no terminal, or Ctrl+D
            _say("the input ended before all was answered: give options instead (see --help)")
            return 1
        _say("stopped")
        return STOPPED
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:
        return _report(error)


def _report(error: Exception) -> int:
    """Says what was wrong; the exit code."""
    from ctcr.errors import ArgumentError, InputError

    if isinstance(error, InputError):
        _say(*error.lines if len(error.lines) == 1 else ("the input cannot be used:", *error.lines))
    elif isinstance(error, OSError) and error.errno in FULL:  # standard output: files are InputErrors
        _say(f"the output cannot be written: {error.strerror.lower()}")
    elif isinstance(error, ModuleNotFoundError) and error.name == "ctcr._core":
        _say("the compiled part of ctcr is missing: install the package with `pip install .` or `tools/dev setup`")
    elif isinstance(error, MemoryError):
        _say("not enough memory for this input: split the table")
    elif "CTCR_DEBUG" in os.environ:
        raise error
    else:
        reason = " ".join(str(error).split())
        _say(f"{reason} ({type(error).__name__}; this should not happen: CTCR_DEBUG=1 shows where)")
    return click.UsageError.exit_code if isinstance(error, ArgumentError) else 1


def _say(*lines: str) -> None:
    """An error of one or more lines."""
    text = "\n  ".join(map(visible, lines))
    click.echo(f"{click.style('Error:', fg='red')} {text}", err=True)
