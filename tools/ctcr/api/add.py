"""Effects added to a robot, fitted to measurements: `ctcr.add`, and the command `ctcr add --fit`."""

from collections.abc import Mapping, Sequence

from ctcr.api.reviewed import to_fit
from ctcr.arguments import checked
from ctcr.diagnose import add as effects_added
from ctcr.diagnose.add import Added
from ctcr.diagnose.pipeline import Diagnosis
from ctcr.effects import catalogue
from ctcr.effects.settings import found, named
from ctcr.errors import InputError, Problem
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements, check_of


@checked
def add(
    robot: Robot,
    effects: Diagnosis | str | Sequence[str],
    table: Measurements,
    *,
    fixed: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    free: str | Sequence[str] = "standard",
    frame_per_run: bool | None = None,
    anyway: bool = False,
) -> Added:
    """Fits effects together with the calibration; the robot with them is `.robot`.

    effects          what a diagnosis found, or ids, such as "friction"
    fixed            parameters that keep a value, SI, by name as of `ctcr add --set`: {"friction.coefficient.1": 0.02}
    start            parameters that begin at a value, likewise
    free             other parameters that are fitted too; "standard": the paper's
    frame_per_run    whether each run has a tracker frame of its own; None: where the readings support it
    anyway           whether to go on where a convention is wrong
    Raises InputError, and WrongConventions unless `anyway`.
    """
    check_of(robot, table)
    held: Mapping[str, float] = {}
    values: Mapping[str, float] = {}
    if isinstance(effects, Diagnosis):
        ids, held, values = found(effects.as_dict(), robot)
    else:
        names = [effects] if isinstance(effects, str) else effects
        ids = list(dict.fromkeys(catalogue.get(name, robot.n_tubes).id for name in names))
    if not ids:
        raise InputError(Problem("nothing was found to add" if isinstance(effects, Diagnosis) else "name an effect"))
    fixed, start = ({**of, **named(given or {}, robot, ids)} for of, given in ((held, fixed), (values, start)))
    readings, said, _ = to_fit(robot, table, anyway=anyway, frame_per_run=frame_per_run)
    added = effects_added.add(robot, readings, ids, fixed=fixed, start=start, free=free)
    added.notices[:0] = said
    return added
