"""Parameters fitted to poses: `ctcr.calibrate`, and the command `ctcr calibrate fit`."""

from collections.abc import Mapping, Sequence
from typing import Literal

from ctcr.api.reviewed import to_fit
from ctcr.arguments import checked
from ctcr.calibrate import joint_fit
from ctcr.calibrate.joint_fit import Calibration
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements


@checked
def calibrate(
    robot: Robot,
    table: Measurements,
    *,
    free: str | Sequence[str] = "standard",
    sd: Mapping[str, float] | None = None,
    hold_out: int | None = None,
    halves: bool = True,
    noise: Literal["auto", "jitter", "field"] = "auto",
    frame_per_run: bool | None = None,
    anyway: bool = False,
) -> Calibration:
    """Fits parameters of a robot to the poses of a table, all together (maximum a posteriori).

    free             names, such as "tubes.*.curvature"; "standard": the paper's
    sd               prior standard deviations by name, in the units of the robot file, before its `uncertainty`
    hold_out         runs held out to judge the fit; None: a quarter, each in turn; 0: none
    halves           whether the fits of two halves of the data are compared
    noise            "jitter", "field" (also the smooth error of the tracker), "auto": the one that the data support
    frame_per_run    whether each run has a tracker frame of its own; None: where the readings support it
    anyway           whether to go on where a convention is wrong
    Raises InputError, and WrongConventions unless `anyway`.
    """
    readings, said, _ = to_fit(robot, table, anyway=anyway, frame_per_run=frame_per_run)
    found = joint_fit.calibrate(robot, readings, free, hold_out=hold_out, halves=halves, noise=noise, sd=sd)
    found.notices[:0] = said
    return found
