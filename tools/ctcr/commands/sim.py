"""`ctcr sim`: simulated devices that any program can talk to."""

import click

from ctcr.commands.options import folder_option

NOISES = ["none", "jitter", "realistic"]

scenario_option = click.option(
    "--scenario", metavar="FILE.yaml", help="Faults at set times: a list of `at_s` with the faults that change."
)
hide_option = click.option(
    "--hide",
    "hidden",
    multiple=True,
    metavar="EFFECT[.PARAMETER[.TUBE]]=VALUE",
    help="Give the simulated robot an effect that ROBOT does not have; SI units (see ctcr effects EFFECT).",
)
oracle_option = click.option(
    "--oracle",
    metavar="COMMAND",
    help="A program that knows where the tip is, instead of the model; gets ROBOT as its last argument.",
)
noise_option = click.option(
    "--noise", type=click.Choice(NOISES), default="jitter", show_default=True, help="As in ctcr simulate."
)
seed_option = click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)


@click.group(name="sim")
def command() -> None:
    """Simulated devices: a tracker on a serial line, stepper motors on EtherCAT, and the robot between them.

    They speak the devices' own protocols, so that programs take them for the real ones.
    """


@command.command(name="aurora")
@click.argument("robot")
@folder_option
@hide_option
@oracle_option
@noise_option
@seed_option
@scenario_option
def aurora(robot, folder, hidden, oracle, noise, seed, scenario) -> None:
    """Simulate an NDI Aurora tracker on a pseudo-terminal, looking at the tip of ROBOT.

    The robot stands at home, or where the motors of `ctcr sim ethercat` in the same folder put it.
    """
    from ctcr.bench.simulators.aurora import AuroraSimulator
    from ctcr.bench.simulators.bench import serve

    simulator = AuroraSimulator(_robot(robot, hidden, oracle, noise, seed), _folder(folder), scenario, seed)
    click.echo(f"tracker: {simulator.line.link}")
    serve(simulator)


@command.command(name="ethercat")
@click.option("--interface", metavar="NAME", help="Answer on this one, instead of making a virtual pair.")
@click.option("--motors", type=click.IntRange(1, 8), default=6, show_default=True)
@click.option(
    "--variant",
    type=click.Choice(["EL7041", "EL7031"]),
    default="EL7041",
    show_default=True,
    help="Type of the terminals.",
)
@folder_option
@seed_option
@scenario_option
def ethercat(interface, motors, variant, folder, seed, scenario) -> None:
    """Simulate a coupler EK1100 and stepper terminals, which answer EtherCAT frames on a network interface.

    Needs the rights of docs/hardware.md; `ctcr sim bench` needs none.
    """
    from ctcr.bench.shared.folder import BUS, MASTER
    from ctcr.bench.simulators import network
    from ctcr.bench.simulators.bench import serve
    from ctcr.bench.simulators.ethercat import EthercatSimulator

    place = _folder(folder)
    if not interface:
        network.make_cable()
    simulator = EthercatSimulator(interface or BUS, place, motors, variant, scenario, seed)
    click.echo(f"bus on {interface}" if interface else f"bus: drive it from {MASTER}")
    serve(simulator)


@command.command(name="bench", context_settings={"ignore_unknown_options": True})
@click.argument("robot")
@click.argument("program", nargs=-1, type=click.UNPROCESSED, metavar="[-- COMMAND...]")
@folder_option
@hide_option
@oracle_option
@noise_option
@seed_option
@click.option("--tracker-scenario", metavar="FILE.yaml", help="Faults of the tracker at set times.")
@click.option("--bus-scenario", metavar="FILE.yaml", help="Faults of the bus at set times.")
def bench(robot, program, folder, hidden, oracle, noise, seed, tracker_scenario, bus_scenario) -> int:
    """Simulate a whole bench around ROBOT while COMMAND runs (a shell without one); its motors move the tracked tip.

    Needs no rights: bus and COMMAND get a network of their own.
    """
    from ctcr.bench.simulators import bench as simulated

    robots = _robot(robot, hidden, oracle, noise, seed)
    return simulated.run(lambda: _run(program), robots, _folder(folder), (tracker_scenario, bus_scenario), seed)


@command.command(name="set")
@click.argument("device", type=click.Choice(["aurora", "ethercat"]))
@click.argument("settings", nargs=-1, metavar="[FAULT=VALUE]...")
@click.option("--force", nargs=3, type=float, metavar="FX FY FZ", help="Hang a weight: force at the tip [N].")
@click.option("--break", "line_break", is_flag=True, help="A break on the serial line: resets the tracker.")
@folder_option
def set_(device, settings, force, line_break, folder) -> None:
    """Switch faults of a running simulator on and off; without any, show them."""
    from ctcr.bench.shared.control import request
    from ctcr.robot import yaml_document
    from ctcr.show import output

    pairs = [text.partition("=")[::2] for text in settings]
    message = {"faults": {name: yaml_document.parse(value, name).data for name, value in pairs}}
    if force:
        message["force"] = list(force)
    if line_break:
        message["break"] = True
    state = request(_folder(folder), device, message)
    rows = [[name, str(value).lower()] for name, value in state.pop("faults").items()]
    rows += [[name, str(value)] for name, value in state.items()]
    output.console().print(output.table(f"Simulator: {device}", ["", "value"], rows))


def _run(program) -> int:
    """The exit code of a program, or of a shell."""
    import os
    import subprocess

    from ctcr.errors import InputError, Problem

    try:
        return subprocess.run(program or [os.environ.get("SHELL", "sh")]).returncode
    except FileNotFoundError:
        raise InputError(Problem(f"{program[0]}: no such command")) from None


def _robot(robot, hidden, oracle, noise, seed):
    import shlex

    from ctcr.bench.simulators.oracle import Oracle
    from ctcr.bench.simulators.robot import SimulatedRobot
    from ctcr.diagnose import add
    from ctcr.effects.settings import settings
    from ctcr.robot import robot_file

    if oracle and hidden:
        raise click.UsageError("--hide is for the model: let the --oracle hide it itself")
    loaded = robot_file.load(robot)
    values = settings(hidden, loaded)
    names = list(dict.fromkeys(name.split(".")[1] for name in values))
    known = Oracle([*shlex.split(oracle), robot], loaded) if oracle else None
    return SimulatedRobot(add.with_values(loaded, names, values), noise, seed, known)


def _folder(folder):
    from ctcr.bench.shared.folder import private_folder

    return private_folder(folder)
