"""`ctcr move`: the joints of the robot by hand."""

import click

from ctcr.commands import options


@click.command(name="move")
@options.robot
@options.bench("The devices and their limits.")
@options.joints(required=False)
@click.option("--home", is_flag=True, help="Home the joints: retract each tube until its tip is flush with the plate.")
@click.option("--at-home", is_flag=True, help="Take the present joints, set to their marks by hand, for home.")
@options.setting("--speed", options.Finite(0.01, 1.0), 0.5, "Fraction of the highest speed.")
@options.folder
def command(robot, bench_path, beta_mm, alpha_deg, home, at_home, speed, folder) -> None:
    """Move the joints of a robot.

    They move along a straight line of joint space; joints that are not given stay. Limits and the order of the tubes
    are checked before and during every move. Ctrl+C stops it.

    Example: ctcr move robot.yaml --bench bench.yaml --beta-mm -80,-60,-40 --alpha-deg 0,90,0
    """
    import numpy as np

    from ctcr.bench.devices import bench_file, homing
    from ctcr.bench.devices.motors import Motors
    from ctcr.bench.devices.person import person_of
    from ctcr.robot import robot_file

    loaded, bench, out = robot_file.load(robot), bench_file.load(bench_path), options.Output()
    n = loaded.n_tubes
    given = ("--beta-mm", beta_mm, 1e-3), ("--alpha-deg", alpha_deg, np.pi / 180)
    wanted = [None if values is None else unit * options.array(name, values, n) for name, values, unit in given]
    with Motors(bench, loaded, folder) as motors:
        motors.connect()
        if home:
            homing.home(motors, loaded, person_of(bench, folder), out.say)
        if at_home:
            motors.set_joints(motors.settings.home)
        if beta_mm or alpha_deg:
            now = motors.joints.reshape(2, n)
            target = [row if new is None else new for new, row in zip(wanted, now, strict=True)]
            motors.move(np.concatenate(target), speed)
            motors.wait()
        degrees, homed = np.rad2deg(motors.joints[n:]), motors.state["homed"]
        rows = [[f"tube {i + 1}", f"{1e3 * motors.joints[i]:.3f}", f"{degrees[i]:.3f}"] for i in range(n)]
        title = "Joints" if homed else "Joints since power on: home first (ctcr move --home)"
        out.table(title, ["", "beta [mm]", "alpha [deg]"], rows)
