"""`ctcr shape`: where the robot lies at given joints, in numbers and as a picture."""

import click

from ctcr.commands import options
from ctcr.errors import ArgumentError, InputError, Problem

SAMPLES = 400  # along the backbone: a chord then misses the curve by micrometres


@click.command(name="shape")
@options.robot
@options.joints(required=True)
@click.option("--force", type=options.Numbers(), default="0,0,0", help="Force at the tip [N], base frame.")
@click.option("--all", "every", is_flag=True, help="List all stable equilibria: the robot may rest in several.")
@options.writes("-o", "FILE.png|.svg|.pdf", "Draw the robot.", "--output", "picture")
@options.steps
@options.json
def command(robot, beta_mm, alpha_deg, force, every, picture, steps, out) -> None:
    """Solve the shape of a robot at given joints.

    The joints are one value a tube. Shows the pose of the tip, the ends of the tubes and the stability. The JSON
    holds samples of the backbone [m] in the base frame. Effects that depend on how the joints were reached are left
    out. A robot of strongly curved tubes may have several stable equilibria: --all lists all that are found, and
    draws the others as dashed lines. The history of the joints decides in which of them the robot rests.

    Example: ctcr shape robot.yaml --beta-mm -330,-240,-165 --alpha-deg 50,-40,-60 -o robot.png
    """
    import numpy as np

    from ctcr.frames import matrix_from_quaternion
    from ctcr.model import effect_model
    from ctcr.model.model import Model, status_text
    from ctcr.robot import robot_file

    loaded = robot_file.load(robot)
    beta = _joints("beta", "--beta-mm", 1e-3 * options.array("--beta-mm", beta_mm, loaded.n_tubes))
    alpha = _joints("alpha", "--alpha-deg", np.deg2rad(options.array("--alpha-deg", alpha_deg, loaded.n_tubes)))
    force = options.array("--force", force, 3)
    used = effect_model.without_the_path(loaded)
    model = Model(used, steps=steps)
    tip = model.predict(beta[None], alpha[None], force[None])
    if tip.status[0] != 0:
        raise InputError(Problem(f"no shape at these joints: {status_text(int(tip.status[0]))}", robot))
    here = {"beta": beta, "alpha": alpha, "force": force, "points": SAMPLES}
    shape, *others = shapes = model.all_shapes(**here) if every else [model.shape(**here)]
    ends = loaded.lengths + beta
    rotation = matrix_from_quaternion(shape.quaternion)
    if picture:
        from ctcr.show.pictures import draw_robot

        title = f"beta = {_listed(1e3 * beta, 1)} mm\nalpha = {_listed(np.degrees(alpha), 0)} deg"
        backbones = [other.position for other in others]
        draw_robot(picture, loaded, shape.arc_length, shape.position, rotation, ends, force, title, backbones)
    tips = shape.position_at(ends)
    out.write_json(
        {
            "robot": loaded.name,
            "tip": {
                "position_m": tip.position[0],
                "quaternion_wxyz": tip.quaternion[0],
                "direction": rotation[-1][:, 2],
            },
            "tubes": [{"tip_arc_length_m": s, "tip_position_m": x} for s, x in zip(ends, tips, strict=True)],
            "stability": tip.stability[0],
            "samples": _samples(shape),
        }
        | ({"other_equilibria": [{"stability": x.stability, "samples": _samples(x)} for x in others]} if every else {})
    )
    out.console.print(f"{loaded.name}, base frame", style="bold")
    rows = [
        [f"tube {i}", f"{1e3 * s:.2f}", *(f"{1e3 * x:.3f}" for x in position)]
        for i, (s, position) in enumerate(zip(ends, tips, strict=True), start=1)
    ]
    out.table("Where the tubes end", ["", "out [mm]", "x [mm]", "y [mm]", "z [mm]"], rows)
    out.say("tip direction  " + _listed(rotation[-1][:, 2], 5))
    out.say("tip quaternion " + _listed(tip.quaternion[0], 5) + "  (w, x, y, z)")
    out.say(f"stability      {tip.stability[0]:.3g}  (0: about to snap)")
    if every:
        _list(shapes, out)
    if picture:
        out.say(f"picture: {picture}")
    if acting := effect_model.of_the_poses(used):
        out.say(f"With the effects {', '.join(acting)}")
    left_out = [name for name in loaded.effects if name not in used.effects]
    own = [name for name in left_out if name in robot_file.user_effects]
    if with_history := [name for name in left_out if name not in own]:
        out.say(f"Left out, as it depends on how the joints were reached: {', '.join(with_history)}")
    if own:
        out.say(f"Left out, as effects written in Python act on the rows of tables alone: {', '.join(own)}")


def _list(shapes, out) -> None:
    """The tips of all equilibria, the one that is described first."""
    import numpy as np

    if len(shapes) == 1:
        out.say("No other stable equilibrium was found")
        return
    tips = np.array([shape.position[-1] for shape in shapes])
    rows = [
        [
            str(number),
            *(f"{1e3 * x:.3f}" for x in tip),
            f"{1e3 * np.linalg.norm(tip - tips[0]):.2f}",
            f"{one.stability:.3g}",
        ]
        for number, (tip, one) in enumerate(zip(tips, shapes, strict=True), start=1)
    ]
    heads = ["", "x [mm]", "y [mm]", "z [mm]", "from the first [mm]", "stability"]
    out.table("Tips of the stable equilibria", heads, rows)


def _samples(shape) -> dict:
    return {"arc_length_m": shape.arc_length, "position_m": shape.position}


def _joints(name: str, option: str, joints):
    """The joints (N,) [m] or [rad] of an option. Raises InputError where one is far from usual, or beta is positive."""
    from ctcr.table.measurements import QUANTITIES

    for value in joints:
        if abs(value) > QUANTITIES[name].usual[1]:
            raise ArgumentError(Problem(QUANTITIES[name].doubt(value), field=option))
        if name == "beta" and value > 0:
            text = f"{1e3 * value:g} mm is in front of the plate: tubes are grasped behind it, at beta <= 0 mm"
            raise ArgumentError(Problem(text, field=option))
    return joints


def _listed(values, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)
