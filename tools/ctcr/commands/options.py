"""Shared by commands: arguments, options, loading, and `Output`, which gives a result back.

Each option exists once, as a decorator. Heavy imports are late: `ctcr --help` loads this file.
"""

import os
import re
from collections.abc import Iterable
from functools import cached_property, wraps
from importlib import import_module

import click

from ctcr.show.finite import Finite as Finite  # the type of numbers, for all commands


def setting(name: str, kind, default, text: str, **more):
    """An option with a default, which the help shows."""
    return click.option(name, type=kind, default=default, show_default=True, help=text, **more)


class File(click.ParamType):
    """A file that a command reads or writes. What one option writes, no other reads or writes.

    formats    endings that the name of a written file may have, if it has one
    """

    name = "file"

    def __init__(self, written: bool, *formats: str):
        self.written, self.formats = written, formats

    def convert(self, value, param, ctx):
        ending = os.path.splitext(value)[1].lower()
        if self.formats and ending and ending not in self.formats:
            self.fail(f"{value}: this option writes {' or '.join(self.formats)}, not {ending}.", param, ctx)
        if ctx and value != "-" and (os.path.isfile(value) or not os.path.exists(value)):  # not /dev/null
            same = (os.stat(value).st_dev, os.stat(value).st_ino) if os.path.exists(value) else os.path.realpath(value)
            first, written = ctx.meta.setdefault("ctcr.files", {}).setdefault(same, (param, self.written))
            if first is not param and (written or self.written):
                named, other = (one.get_error_hint(ctx) for one in (param, first))
                or_else = ", or --in-place to change it" if "in_place" in (p.name for p in ctx.command.params) else ""
                self.fail(f"{value} is also that of {other}: give another to {named}{or_else}.", param, ctx)
        return value


class Numbers(click.ParamType):
    """Finite numbers separated by commas."""

    name = "A,B,.."

    def convert(self, value, param, ctx) -> list[float]:
        try:
            return [Finite().convert(part, param, ctx) for part in value.split(",")]
        except click.BadParameter:
            self.fail(f"{value!r} is not a list of finite numbers such as 90,0,-30.5: commas separate them", param, ctx)


def joints(required: bool):
    """--beta-mm and --alpha-deg, as lists of numbers; see `array`."""

    def decorate(function):
        alpha = "Base angles [deg], innermost tube first."
        beta = "Grasped points [mm], <= 0, innermost tube first."
        function = click.option("--alpha-deg", type=Numbers(), required=required, help=alpha)(function)
        return click.option("--beta-mm", type=Numbers(), required=required, help=beta)(function)

    return decorate


def array(option: str, values: list[float], count: int):
    """The numbers of an option as an array (count,). Raises InputError where there are more or fewer."""
    import numpy as np

    from ctcr.errors import ArgumentError, Problem

    if len(values) != count:
        raise ArgumentError(
            Problem(f"needs {count} numbers such as -12.5, separated by commas, not {len(values)}", field=option)
        )
    return np.array(values)


read, written = File(written=False), File(written=True)


def reads(name: str, metavar: str, text: str, *field: str):
    """An option that names a file to read; `field`: the parameter that holds it, where that has another name."""
    return click.option(name, *field, type=read, metavar=metavar, help=text)


def writes(name: str, metavar: str, text: str, *field: str, **more):
    """An option that names a file to write; the endings in its metavar, as in FILE.png|.svg, are the only formats."""
    kind = File(True, *re.findall(r"\.\w+", metavar))
    return click.option(name, *field, type=kind, metavar=metavar, help=text, **more)


def output(metavar: str, text: str, **more):
    """-o, as `target`: the file to write."""
    return writes("-o", metavar, text, "--output", "target", **more)


def output_folder(text: str, **more):
    """The same for a folder."""
    return click.option("-o", "--output", "target", metavar="FOLDER", help=text, **more)


def repeated(name: str, field: str, metavar: str, text: str, **more):
    """An option that may be given several times."""
    return click.option(name, field, multiple=True, metavar=metavar, help=f"{text} May be repeated.", **more)


compiled_robot = click.argument("robot", type=read)  # which `robot_file.load` takes with `compiled`
measurements = click.argument("measurements", type=read)
folder_name = click.option(
    "--folder",
    metavar="FOLDER",
    help="Folder where the processes of one bench meet (mode 0700); default: one of this user's.",
)
steps = setting(
    "--steps",
    click.IntRange(1, 1000),
    4,
    "Factor on the number of integration steps: more steps are slower and more accurate.",
)
threads = setting("--threads", click.IntRange(0), 0, "Threads; 0: one per core.")
seed = setting("--seed", click.IntRange(min=0), 1, "Seed of the random numbers: the same seed gives the same result.")
noise = setting(
    "--noise",
    click.Choice(["none", "jitter", "realistic"]),
    "jitter",
    "jitter: white noise as the robot file states; realistic: also the tracker's smooth field error and outliers.",
)
hide = repeated(
    "--hide",
    "hidden",
    "EFFECT[.PARAMETER[.TUBE]]=VALUE",
    "Give the simulated robot an effect that ROBOT lacks; SI units (`ctcr effects EFFECT`).",
)
free = setting(
    "--free",
    str,
    "standard",
    "Parameters to fit, separated by commas: tubes.*.youngs_modulus,tracker.frame; standard: those of the paper.",
    metavar="NAMES",
)


