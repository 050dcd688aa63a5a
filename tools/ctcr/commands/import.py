"""`ctcr import`: a log of another program as a table of measurements."""

import shlex
from functools import partial

import click

from ctcr.commands import options

NAMED = 30  # unused columns whose names are shown


def _pairs(context, parameter, given: tuple[str, ...]) -> dict[str, str]:
    """NAME=VALUE, repeated."""
    found = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not value:
            raise click.BadParameter(f"{text}: write NAME=VALUE")
        found[name.strip()] = value
    return found


def _names(context, parameter, given: tuple[str, ...]) -> list[str]:
    """Names, repeated or separated by commas."""
    return [name.strip() for text in given for name in text.split(",") if name.strip()]


_pair_option = partial(options.repeated, callback=_pairs)
_list_option = partial(options.repeated, callback=_names)


@click.command(name="import")
@click.argument("log", type=options.read)
@options.output("TABLE.csv|.txt", "The table to write.", required=True)
@options.robot_option("Robot file: number of tubes, their lengths and homes.")
@options.reads("--joints", "LOG", "Another log with the joints, where LOG holds poses alone.", "joint_log")
@options.reads("--mapping", "FILE.yaml", "Answers kept by --save-mapping; options take precedence.")
@options.writes("--save-mapping", "FILE.yaml|.yml", "Keep the given and the guessed answers for the next log.")
@_pair_option("--column", "columns", "ROLE=NAME", "Column of a role, such as beta1, alpha1, x, qw, t; #3: the third.")
@click.option("--columns", "listed", metavar="ROLES", help="Roles of all columns in their order; - for none, m1..m16.")
@_list_option("--ignore", "ignore", "NAME", "A column that must not be used.")
@_pair_option(
    "--unit",
    "units",
    "ROLE=UNIT",
    "Unit of alpha1, alpha, beta, position, force, t or euler; 0.01mm: the size of a count.",
)
@_list_option("--missing", "missing", "WORD", "A further word or number for a missing value.")
@click.option(
    "--translation", metavar="KIND", help="beta (default), from-home or from-flush: travel outwards from there."
)
@click.option(
    "--home-mm", type=options.Numbers(), metavar="B1,B2,..", help="beta at home or at flush tips; else of ROBOT."
)
@click.option("--order", metavar="ORDER", help="Numbers of the tubes: innermost-first (default) or outermost-first.")
@_list_option("--flip", "flip", "NAME", "Change the sign of alpha2, alpha, beta or force.")
@_list_option("--unwrap", "unwrap", "NAME", "Take jumps of a whole turn out of alpha2 or alpha.")
@_pair_option("--offset", "offsets", "JOINT=VALUE", "Add to a joint or to t: alpha2=90deg; alpha2@7: in run 7.")
@_pair_option("--constant", "constants", "JOINT=VALUE", "A joint that never moves and is not logged: beta3=0mm.")
@click.option("--sensor", metavar="MARKER", help="Which of several markers is at the tip (a part of its name).")
@click.option("--relative-to", metavar="MARKER", help="Give the sensor's pose in the frame of this marker.")
@click.option("--quaternion", metavar="ORDER", help="Order of the four columns: wxyz (default) or xyzw.")
@click.option(
    "--invert-quaternion", is_flag=True, help="The log holds the inverse rotation; of 4 x 4 matrices, the inverse pose."
)
@click.option("--invert-pose", is_flag=True, help="The log holds the pose of the tracker in the frame of the sensor.")
@click.option(
    "--euler", metavar="AXES", help="Euler angles: ZYX is R = Rz Ry Rx; zyx, fixed axes; vector: a rotation vector."
)
@click.option("--mirror", metavar="AXIS", help="The tracker frame is left-handed: reverse this axis.")
@options.json
def command(log, target, robot, joint_log, mapping, save_mapping, listed, out, **said) -> None:
    """Turn a log into a table of measurements.

    LOG is text (any delimiter, decimal commas, header lines, units in names), a MATLAB .mat, an HDF5, numpy or JSON
    file, an export of NDI ToolBox or OptiTrack Motive, an MCAP file of ctcr export, or a table of measurements itself.
    What each column was taken for is shown, and every row without a pose or left out is named.

    Example: ctcr import log.csv -o measurements.csv --robot robot.yaml --translation from-flush --unit alpha=deg
    """
    from ctcr.intake import choices as intake_choices
    from ctcr.intake import summary
    from ctcr.intake.convert import convert
    from ctcr.intake.reading import read
    from ctcr.model import simulation
    from ctcr.robot import robot_file

    if listed:
        said["columns"] = intake_choices.in_order(listed) | said["columns"]
    choices = intake_choices.Choices(**said)
    choices = choices.over(intake_choices.load(mapping) if mapping else intake_choices.Choices())
    loaded = robot_file.load(robot) if robot else None
    found = convert(read(log), choices, loaded, read(joint_log) if joint_log else None)
    for source in found.sources:
        _show(out, source, summary.rows(source))
    out.say(*(f"Note: {note}" for note in found.notes), *(f"Doubt: {doubt}" for doubt in found.table.warnings))
    simulation.write(found.table, target)
    if save_mapping:
        intake_choices.save(summary.resolved(choices, found.sources), save_mapping)
    out.write_json(_as_data(found, [summary.rows(source) for source in found.sources]))
    runs, poses = len(set(found.table.run.tolist())), int(found.table.measured.sum())
    counts = f"{len(found.table)} rows, {poses} with a pose, {runs} run{'s' * (runs != 1)}, {found.table.n_tubes} tubes"
    out.say(f"{counts}: {target}")
    if save_mapping:
        way = shlex.join(["ctcr", "import", "LOG", "-o", "TABLE", "--mapping", save_mapping])
        out.say(f"The next log of this kind: {way}")


def _show(out, source, rows) -> None:
    """Shows the meaning that each column was given, before anything is written."""
    title = f"{source.log.path}: {source.log.kind}, {len(source.log)} rows"
    shown = [[row.column, row.unit, row.becomes, row.how] for row in rows]
    out.table(title, ["column", "unit", "becomes", "how"], shown, 4)
    if source.unused:
        out.say(f"Not used: {', '.join(source.unused[:NAMED])}{' ...' * (len(source.unused) > NAMED)}")


def _as_data(found, shown) -> dict:
    return {
        "rows": len(found.table),
        "with_pose": int(found.table.measured.sum()),
        "tubes": found.table.n_tubes,
        "logs": [
            {"file": str(source.log.path), "kind": source.log.kind, "columns": rows, "not_used": source.unused}
            for source, rows in zip(found.sources, shown, strict=True)
        ],
        "notes": found.notes,
        "doubts": [str(doubt) for doubt in found.table.warnings],
    }
