"""Which physical effect is missing: `ctcr.diagnose`, and the command of that name."""

from collections.abc import Callable

from ctcr.api.reviewed import to_fit
from ctcr.arguments import checked
from ctcr.diagnose import pipeline
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@checked
def diagnose(
    robot: Robot,
    table: Measurements,
    *,
    frame_per_run: bool | None = None,
    anyway: bool = False,
    threads: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Fits every effect of the catalogue together with the calibration, and judges what is missing on held-out runs.

    frame_per_run    whether each run has a tracker frame of its own; None: where the readings support it
    anyway           whether to go on where a convention is wrong
    threads          0: one per core
    progress         called with each step, in words
    Raises InputError, and WrongConventions unless `anyway`.
    """
    progress("conventions and runs")
    readings, said, found = to_fit(robot, table, anyway=anyway, frame_per_run=frame_per_run)
    result = pipeline.diagnose(robot, readings, progress=progress, threads=threads)
    result.verdict.sentences.extend(said)
    result.conventions = found.findings
    return result