frames = click.option(
    "--frame-per-run/--one-frame",
    default=None,
    help="A tracker frame for every run, or one for all; default: for every run where the readings support it.",
)
anyway = click.option("--anyway", is_flag=True, help="Go on where a wrong convention is found (see ctcr compare).")


def bench(what: str, required: bool = True):
    """--bench, as `bench_path`: the file of a bench."""
    return click.option("--bench", "bench_path", type=read, required=required, metavar="BENCH.yaml", help=what)


def folder(function):
    """--folder, as `folder`: the private folder of a bench, made where it does not exist."""

    @wraps(function)
    def command(*args, folder, **others):
        from ctcr.bench.shared.folder import private_folder

        return function(*args, folder=private_folder(folder), **others)

    return folder_name(command)


def new_robot(function):
    """-o and --in-place, as `target` and `in_place`: the robot file to write."""
    in_place = click.option("--in-place", is_flag=True, help="Change the robot file itself.")
    return output("NEW.yaml|.yml", "Write the changed robot file.")(in_place(function))


def _load_effects(context, parameter, files) -> None:
    for file in files:
        from ctcr.effects import user_effects

        user_effects.load(file)


# Eager: the robot file may name these effects. Every command has it whose results these may change, or that only shows
# or changes the file; compiled code alone cannot call Python.
effects = repeated(
    "--effects",
    "effects",
    "FILE.py",
    "Python file with effects of your own, which then count as those of the catalogue.",
    type=read,
    is_eager=True,
    expose_value=False,
    callback=_load_effects,
)


def robot(function):
    """ROBOT, and --effects, as its file may hold effects of the user's own."""
    return compiled_robot(effects(function))


def robot_option(text: str):
    """The same as an option --robot."""
    option = reads("--robot", "ROBOT", text)
    return lambda function: option(effects(function))


def load(robot: str, table: str, any_convention: bool = False):
    """The robot of a file, and a table of measurements or a plan for it; with `any_convention` also a table that may
    follow another convention: a comparison or a fit tells."""
    from ctcr.robot import robot_file
    from ctcr.table import measurements

    loaded, read = robot_file.load(robot), measurements.read if any_convention else measurements.load
    return loaded, read(table, loaded.n_tubes)


def doubtful(loaded, path: str, in_full: bool = False) -> list[str]:
    """A line on the values of a robot file that look wrong; none where none do. In full: a line for each."""
    from ctcr.api.reviewed import LOOK_FIRST
    from ctcr.effects.user_effects import command
    from ctcr.robot import robot_file
    from ctcr.show.wording import counted, sentence

    doubts = robot_file.warnings(loaded)
    if not doubts:
        return []
    if in_full:
        return [sentence(LOOK_FIRST), *(f"Doubt: {doubt}" for doubt in doubts)]
    look = "looks" if len(doubts) == 1 else "look"
    return [f"{counted(len(doubts), 'value')} {look} wrong in the robot file: {command('info', path)}"]


def with_effects(robot, given):
    """The robot with the effects of texts such as friction.coefficient=0.02."""
    from ctcr.effects import catalogue
    from ctcr.effects.settings import settings

    values = settings(given, robot)
    return catalogue.with_values(robot, list(dict.fromkeys(name.split(".")[1] for name in values)), values)


class Output:
    """Gives a result back: as text, with --json as numbers, with --report as a page."""

    def __init__(self, json_target: str | None = None, report: str | None = None):
        self.json_target, self.report = json_target, report

    @cached_property
    def console(self):
        """A rich console: standard output, or standard error where that carries the JSON."""
        from ctcr.show import output

        return output.console(self.json_target)

    def say(self, *lines) -> None:
        """Prints each line as it is."""
        for line in lines:
            self.console.print(str(line))

    def table(self, title: str, columns: Iterable[str], rows: list[list[str]], text_columns: int = 1) -> None:
        """Prints a table; the first columns are text, the others numbers."""
        from ctcr.show import output

        self.console.print(output.table(title, columns, rows, text_columns))

    def write_json(self, data) -> None:
        """Where --json asks for it."""
        if self.json_target:
            from ctcr.show import output

            output.write_json(data, self.json_target)

    def write_page(self, result) -> None:
        """Where --report asks for it: the page of a result of `show.result`."""
        if self.report:
            result.report(self.report)

    def write_report(self, module: str, result, **details) -> None:
        """Where --report asks for it: the page of the module, below ctcr."""
        if self.report:
            from ctcr.show import output

            page = import_module(f"ctcr.{module}").page(result, **details)
            output.write_text(page, self.report)


def _gives_output(*options):
    """A decorator: adds the options and passes what they ask for as `out`."""

    def decorate(function):
        @wraps(function)
        def command(*args, json_target, report=None, **others):
            out = Output(json_target, report)
            code = function(*args, out=out, **others)
            if report:
                out.say(f"Report: {report}")
            return code

        for option in options:
            command = option(command)
        return command

    return decorate


_json = click.option(
    "--json", "json_target", type=written, metavar="FILE", help="Write the result as JSON; - for standard output."
)
_report = writes("--report", "FILE.html", "Write one self-contained HTML page.")
json, outputs = _gives_output(_json), _gives_output(_json, _report)
