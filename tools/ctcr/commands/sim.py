"""`ctcr sim`: simulated devices that any program can talk to."""

import click

from ctcr.commands import options

scenario_option = click.option(
    "--scenario", metavar="FILE.yaml", help="Faults at set times: a list of `at_s` with the faults that change."
)
oracle_option = click.option(
    "--oracle",
    metavar="COMMAND",
    help="A program that knows where the tip is, instead of the model; gets ROBOT as its last argument.",
)


@click.group(name="sim")
def command() -> None:
    """Simulated devices: a tracker on a serial line, stepper motors on EtherCAT, and the robot between them.

    They speak the devices' own protocols, so that programs take them for the real ones.
    """


@command.command(name="aurora")
@click.argument("robot")
@options.folder
@options.hide
@oracle_option
@options.noise
@options.seed
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
@options.setting("--motors", click.IntRange(1, 8), 6, "How many stepper terminals.")
@options.setting("--variant", click.Choice(["EL7041", "EL7031"]), "EL7041", "Type of the terminals.")
@options.folder
@options.seed
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
@options.folder
@options.hide
@oracle_option
@options.noise
@options.seed
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
@options.folder
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
    from ctcr.robot import robot_file

    if oracle and hidden:
        raise click.UsageError("--hide is for the model: let the --oracle hide it itself")
    loaded = robot_file.load(robot)
    hiding = options.with_effects(loaded, hidden)
    known = Oracle([*shlex.split(oracle), robot], loaded) if oracle else None
    return SimulatedRobot(hiding, noise, seed, known)


def _folder(folder):
    from ctcr.bench.shared.folder import private_folder

    return private_folder(folder)
