"""The commands that follow a diagnosis, to be copied: with its files, and those of the user's own effects."""

from ctcr.diagnose.pipeline import Diagnosis
from ctcr.effects.user_effects import command


def to_add(d: Diagnosis, answer: str | None = None) -> str:
    """Adds the effects that were found; `answer`: the file of its JSON, which holds their values, if it was written."""
    found = ["--diagnosis", answer] if answer else [a.id for a in d.accepted]
    robot, table = _files(d)
    return command("add", robot, *found, "--fit", table, "-o", "new.yaml", *_anyway(d))


def to_plan(d: Diagnosis) -> str:
    """Proposes the runs that decide what is open."""
    return command("next", *_files(d), *_anyway(d))


def _files(d: Diagnosis) -> tuple[str, str]:
    return d.robot.file or "ROBOT", d.measurements.file or "MEASUREMENTS"


def _anyway(d: Diagnosis) -> list[str]:
    """The option with which the diagnosis went past wrong conventions."""
    return ["--anyway"] if any(one.is_wrong for one in d.conventions) else []
