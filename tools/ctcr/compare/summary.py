"""What a comparison found, in plain words: findings with numbers and units.

Findings describe the error. They name what kind of cause would look like it, never which one it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ctcr.compare.analysis import LEVEL, Comparison
from ctcr.compare.dependence import Dependence
from ctcr.compare.noise import NOTABLE, DirectionDifference
from ctcr.show.wording import join, mm, most, percent, probability

MOST = 6
CLEAR_DELAY = 0.2  # share of the squared out/return difference that a delay must explain to be mentioned

LOOKS_LIKE = {
    "frame_turn": "A tracker frame registered with a small turn looks like this.",
    "tip_offset": "A sensor that sits elsewhere than modelled, or a wrong precurvature of its tube, looks like this.",
    "motion_offset": "Friction, play and delay look like this.",
    "lag": "Poses logged later than the joints, or a tip that follows late, look like this.",
    "alpha": "A wrong angle offset, precurvature or stiffness ratio looks like this.",
    "length": "A wrong length, curved length, stiffness or insertion scale looks like this.",
    "direction": "Friction and play look like this.",
    "speed": "A delay or friction that grows with speed looks like this.",
    "tip_speed": "A delay or friction that grows with speed looks like this.",
    "force": "A wrong stiffness, or something compliant that the model takes as rigid, looks like this.",
    "place": "A turned tracker frame, a distorted tracker field or wrong precurvatures look like this.",
    "screw": "A periodic error of a drive screw looks like this.",
    "time": "Drift, creep or temperature look like this.",
    "order": "Drift, creep or temperature look like this.",
}


@dataclass(frozen=True)
class Finding:
    """One sentence or two; share of the squared error it concerns."""

    text: str
    share: float


def headline(c: Comparison) -> str:
    """The size of the error in one sentence."""
    p, length, noise = c.position_mm, c.percent_of_length, c.noise
    text = (
        f"The model is wrong by {mm(p.rms)} RMS (mean {mm(p.mean)}, 95 % below {mm(p.p95)}, at most "
        f"{mm(p.maximum)}) or {length.rms:.2g} % of the deployed length, over {p.count} readings. "
    )
    if is_noise(c):
        return text + f"That is what noise of {mm(noise.rms_mm)} RMS gives: there is nothing to explain."
    if not np.isfinite(noise.rms_mm):
        return text + "The noise of a reading is not known."
    size, left = f"{mm(noise.rms_mm)} RMS ({_source(c)})", most(1 - c.noise_share)
    if beyond_stated(c):
        stated = mm(noise.stated_axis_mm * 3**0.5)
        return text + (
            f"The tracker's stated scatter is {stated} RMS, but readings repeat only to {size}; {left} of the squared "
            f"error is beyond even that."
        )
    return text + f"Noise is {size}, so {left} of the squared error is not noise."


def beyond_stated(c: Comparison) -> bool:
    """Whether readings repeat far worse than the tracker's stated jitter."""
    return c.noise.source == "revisits" and bool(c.noise.axis_mm > NOTABLE * c.noise.stated_axis_mm)


def is_noise(c: Comparison) -> bool:
    """Whether the error is no larger than the noise floor allows, within twice its uncertainty."""
    relative = np.nan_to_num(c.noise.uncertainty_mm / c.noise.axis_mm) if c.noise.axis_mm > 0 else 0.0
    slack = 2 * np.hypot(relative, 1 / np.sqrt(6 * c.position_mm.count))
    return bool(c.position_mm.rms <= c.noise.rms_mm * (1 + slack)) and not list(_all(c))


def findings(c: Comparison) -> list[Finding]:
    """The strongest findings, those concerning most of the squared error first."""
    return sorted(_all(c), key=lambda item: -item.share)[:MOST]


def quiet(c: Comparison) -> list[str]:
    """Questions that the data answer with no, and hints too weak to be findings."""
    said = []
    d = c.direction
    if d and not differs(d):
        like = (
            f"as same-direction visits do ({mm(d.same_rms_mm)})"
            if np.isfinite(d.p_against_same)
            else f"no more than noise ({mm(d.quiet_rms_mm)})"
        )
        text = (
            f"Out and return agree: visits of the same joints from opposite directions typically lie "
            f"{mm(d.typical_rms_mm)} RMS apart ({d.pairs} pairs), {like}."
        )
        if d.outliers:
            text += f" Pairs far beyond that: {d.outliers}, at most {mm(d.maximum_mm)} apart. Outliers look like this."
        said.append(text)
    if c.shift and c.shift.p_value > LEVEL:
        said.append(
            f"No constant offset stands out (mean error {mm(c.shift.size_mm)}, p = {probability(c.shift.p_value)})."
        )
    if c.ranking.alone and not c.ranking.chosen and not is_noise(c):
        best = c.ranking.alone[0]
        said.append(
            f"No single quantity predicts the error well on {c.ranking.block_kind} left out. The strongest hint is the "
            f"{best.label}: {percent(best.share)} of the squared error, which chance reaches in "
            f"{100 * best.p_value:.2g} % of cases."
        )
    return said


