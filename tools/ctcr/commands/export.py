"""`ctcr export`: a robot for a controller, or a recording for other programs."""

import click

from ctcr.commands import options


@click.command(name="export")
@click.argument("source", type=options.read)
@options.writes("--cpp", "FILE.hpp|.h", "Write the robot of SOURCE as a C++ header.")
@options.bench("With --cpp: the bench whose limits it holds.", required=False)
@options.setting("--namespace", str, "robot", "With --cpp: the namespace of the header.")
@options.output("FILE.mcap", "Write the recording of SOURCE as MCAP.")
def command(source, cpp, bench_path, namespace, target) -> None:
    """Write a robot as a C++ header, or a recording as MCAP.

    With --cpp SOURCE is a robot file. The header holds its tubes, homes, frames and effects as constants, where they
    come from, the limits of a bench, and a function system() that makes the model for a controller. It needs the
    headers of ctcr and Eigen alone.

    With -o SOURCE is the folder of a recording of ctcr record or ctcr track --live. The channels /joints,
    /measurements and, for a controlled robot, /reference hold one JSON message a row, with the columns of the
    recording; the names of the columns carry their units. Needs the package mcap.

    Example: ctcr export robot.yaml --cpp robot.hpp
    """
    if bool(cpp) == bool(target):
        raise click.UsageError("give --cpp FILE.hpp for a robot, or -o FILE.mcap for a recording")
    out = options.Output()
    if cpp:
        from ctcr.bench.devices import bench_file
        from ctcr.export import cpp_header
        from ctcr.robot import robot_file
        from ctcr.show.output import write_text

        robot = robot_file.load(source, compiled=True)
        write_text(cpp_header(robot, namespace, bench_file.load(bench_path) if bench_path else None), cpp)
        out.say(f"{namespace}::system(): {cpp}")
        if "tracker" in robot.left_out:
            out.say("The robot file has no tracker: T_ref in the header is the identity, base and tracker frame agree.")
        return
    from ctcr.track.recording import write_mcap

    out.table(target, ["channel", "messages"], [[name, str(n)] for name, n in write_mcap(source, target).items()])
