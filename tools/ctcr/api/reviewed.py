"""Robot and table before any comparison or fit: the conventions they follow, and what a fit leaves out of the table."""

from collections.abc import Container
from dataclasses import replace

import numpy as np

from ctcr.arrays import Array
from ctcr.audit import copies, spikes
from ctcr.conventions import Finding, Review, review
from ctcr.diagnose import sessions
from ctcr.errors import InputError, Problem
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.show.wording import listed, sentence
from ctcr.table.measurements import Measurements, check_of

LOOK_FIRST = "look at the robot file first: the following may result from it"  # where values in it look wrong


class WrongConventions(InputError):
    """A table or a robot file that follows other conventions than the format says; `review` holds them."""

    def __init__(self, robot: Robot, found: Review, wrong: list[Finding], table: Measurements):
        doubts, said = robot_file.warnings(robot), [Problem(one.sentence, table.source) for one in wrong]
        first = [*doubts, Problem(LOOK_FIRST)] if doubts else []
        advice = "a fit would take that for physics: correct it first, or go on with --anyway (anyway=True)"
        super().__init__([*first, *table.warnings, *said, Problem(advice)])
        self.review = found


def reviewed(robot: Robot, table: Measurements) -> Review:
    """The review of the conventions. Raises InputError where none makes the table one of this robot."""
    check_of(robot, table)
    found = review(robot, table)
    if table.refusal and not found.findings:
        raise table.refusal
    return replace(found, readings=replace(found.readings, refusal=None))


def without_false_poses(
    robot: Robot, table: Measurements, found: Review, predicted: Array | None = None
) -> tuple[Measurements, list[str]]:
    """The readings without poses that the tracker repeated and without its spikes, and sentences on that.

    predicted    tips (M, 3) [m] of all rows by the standard model, base frame, where they are known already
    """
    rows = [row for one in found.frozen for row in one.rows]
    said = [sentence(f"{one.text}: left out") for one in found.frozen]
    table, leaps = spikes.left_out(robot, table.without_poses(np.isin(table.row, rows)) if rows else table, predicted)
    return table, [*said, *map(sentence, leaps)]


def without_pose(table: Measurements) -> list[str]:
    """A sentence on the rows of a table in which nothing was measured."""
    rows = table.row[~table.measured]
    if not len(rows) or len(rows) == len(table):
        return []
    count = "1 row holds" if len(rows) == 1 else f"{len(rows)} rows hold"
    return [f"{count} no pose ({listed(rows.tolist())}): the robot moves through them, and nothing is fitted there."]


def to_fit(
    robot: Robot,
    table: Measurements,
    *,
    anyway: bool = False,
    frame_per_run: bool | None = None,
    finds: Container[str] = (),
) -> tuple[Measurements, list[str], Review]:
    """The readings as a fit takes them, sentences on their table and on what was left out, and the review of the
    conventions.

    Left out are copies of rows, poses that the tracker repeated, spikes, and where the runs are sessions, what each has
    of its own.
    frame_per_run    whether each run has a frame of its own; None: where the readings support it
    finds            kinds of wrong conventions that the fit itself corrects
    Raises WrongConventions where a convention is wrong, unless `anyway`.
    """
    check_of(robot, table)
    table, copied = copies.left_out(table)
    found = reviewed(robot, table)
    wrong = [one for one in found.wrong if one.kind not in finds]
    if wrong and not anyway:
        raise WrongConventions(robot, found, wrong, table)
    if table.refusal:
        raise table.refusal
    readings, said = without_false_poses(robot, table, found)
    said = [*filter(None, [found.unexplained]), *said, *without_pose(table)]
    readings, more = sessions.of_runs(robot, readings, frame_per_run)
    return readings, [*table.doubts, *map(sentence, copied), *said, *more], found