def _all(c: Comparison) -> Iterator[Finding]:
    if c.turn and c.turn.gross:
        axis = ", ".join(f"{value:+.2f}" for value in c.turn.axis)
        yield Finding(
            f"The tracker frame in the robot file is grossly wrong: turned by {c.turn.turn_deg:.0f} degrees about "
            f"({axis}) and shifted, it leaves {mm(c.turn.rms_after_mm)} RMS instead of {mm(c.turn.rms_before_mm)} "
            f"(held out). Everything below is computed in the frame that fits.",
            1.0,
        )
    elif c.shift and c.shift.p_value <= LEVEL and c.shift.share > 0:
        x, y, z = c.shift.vector_mm
        yield Finding(
            f"A constant offset of {mm(c.shift.size_mm)} (x {x:+.2f}, y {y:+.2f}, z {z:+.2f} mm in the tracker "
            f"frame) explains {percent(c.shift.share)} of the squared error. A tracker frame registered with a "
            f"shift looks like this.",
            c.shift.share,
        )
    if c.run_offsets.found:
        yield Finding(_run_text(c), c.run_offsets.share)
    if c.direction and differs(c.direction):
        yield Finding(_direction_text(c), (c.direction.floor_mm / c.position_mm.rms) ** 2)
    before = 1.0 - (c.shift.share if c.shift and c.shift.p_value <= LEVEL else 0.0)
    for item in c.ranking.chosen:
        yield Finding(_dependence_text(item, c), item.share * before)


def _run_text(c: Comparison) -> str:
    r = c.run_offsets
    text = "The runs do not share one frame or homing: "
    if r.p_value <= LEVEL:
        text += (
            f"the same joints give positions {mm(r.rms_between_mm)} RMS apart in different runs, but "
            f"{mm(r.rms_within_mm)} inside one run. "
        )
    if r.outlying:
        names = ", ".join(map(str, r.outlying[:8])) + (" and others" if len(r.outlying) > 8 else "")
        text += f"runs {names} lie about {mm(r.outlying_mm)} from the others. "
    return text + (
        f"One offset for each run explains {percent(r.share)} of the squared error about its mean; the "
        f"dependences are examined with it removed."
    )


def _direction_text(c: Comparison) -> str:
    d = c.direction
    text = (
        f"Out and return differ by {mm(d.rms_mm)} RMS (at most {mm(d.maximum_mm)}) at the same joints, over "
        f"{d.pairs} pairs: no model without history or delay can be better than {mm(d.floor_mm)} RMS there."
    )
    if np.isfinite(d.p_against_same) and d.p_against_same > LEVEL:
        return (
            f"The same joints do not give the same pose again: visits from opposite directions differ by "
            f"{mm(d.rms_mm)} RMS ({d.pairs} pairs), visits from the same direction by {mm(d.same_rms_mm)} "
            f"({c.noise.pairs} pairs), where the tracker's scatter gives {mm(d.quiet_rms_mm)}. No model without "
            f"history can be better than about {mm(d.floor_mm)} RMS there. Friction, play, drift and creep look "
            f"like this."
        )
    if c.has_speed and clear_delay(c):
        text += (
            f" {percent(1 - (d.rms_without_delay_mm / d.rms_mm) ** 2)} of this squared difference is what a delay of "
            f"{d.delay_s:.3f} ± {d.delay_uncertainty_s:.3f} s between joints and poses would do; with it taken out, "
            f"{mm(d.rms_without_delay_mm)} RMS remain, a floor of {mm(d.rms_without_delay_mm / 2)}."
        )
        return text
    return text + " Friction, play and delay look like this."


def differs(d: DirectionDifference) -> bool:
    """Whether the pose at the same joints depends on how they were reached."""
    return bool(d.p_against_same <= LEVEL / 2 or d.p_against_quiet <= LEVEL / 2)


def clear_delay(c: Comparison) -> bool:
    """Whether a delay accounts for a good part of the difference between out and return."""
    d = c.direction
    return bool(
        d
        and np.isfinite(d.delay_s)
        and abs(d.delay_s) > 3 * d.delay_uncertainty_s
        and 1 - (d.rms_without_delay_mm / d.rms_mm) ** 2 > CLEAR_DELAY
    )


def _dependence_text(item: Dependence, c: Comparison) -> str:
    first = item is c.ranking.chosen[0]
    where = f", mostly {_axis(item)}" if item.component else ""
    verb, name = "depends on" if item.form.covariate else "follows", item.label.removeprefix("a ")
    text = f"The error {verb} the {name}"
    text += (
        f": {mm(item.size_mm)} RMS{where}, {percent(item.share)} of the squared error about its offset on "
        f"{c.ranking.block_kind} left out" + (". " if first else ", beyond what is said of stronger ones. ")
    )
    if item.indistinct:
        names = [name.removeprefix("a ") for name in item.indistinct[:3]]
        text += f"These data cannot tell it from the {join(names)}. "
    key = next((name for name in (item.name, *LOOKS_LIKE) if item.name.startswith(name) and name in LOOKS_LIKE), "")
    return (text + LOOKS_LIKE.get(key, "")).strip()


def _axis(item: Dependence) -> str:
    if item.form.frame == "base":
        return f"along {item.component} of the base frame"
    return f"along {item.component}" if item.component.startswith("tip") else item.component


def _source(c: Comparison) -> str:
    n = c.noise
    if n.source == "revisits":
        return f"{n.pairs} revisits from the same direction, ± {n.uncertainty_mm * np.sqrt(3):.2g} mm"
    return "scatter at rest" if n.source == "rest" else "as stated"
