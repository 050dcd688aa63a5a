"""`ctcr sim`: simulated devices that any program can talk to."""

import click

from ctcr.commands import options

scenario_option = options.reads(
    "--scenario", "FILE.yaml", "Faults at set times: a list of `at_s` with the faults that change."
)


def robot_options(function):
    """The options of the simulated robot: those of `_robot`."""
    text = "A program that computes the tip instead of the model; last argument: ROBOT."
    oracle = click.option("--oracle", metavar="COMMAND", help=text)
    return options.hide(oracle(options.noise(options.seed(function))))


@click.group(name="sim")
def command() -> None:
    """Simulate the devices of a bench.

    A tracker on a serial line, stepper motors on EtherCAT, and the robot between them. They speak the devices' own
    protocols, so that programs take them for the real ones.

    Example: ctcr sim bench robot.yaml -- ctcr devices --bench bench.yaml
    """


@command.command(name="aurora")
@options.compiled_robot
@options.folder
@robot_options
@scenario_option
def aurora(robot, folder, scenario, seed, **physics) -> None:
    """Simulate an NDI Aurora tracker on a pseudo-terminal, looking at the tip of ROBOT.

    The robot stands at home, or where the motors of `ctcr sim ethercat` in the same folder put it.

    Example: ctcr sim aurora robot.yaml --noise realistic
    """
    from ctcr.bench.simulators.aurora import AuroraSimulator
    from ctcr.bench.simulators.bench import serve

    simulator = AuroraSimulator(_robot(robot, seed, **physics), folder, scenario, seed)
    serve(simulator, lambda: options.Output().say(f"tracker: {simulator.line.link}"))


@command.command(name="ethercat")
@click.option("--interface", metavar="NAME", help="Network interface to answer on, instead of a new virtual pair.")
@options.setting("--motors", click.IntRange(1, 8), 6, "Number of motor terminals.")
@options.setting("--variant", click.Choice(["EL7041", "EL7031"]), "EL7041", "Type of the terminals.")
@options.folder
@options.seed
@scenario_option
def ethercat(interface, motors, variant, folder, seed, scenario) -> None:
    """Simulate a coupler EK1100 and stepper terminals, which answer EtherCAT frames on a network interface.

    Needs the permissions that docs/hardware.md lists; `ctcr sim bench` needs none.

    Example: ctcr sim ethercat --interface eth1 --motors 6
    """
    from ctcr.bench.shared.folder import BUS, MASTER
    from ctcr.bench.simulators.bench import make_cable, serve
    from ctcr.bench.simulators.ethercat import EthercatSimulator

    if not interface:
        make_cable()
    simulator = EthercatSimulator(interface or BUS, folder, motors, variant, scenario, seed)
    said = f"bus on {interface}" if interface else f"bus: drive it from {MASTER}"
    serve(simulator, lambda: options.Output().say(said))


@command.command(name="bench", context_settings={"ignore_unknown_options": True})
@options.compiled_robot
@click.argument("program", nargs=-1, type=click.UNPROCESSED, metavar="[-- COMMAND...]")
@options.folder
@robot_options
@options.reads("--tracker-scenario", "FILE.yaml", "Faults of the tracker at set times.")
@options.reads("--bus-scenario", "FILE.yaml", "Faults of the bus at set times.")
def bench(robot, program, folder, tracker_scenario, bus_scenario, seed, **physics) -> int:
    """Simulate a whole bench around ROBOT while COMMAND runs (default: a shell); its motors move the tracked tip.

    Needs no special permissions: the bus and COMMAND get a network of their own.

    Example: ctcr sim bench robot.yaml --hide friction.coefficient=0.02 -- ctcr devices --bench bench.yaml
    """
    from ctcr.bench.simulators import bench as simulated

    scenarios = tracker_scenario, bus_scenario
    return simulated.run(lambda: _run(program), _robot(robot, seed, **physics), folder, scenarios, seed)


@command.command(name="set")
@click.argument("device", type=click.Choice(["aurora", "ethercat"]))
@click.argument("settings", nargs=-1, metavar="[FAULT=VALUE]...")
@click.option(
    "--force", nargs=3, type=float, metavar="FX FY FZ", help="Hang a weight: force at the tip [N], base frame."
)
@click.option("--break", "line_break", is_flag=True, help="A break on the serial line: resets the tracker.")
@options.folder
def set_(device, settings, force, line_break, folder) -> None:
    """Switch faults of a running simulator on and off; without any, show them.

    Example: ctcr sim set aurora missing=0.3
    """
    from ctcr.bench.shared.control import request
    from ctcr.robot import yaml_document

    pairs = [text.partition("=")[::2] for text in settings]
    message = {"faults": {name: yaml_document.parse(value, name).data for name, value in pairs}}
    message |= {"force": list(force)} if force else {}
    message |= {"break": True} if line_break else {}
    state = request(folder, device, message)
    rows = [[name, str(value).lower()] for name, value in state.pop("faults").items()]
    rows += [[name, str(value)] for name, value in state.items()]
    options.Output().table(f"Simulator: {device}", ["", "value"], rows)


def _run(program) -> int:
    """The exit code of a program, or of a shell."""
    import os
    import subprocess

    from ctcr.errors import InputError, Problem

    try:
        return subprocess.run(program or [os.environ.get("SHELL", "sh")]).returncode
    except FileNotFoundError:
        raise InputError(Problem(f"{program[0]}: no such command")) from None


def _robot(robot, seed, hidden, oracle, noise):
    import shlex

    from ctcr.bench.simulators.robot import Oracle, SimulatedRobot
    from ctcr.robot import robot_file

    if oracle and hidden:
        raise click.UsageError("--hide is for the model: let the --oracle hide it itself")
    loaded = robot_file.load(robot, compiled=True)
    try:
        words = shlex.split(oracle or "")
    except ValueError as error:
        raise click.BadParameter(str(error).lower(), param_hint="--oracle") from None
    known = Oracle([*words, robot], loaded) if words else None
    return SimulatedRobot(options.with_effects(loaded, hidden), noise, seed, known)
