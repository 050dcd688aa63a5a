"""The unit of time, from how fast joints would move."""

from dataclasses import replace

import numpy as np

from ctcr import settings
from ctcr.conventions.finding import Finding
from ctcr.conventions.hypotheses import Change
from ctcr.table.measurements import Measurements

UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}


def wrong_unit(readings: Measurements, rms_mm: float) -> tuple[Finding, Change] | None:
    """The unit in which joints move as those of robots do, where in seconds they would not.

    Speeds of joints are log-normal about a usual one; the odds of two units follow.
    """
    step = np.linalg.norm(np.diff(readings.joint_space, axis=0), axis=1)
    pause = np.diff(readings.t)
    moves = (np.diff(readings.run) == 0) & (step > 0) & (pause > 0)
    if not moves.any():
        return None
    speed = float(np.median(step[moves] / pause[moves]))

    def unlikely(factor: float) -> float:
        return 0.5 * (np.log(speed / factor / settings.JOINT_SPEED) / np.log(settings.JOINT_SPEED_FACTOR)) ** 2

    unit = min(UNITS, key=lambda name: unlikely(UNITS[name]))
    factor = UNITS[unit]
    if unlikely(1.0) - unlikely(factor) < settings.CONVENTION_ODDS:
        return None
    text = f"times are in {unit}, not in s: joints would move at {speed:.1g} rad/s, and so move at {speed / factor:.1g}"
    found = Finding("time_unit", text, ("t_s",), f"ctcr import --unit t={unit}", rms_mm=(rms_mm, rms_mm))

    def change(m: Measurements) -> Measurements:
        return replace(m, t=m.t * factor)

    return found, change
