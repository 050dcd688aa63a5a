"""`ctcr demo`: the tools together."""

import click

from ctcr.commands import options


def _folder(what: str, default: str):
    text = f"{what}; that of an earlier demonstration is removed."
    return options.output_folder(text, default=default, show_default=True)


@click.group(name="demo", invoke_without_command=True)
@_folder("Folder of the files, results and reports", "ctcr_demo")
@click.pass_context
def command(context, target) -> int:
    """Find the effect that measurements of a robot hide, add it, and see the error fall.

    Puts a robot file and measurements into the folder and runs compare, diagnose, add, compare again and history there.
    Each command is shown as you would type it. It needs no hardware and takes about half a minute. `ctcr demo bench`
    shows the whole way on a simulated bench.

    Example: ctcr demo
    """
    if context.invoked_subcommand:
        return 0
    from ctcr.demo import effect_story
    from ctcr.demo.story import new_folder

    return effect_story.tell(new_folder(target), options.Output().console)


@command.command(name="bench")
@_folder("Folder of the recordings, results and the report", "build/bench_demo")
@click.option("--short", is_flag=True, help="Leave out the steps that only illustrate.")
def bench(target, short) -> int:
    """Find the effect that a robot on a simulated bench hides, add it to the model, and track with it.

    Each step is a command, shown as you would type it, which meets the robot through the protocols of tracker and
    motors. It takes some minutes and writes report.html. Where the computer is too busy for the simulated bus, the
    motors stop as on a real bench; the demonstration says so and resumes.

    Example: ctcr demo bench
    """
    import sys
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from ctcr.bench.simulators import bench as simulated
    from ctcr.bench.simulators.robot import SimulatedRobot
    from ctcr.demo import bench_story
    from ctcr.robot import robot_file

    hidden = bench_story.hidden_robot(robot_file.load(bench_story.FILES / "robot.yaml"), misplaced=not short)
    simulated.enter_own_network(sys.argv[1:])
    with TemporaryDirectory(prefix="ctcr-") as wires:  # a bench of its own: that of the user keeps its stop
        folder = Path(wires)
        return simulated.run(lambda: _tell(target, hidden, short, folder), SimulatedRobot(hidden), folder)


def _tell(target, hidden, short, folder) -> int:
    from ctcr.demo import bench_report, bench_story
    from ctcr.demo.story import Story, new_folder

    out, report = options.Output(), f"{target}/report.html"
    story = Story(new_folder(target), out.console, folder)
    bench_story.tell(story, short)
    out.say(*bench_report.write(story, hidden, report), f"Report: {report}")
    return 0
