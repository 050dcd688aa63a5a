"""`ctcr info`: what a robot file says, and what looks wrong in it."""

import click

from ctcr.commands import options


@click.command(name="info")
@options.robot
@options.json
def command(robot: str, out) -> None:
    """Show the values of a robot file.

    Also shows the stiffnesses that follow from them, and says which values look wrong.

    Example: ctcr info robot.yaml
    """
    from ctcr.robot import robot_file
    from ctcr.show.wording import counted

    loaded = robot_file.load(robot)
    doubts = robot_file.warnings(loaded)
    out.write_json(_as_data(loaded, doubts))
    if out.json_target == "-":
        return
    out.console.print(f"{loaded.name}: {counted(loaded.n_tubes, 'tube')}, innermost first", style="bold")
    out.table("Tubes", *_tube_rows(loaded), 2)
    out.table("Sensor and frame", ["", "value", "unit"], _bench_rows(loaded))
    if doubts:
        out.console.print("What looks wrong", style="bold yellow")
        out.say(*(f"  {doubt}" for doubt in doubts))
    else:
        out.say("Nothing looks wrong.")


def _tube_rows(robot) -> tuple[list[str], list[list[str]]]:
    columns = ["", "unit", *(f"tube {i}" for i in range(1, robot.n_tubes + 1))]

    def row(name: str, unit: str, values: list[float | None], form: str = "{:g}") -> list[str]:
        return [name, unit, *("-" if value is None else form.format(value) for value in values)]

    def of(field: str) -> list[float | None]:
        return [getattr(tube, field) for tube in robot.tubes]

    rows = [
        row("inner diameter", "mm", of("inner_diameter_mm")),
        row("outer diameter", "mm", of("outer_diameter_mm")),
        row("length", "mm", of("length_mm")),
        row("curved length", "mm", of("curved_length_mm")),
        row("curvature", "1/m", of("curvature_per_m")),
        row("radius of curvature", "mm", [1e3 / abs(k) if k else None for k in of("curvature")], "{:.1f}"),
        row("Young's modulus", "GPa", of("youngs_modulus_GPa")),
        row("Poisson's ratio", "", of("poisson_ratio")),
        row("density", "kg/m^3", of("density_kg_m3")),
        row("bending stiffness EI", "N m^2", of("bending_stiffness"), "{:.4g}"),
        row("torsional stiffness GJ", "N m^2", of("torsional_stiffness"), "{:.4g}"),
        row("mass per length", "g/m", [1e3 * m or None for m in of("mass_per_length")], "{:.3g}"),
        row("strain when straightened", "%", [100 * e or None for e in of("straightened_strain")], "{:.2f}"),
    ]
    return columns, rows


def _bench_rows(robot) -> list[list[str]]:
    from ctcr.model import parameters

    def text(value) -> str:
        if value is None:
            return "not known"
        return ", ".join(f"{v:g}" for v in value) if isinstance(value, list) else f"{value:g}"

    tracker, actuation = robot.tracker, robot.actuation
    pose = {"position": tracker.sensor_position_mm, "rotation": tracker.sensor_rotation_vector_rad}
    sd = dict.fromkeys(pose, "")
    for name in parameters.of_sensor(robot)[::-1]:
        field, (_, width, _, _) = parameters.field_of(name), parameters.priors(robot, [name])
        kind = name.split(".")[1].removeprefix("sensor_")
        sd[kind] = "" if pose[kind] is None else f" ± {field.factor * width[0]:.3g} {field.unit}"
    return [
        ["gravity in the base frame", text(robot.gravity), "m/s^2"],
        ["sensor on tube", text(tracker.sensor_on_tube), ""],
        ["its position in the tip's frame", text(pose["position"]), "mm" + sd["position"]],
        ["its rotation vector there", text(pose["rotation"]), "rad" + sd["rotation"]],
        ["base frame in the tracker frame", text(tracker.position_mm), "mm"],
        ["its rotation vector", text(tracker.rotation_vector_rad), "rad"],
        ["readings", text(tracker.rate_Hz), "Hz"],
        ["jitter of one reading", f"{text(tracker.jitter_mm)}; {text(tracker.jitter_deg)}", "mm; deg"],
        ["accuracy (95 %)", f"{text(tracker.accuracy_95_mm)}; {text(tracker.accuracy_95_deg)}", "mm; deg"],
        ["translation of a motor turn", text(actuation.translation_mm_per_rev), "mm"],
        ["rotation of a motor turn", text(actuation.rotation_rev_per_rev), "turns"],
        ["home of the translations", text(actuation.home_translation_mm), "mm"],
        ["home of the rotations", text(actuation.home_rotation_deg), "deg"],
    ]


def _as_data(robot, doubts) -> dict:
    derived = {
        "bending_stiffness_N_m2": "bending_stiffness",
        "torsional_stiffness_N_m2": "torsional_stiffness",
        "mass_per_length_kg_per_m": "mass_per_length",
        "straightened_strain": "straightened_strain",
    }
    return {
        "robot": robot.model_dump(exclude_unset=True),
        "derived": [{key: getattr(tube, name) or None for key, name in derived.items()} for tube in robot.tubes],
        "looks_wrong": [{"field": doubt.field, "line": doubt.line, "message": doubt.message} for doubt in doubts],
    }
