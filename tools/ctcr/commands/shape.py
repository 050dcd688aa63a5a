"""`ctcr shape`: where the robot lies at given joints, in numbers and as a picture."""

import click

SAMPLES = 400  # along the backbone: a chord then misses the curve by micrometres


class Numbers(click.ParamType):
    """Numbers separated by commas."""

    name = "A,B,.."

    def convert(self, value, param, ctx) -> list[float]:
        try:
            return [float(part) for part in value.split(",")]
        except ValueError:
            self.fail(f"{value!r} is not a list of numbers such as -0.3,-0.2,-0.1", param, ctx)


@click.command(name="shape")
@click.argument("robot")
@click.option("--beta", type=Numbers(), help="Grasped points [m], <= 0, innermost tube first.")
@click.option("--beta-mm", type=Numbers(), help="The same in mm.")
@click.option("--alpha", type=Numbers(), help="Base angles [rad], innermost tube first.")
@click.option("--alpha-deg", type=Numbers(), help="The same in degrees.")
@click.option("--force", type=Numbers(), default="0,0,0", help="Force at the tip [N], base frame.")
@click.option("-o", "--output", "picture", metavar="FILE.png", help="Draw the robot.")
@click.option(
    "--steps", type=click.IntRange(1, 1000), default=4, show_default=True, help="Integration steps per segment."
)
@click.option(
    "--json", "json_target", metavar="FILE", help="Write it, with the samples, as JSON; - for standard output."
)
def command(robot, beta, beta_mm, alpha, alpha_deg, force, picture, steps, json_target) -> None:
    """Solve ROBOT at one set of joints: --beta and --alpha, one value a tube.

    Example: ctcr shape robot.yaml --beta-mm -330,-240,-165 --alpha-deg 50,-40,-60 -o robot.png
    """
    import numpy as np

    from ctcr.errors import InputError, Problem
    from ctcr.model.model import Model, status_text
    from ctcr.robot import robot_file
    from ctcr.show import output

    loaded = robot_file.load(robot)
    beta = _joints("beta", beta, "beta-mm", beta_mm, 1e-3, loaded.n_tubes)
    alpha = _joints("alpha", alpha, "alpha-deg", alpha_deg, np.pi / 180, loaded.n_tubes)
    force = _finite("force", np.array(force), 3)
    used, left_out = _without_path(loaded) if loaded.effects else (loaded, [])
    model = Model(used, steps=steps)
    tip = model.predict(beta[None], alpha[None], force[None])
    if tip.status[0] != 0:
        raise InputError(Problem(f"no shape at these joints: {status_text(int(tip.status[0]))}", robot))
    standard = Model(loaded.model_copy(update={"effects": {}}), steps=steps) if loaded.effects else model
    shape = standard.shape(beta, alpha, force, points=SAMPLES)
    ends = np.array([tube.length for tube in loaded.tubes]) + beta
    if picture:
        from ctcr.frames import matrix_from_quaternion
        from ctcr.show.pictures import draw_robot

        draw_robot(
            picture,
            loaded,
            shape.arc_length,
            shape.position,
            matrix_from_quaternion(shape.quaternion),
            ends,
            force,
            _title(beta, alpha),
        )
    data = _as_data(loaded, shape, tip, ends)
    if json_target:
        output.write_json(data, json_target)
    console = output.console(json_target)
    _report(console, loaded, data, picture)
    if loaded.effects:
        _tell_effects(console, tip.position[0], used, left_out)


def _without_path(robot):
    """The robot without the effects that depend on how its joints were reached, and their names."""
    from ctcr.model import effect_model

    left_out = effect_model.of_the_path(robot)
    kept = {name: given for name, given in robot.effects.items() if name not in left_out}
    return robot.model_copy(update={"effects": kept}), left_out


def _tell_effects(console, tip, robot, left_out: list[str]) -> None:
    from ctcr.model.effect_model import OF_THE_TRACKER

    acting = [name for name in robot.effects if name not in OF_THE_TRACKER]
    if acting:
        place = ", ".join(f"{1e3 * x:.3f}" for x in tip)
        text = f"With {', '.join(acting)} the sensor is at {place} mm; the shape is that of the standard model."
        console.print(text, markup=False)
    if left_out:
        text = f"Left out, as it depends on how the joints were reached: {', '.join(left_out)}"
        console.print(text, markup=False)


def _joints(name: str, values, other: str, other_values, factor: float, n_tubes: int):
    """Joints in SI units, from the option that was given."""
    import numpy as np

    from ctcr.errors import InputError, Problem
    from ctcr.table.measurements import QUANTITIES

    if (values is None) == (other_values is None):
        raise InputError(Problem(f"give either --{name} or --{other}: {n_tubes} numbers, innermost tube first"))
    used = f"--{name}" if other_values is None else f"--{other}"
    joints = _finite(used.lstrip("-"), np.array(values if other_values is None else other_values), n_tubes)
    joints = joints if other_values is None else factor * joints
    strange = [value for value in joints if abs(value) > QUANTITIES[name].usual[1]]
    if strange:
        raise InputError(Problem(QUANTITIES[name].doubt(strange[0]), field=used))
    return joints


def _finite(option: str, values, count: int):
    import numpy as np

    from ctcr.errors import InputError, Problem

    if len(values) != count or not np.isfinite(values).all():
        raise InputError(Problem(f"needs {count} finite numbers, separated by commas", field=f"--{option}"))
    return values


def _title(beta, alpha) -> str:
    import numpy as np

    return (
        "beta = " + ", ".join(f"{1e3 * value:.1f}" for value in beta) + " mm\n"
        "alpha = " + ", ".join(f"{value:.0f}" for value in np.degrees(alpha)) + " deg"
    )


def _as_data(robot, shape, tip, ends) -> dict:
    import numpy as np

    from ctcr.frames import matrix_from_quaternion

    def at(s: float) -> list[float]:
        return [float(np.interp(s, shape.arc_length, shape.position[:, k])) for k in range(3)]

    return {
        "robot": robot.name,
        "tip": {
            "position_m": tip.position[0],
            "quaternion_wxyz": tip.quaternion[0],
            "direction": matrix_from_quaternion(shape.quaternion[-1])[:, 2],
        },
        "tubes": [{"tip_arc_length_m": end, "tip_position_m": at(end)} for end in ends],
        "stability": tip.stability[0],
        "samples": {"arc_length_m": shape.arc_length, "position_m": shape.position},
    }


def _report(console, robot, data: dict, picture: str | None) -> None:
    from ctcr.show.output import table

    rows = [
        [f"tube {i + 1}", f"{1e3 * tube['tip_arc_length_m']:.2f}", *(f"{1e3 * x:.3f}" for x in tube["tip_position_m"])]
        for i, tube in enumerate(data["tubes"])
    ]
    console.print(f"[bold]{robot.name}[/bold], base frame")
    console.print(table("Where the tubes end", ["", "out [mm]", "x [mm]", "y [mm]", "z [mm]"], rows))
    tip = data["tip"]
    console.print("tip direction  " + ", ".join(f"{x:.5f}" for x in tip["direction"]))
    console.print("tip quaternion " + ", ".join(f"{x:.5f}" for x in tip["quaternion_wxyz"]) + "  (w, x, y, z)")
    if data["stability"] == data["stability"]:  # not known with effects
        console.print(f"stability      {data['stability']:.3g}  (0: about to snap)")
    if picture:
        console.print(f"picture: {picture}", markup=False)
