"""What cannot be said with the data of a comparison."""

from collections.abc import Iterator

import numpy as np

from ctcr.compare.analysis import Comparison
from ctcr.compare.summary import is_noise
from ctcr.show.wording import join, mm


def limits(c: Comparison) -> list[str]:
    """What cannot be said with these data."""
    return [*_noise_limits(c), *_design_limits(c), *_separation_limits(c)]


def _noise_limits(c: Comparison) -> Iterator[str]:
    n = c.noise
    if n.source == "rest":
        yield (
            f"No joints were visited twice from the same direction: the noise ({n.axis_mm:.3f} mm per axis) is the "
            f"scatter at rest. It misses repeatability, drift and the tracker's field error."
        )
    elif n.source == "stated":
        yield (
            "Too few joints were visited twice from the same direction, and too few readings were taken at rest: the "
            "noise is the jitter stated in the robot file. It misses repeatability, drift and the field error."
        )
    if np.isfinite(c.accuracy_95_mm) and c.accuracy_95_mm > 0:
        yield (
            f"The noise floor does not hold the tracker's own field error (stated: 95 % below "
            f"{mm(c.accuracy_95_mm)}), which is the same at every visit of a place."
        )
    if c.direction is None:
        yield "No joints were visited from opposite directions: friction, play and delay cannot be told from the rest."


def _design_limits(c: Comparison) -> Iterator[str]:
    if len(c.runs) == 1:
        yield "There is one run: whether what is found holds in another run is not tested."
    if c.fixed:
        yield f"Never varied here, so nothing is known of them: {join(c.fixed)}."
    if not c.has_time:
        yield "There are no times: speeds, delay and drift cannot be examined."
    elif not c.has_speed:
        yield "The readings are far apart in time (stops): a delay cannot be seen."
    if c.angle_deg is None:
        yield "No orientation was measured."
    elif c.angle_kind != "orientation":
        yield "The sensor's roll is unknown: only the direction of the tip is compared, not its roll."
    if not c.ranking.alone:
        yield (
            f"The readings fall into {c.ranking.blocks} independent parts ({c.ranking.block_kind}), too few to judge "
            f"a constant offset or what the error depends on."
        )
    if len(c.ranking.rows) < len(c.sample.row):
        yield f"The dependences were examined on {len(c.ranking.rows)} of {len(c.sample.row)} readings, evenly spread."


def _separation_limits(c: Comparison) -> Iterator[str]:
    r = c.run_offsets
    if len(c.runs) > 1 and not np.isfinite(r.p_value) and not r.found and not is_noise(c):
        yield (
            "No joints were visited in two runs: an offset that belongs to a run (frame, homing, drift) cannot be told "
            "from an error that belongs to the joints of that run."
        )
