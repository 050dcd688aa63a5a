"""`ctcr move`: the joints of the robot by hand."""

import click

from ctcr.commands import options


@click.command(name="move")
@click.argument("robot")
@click.option("--bench", "bench_path", required=True, metavar="BENCH.yaml", help="The devices and their limits.")
@click.option("--beta", metavar="MM,MM,...", help="Grasped points, innermost tube first [mm].")
@click.option("--alpha", metavar="DEG,DEG,...", help="Base angles, innermost tube first [deg].")
@click.option("--home", is_flag=True, help="Find where the joints are, by retracting each tube until it is flush.")
@click.option("--at-home", is_flag=True, help="Take where the joints stand now, set to their marks by hand, for home.")
@options.setting("--speed", click.FloatRange(0.01, 1.0), 0.5, "Fraction of the highest speed.")
@options.folder
def command(robot, bench_path, beta, alpha, home, at_home, speed, folder) -> None:
    """Move the joints of ROBOT in a straight line of joint space; those not given stay.

    Limits and the order of the tubes are checked before and during every move. Ctrl+C stops it.
    """
    import numpy as np

    from ctcr.bench.devices import bench_file, homing, person
    from ctcr.bench.devices.motors import Motors
    from ctcr.bench.shared.folder import private_folder
    from ctcr.robot import robot_file
    from ctcr.show import output

    loaded, place = robot_file.load(robot), private_folder(folder)
    bench, console, n = bench_file.load(bench_path), output.console(), loaded.n_tubes
    wanted = [_numbers("--beta", beta, n, 1e-3), _numbers("--alpha", alpha, n, np.pi / 180)]
    with Motors(bench, loaded, place) as motors:
        motors.connect()
        if home:
            homing.home(motors, loaded, person.person_of(bench, place), lambda text: console.print(text))
        if at_home:
            motors.set_joints(motors.settings.home)
        if beta or alpha:
            target = np.array(motors.joints)
            for part, values in zip((slice(0, n), slice(n, None)), wanted, strict=True):
                if values is not None:
                    target[part] = values
            motors.move(target, speed)
            motors.wait()
        state, joints = motors.state, motors.joints
        rows = [[f"tube {i + 1}", f"{1e3 * joints[i]:.3f}", f"{np.rad2deg(joints[n + i]):.3f}"] for i in range(n)]
        title = "Joints" if state["homed"] else "Joints since power on: home first (ctcr move --home)"
        console.print(output.table(title, ["", "beta [mm]", "alpha [deg]"], rows))


def _numbers(option, text, n, scale):
    if text is None:
        return None
    try:
        values = [scale * float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != n:
        raise click.BadParameter(f"needs {n} numbers with commas between", param_hint=option)
    return values
