"""A comparison in sentences: the size of the error, findings with numbers and units, and the limits of the data.

Findings describe the error and name possible causes, never the cause.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ctcr import settings
from ctcr.compare.analysis import Comparison
from ctcr.compare.covariates import fixed_names, has_speed
from ctcr.compare.dependence import Dependence
from ctcr.compare.noise import DirectionDifference
from ctcr.compare.sample import Sample
from ctcr.show.wording import counted, join, listed, mm, most, percent, probability

MOST = 6
_MOTIONS = ("rotating only", "translating only", "doing both")  # in the order of DirectionDifference.moved

CAUSES = {  # by how the name of a dependence begins
    "frame_turn": "a small rotation error of the registered tracker frame",
    "tip_offset": "a sensor mounted elsewhere than modelled, or a wrong precurvature of its tube",
    "motion_offset": "friction, play or delay",
    "lag": "poses logged later than the joints, or a tip that follows late",
    "alpha": "a wrong angle offset, precurvature or stiffness ratio",
    "length": "a wrong length, curved length, stiffness or insertion scale",
    "direction": "friction or play",
    ("speed", "tip_speed"): "a delay, or friction that grows with speed",
    "force": "a wrong stiffness, or compliance that the model takes as rigid",
    "place": "a rotated tracker frame, a distorted tracker field or wrong precurvatures",
    "screw": "a periodic error of a drive screw",
    ("time", "order"): "drift, creep or temperature",
}


@dataclass(frozen=True)
class Finding:
    """One sentence or two; the fraction of the squared error that they concern."""

    text: str
    share: float


def headline(c: Comparison) -> str:
    """The size of the error in one sentence, and how much of it is noise in another."""
    p, length, noise = c.position_mm, c.percent_of_length, c.noise
    text = "".join(f"{said} " for said in c.sample.unsolved) + (
        f"The model is wrong by {mm(p.rms)} RMS (mean {mm(p.mean)}, 95 % below {mm(p.p95)}, at most {mm(p.maximum)}) "
        f"or {percent(length.rms / 100)} of the deployed length, over {counted(p.count, 'reading')}. "
    )
    if is_noise(c):
        return text + f"Readings repeat only to {mm(noise.rms_mm)} RMS: there is nothing to explain."
    if not np.isfinite(noise.rms_mm):
        return text + "The sensor jitter is not known."
    source = "at rest" if noise.source == "rest" else "sensor jitter as stated"
    if noise.source == "revisits":
        source = f"{noise.pairs} revisits from the same direction, ± {noise.uncertainty_mm * np.sqrt(3):.2g} mm"
    size, by_noise = f"{mm(noise.rms_mm)} RMS ({source})", (noise.rms_mm / p.rms) ** 2 if p.rms else 1.0
    left = most(1 - min(1.0, by_noise))
    if noise.source == "revisits" and noise.axis_mm > settings.NOTABLE * noise.stated_axis_mm:
        stated = mm(noise.stated_axis_mm * 3**0.5)
        return text + (
            f"The sensor jitter as stated is {stated} RMS, but readings repeat only to {size}; {left} of the squared "
            f"error exceeds even that."
        )
    return text + f"Readings repeat to {size}, so {left} of the squared error is not their scatter."


def is_noise(c: Comparison) -> bool:
    """Whether the error is no larger than the scatter of a reading allows, within twice its uncertainty."""
    relative = np.nan_to_num(c.noise.uncertainty_mm / c.noise.axis_mm) if c.noise.axis_mm > 0 else 0.0
    slack = 2 * np.hypot(relative, 1 / np.sqrt(6 * c.position_mm.count))
    return bool(c.position_mm.rms <= c.noise.rms_mm * (1 + slack)) and not list(_all(c))


def findings(c: Comparison) -> list[Finding]:
    """The strongest findings, those concerning most of the squared error first."""
    return sorted(_all(c), key=lambda item: -item.share)[:MOST]


def held_out(c: Comparison) -> str:
    """The blocks on which dependences are judged."""
    return "held-out runs" if c.ranking.block_kind == "runs" else "held-out regions of joint space"


def _all(c: Comparison) -> Iterator[Finding]:
    if c.sessions:
        text = " ".join([*c.sessions, *_same_joints_text(c)])
        yield Finding(f"{text} All that follows is computed with a frame for each run.", 1.0)
    if c.snapped:
        yield _snaps(c)
    shifted = c.shift if c.shift and c.shift.p_value <= settings.LEVEL else None
    if c.turn and c.turn.gross:
        axis = ", ".join(f"{value:+.2f}" for value in c.turn.axis)
        yield Finding(
            f"Another tracker frame, rotated by {c.turn.turn_deg:.0f} degrees about ({axis}) and shifted, leaves "
            f"{mm(c.turn.rms_after_mm)} RMS instead of {mm(c.turn.rms_before_mm)} (held out). The frame in the robot "
            f"file is wrong, or homes and tubes are, which turn the tip too. All that follows is in the fitted frame.",
            1.0,
        )
    elif shifted and shifted.share > 0:
        x, y, z = shifted.vector_mm
        yield Finding(
            f"A constant offset of {mm(shifted.size_mm)} (x {x:+.2f}, y {y:+.2f}, z {z:+.2f} mm in the tracker frame) "
            f"explains {percent(shifted.share)} of the squared error. Possible cause: a shift of the registered "
            f"tracker frame.",
            shifted.share,
        )
    if c.run_offsets.found and not c.sessions and not c.wrong:
        yield Finding(_run_text(c), c.run_offsets.share)
    if c.direction and differs(c.direction):
        yield Finding(_hysteresis_text(c, c.direction), (c.direction.floor_mm / c.position_mm.rms) ** 2)
    before = 1.0 - (shifted.share if shifted else 0.0)
    for item in c.ranking.chosen:
        yield Finding(_dependence_text(item, c), item.share * before)


def _snaps(c: Comparison) -> Finding:
    """Readings of a robot that rests elsewhere than predicted: no friction, though it depends on the way there too."""
    square = np.sum(c.headline.error**2, axis=1)
    share = float(np.sum(square[np.isin(c.headline.row, c.snapped)]) / np.sum(square))
    subject, verb = counted(len(c.snapped), "reading"), "lies" if len(c.snapped) == 1 else "lie"
    return Finding(
        f"{subject} ({listed(c.snapped)}) {verb} at another stable equilibrium of the robot than the one predicted: "
        f"it snapped. This makes {percent(share)} of the squared error, and hysteresis where the way there decides.",
        share,
    )


def _same_joints_text(c: Comparison) -> list[str]:
    """Whether frames differ between runs, or the robot; none without joints that two runs share."""
    pairs = c.same_joints
    if not pairs:
        return []
    apart, moved = (float(np.median([getattr(pair, name) for pair in pairs])) for name in ("apart_mm", "moved_mm"))
    scatter = f" ({mm(c.noise.rms_mm)} RMS)" if np.isfinite(c.noise.rms_mm) else ""
    return [
        f"At the same joints, two runs lie {mm(apart)} RMS apart, and {mm(moved)} after the rigid motion that brings "
        f"them closest (median of {counted(len(pairs), 'pair')} of runs). The motion takes away what frames differ; "
        f"what remains beyond the scatter of a reading{scatter} is a robot that changed."
    ]


def _run_text(c: Comparison) -> str:
    r = c.run_offsets
    text = "The runs do not share one frame or homing. "
    if r.p_value <= settings.LEVEL:
        within = f"{mm(r.rms_within_mm)} inside one run"
        if r.pairs_within < settings.FEWEST_PAIRS:
            within = f"noise gives {mm(r.noise_mm)}"
        text += (
            f"The same joints give positions {mm(r.rms_between_mm)} RMS apart in different runs "
            f"({counted(r.pairs_between, 'pair')}), but {within}. "
        )
    if r.outlying:
        text += f"{_runs(r.outlying)} about {mm(r.outlying_mm)} from the others. "
    if r.outlying and r.elsewhere:
        text += (
            f"{_runs(r.elsewhere)} far from them too, but at joints that no other run came near: these may be the "
            f"cause. "
        )
    text += "".join(f"{said} " for said in _same_joints_text(c))
    return text + (
        f"One offset for each run explains {percent(r.share)} of the squared error about its mean; dependences are "
        f"examined without it."
    )


def _runs(names: Sequence[int]) -> str:
    """The subject and the verb of a sentence on where they lie."""
    return f"Run {names[0]} lies" if len(names) == 1 else f"The runs {listed(names, 8)} lie"


def _hysteresis_text(c: Comparison, d: DirectionDifference) -> str:
    if np.isfinite(d.p_against_same) and d.p_against_same > settings.LEVEL:
        return (
            f"The same joints do not give the same pose again: visits from opposite directions differ by "
            f"{mm(d.rms_mm)} RMS ({counted(d.pairs, 'pair')}), visits from the same direction by {mm(d.same_rms_mm)} "
            f"({counted(c.noise.pairs, 'pair')}), where the tracker's scatter gives {mm(d.quiet_rms_mm)}. No model "
            f"without history can be better than about {mm(d.floor_mm)} RMS there. Possible causes: friction, play, "
            f"drift or creep."
        )
    text = (
        f"There is hysteresis: visits of the same joints from opposite directions differ by {mm(d.rms_mm)} RMS (at "
        f"most {mm(d.maximum_mm)}), over {coverage(d)}. No model without history or delay can be better than "
        f"{mm(d.floor_mm)} RMS there."
    )
    share = 1 - (d.rms_without_delay_mm / d.rms_mm) ** 2
    if has_speed(c.sample) and abs(d.delay_s) > 3 * d.delay_uncertainty_s and share > settings.CLEAR_DELAY:
        return text + (
            f" A delay of {d.delay_s:.3f} ± {d.delay_uncertainty_s:.3f} s between joints and poses explains "
            f"{percent(share)} of this squared difference; without it {mm(d.rms_without_delay_mm)} RMS remain, a floor "
            f"of {mm(d.rms_without_delay_mm / 2)}."
        )
    return text + f" Possible causes: {'snapping, ' if c.snapped else ''}friction, play or delay."


def coverage(d: DirectionDifference) -> str:
    """How many pairs there are, and what moved in them: friction between tubes shows in rotation alone, say."""
    counts = [(n, f"while {how}") for n, how in zip(d.moved.values(), _MOTIONS, strict=True)]
    said = [f"{n or 'none'} {text}" for n, text in counts]
    return f"{counted(d.pairs, 'pair')}: {join(said)}"


def differs(d: DirectionDifference) -> bool:
    """Whether the pose at the same joints depends on how they were reached."""
    return any(p <= settings.LEVEL / 2 for p in (d.p_against_same, d.p_against_quiet))


def too_few(d: DirectionDifference) -> bool:
    """Whether the pairs are too few to tell: more than a quarter lie far apart, which the tests allow by chance."""
    return not differs(d) and (d.pairs < settings.FEWEST_PAIRS or d.outliers > d.pairs / 4)


def _dependence_text(item: Dependence, c: Comparison) -> str:
    where = item.component
    if where and not where.startswith(("along", "across", "outwards", "around")):
        where = f"along {where}" + (" of the base frame" if item.form.frame == "base" else "")
    verb, name = "depends on" if item.form.covariate else "follows", item.label.removeprefix("a ")
    text = (
        f"The error {verb} the {name}: {mm(item.size_mm)} RMS{f', mostly {where}' if where else ''}, "
        f"{percent(item.share)} of the squared error about its offset on {held_out(c)}"
        + (". " if item is c.ranking.chosen[0] else ", in addition to the stronger dependences. ")
    )
    if item.indistinct:
        names = [name.removeprefix("a ") for name in item.indistinct[:3]]
        text += f"These data do not distinguish it from the {join(names)}. "
    cause = next((cause for starts, cause in CAUSES.items() if item.name.startswith(starts)), "")
    return (text + (f"Possible cause: {cause}." if cause else "")).strip()


def quiet(c: Comparison) -> list[str]:
    """Questions that the data answer with no, and hints too weak to be findings."""
    found = []
    d = c.direction
    if d and not differs(d) and not too_few(d):
        like = f"no more than noise ({mm(d.quiet_rms_mm)})"
        if np.isfinite(d.p_against_same):
            like = f"like visits from the same direction ({mm(d.same_rms_mm)})"
        text = (
            f"There is no hysteresis: visits of the same joints from opposite directions typically lie "
            f"{mm(d.typical_rms_mm)} RMS apart ({coverage(d)}), {like}."
        )
        if d.outliers:
            text += f" Pairs far beyond that: {d.outliers}, at most {mm(d.maximum_mm)} apart. Possible cause: outliers."
        found.append(text)
    if c.shift and c.shift.p_value > settings.LEVEL and not c.sessions:
        size, p = mm(c.shift.size_mm), probability(c.shift.p_value)
        found.append(f"There is no significant constant offset (mean error {size}, p = {p}).")
    if c.ranking.alone and not c.ranking.chosen and not is_noise(c):
        best, text = c.ranking.alone[0], f"No single quantity predicts the error well on {held_out(c)}."
        if best.share >= settings.LEAST_DEPENDENCE:
            text += (
                f" The strongest hint is the {best.label}: {percent(best.share)} of the squared error, which chance "
                f"reaches in {percent(best.p_value)} of cases."
            )
        found.append(text)
    return found


def limits(c: Comparison) -> Iterator[str]:
    """Questions that these data cannot answer."""
    n, r, d = c.noise, c.run_offsets, c.direction
    if n.source == "rest":
        yield (
            f"Too few joints were visited twice from the same direction in one run: the scatter of a reading "
            f"({n.axis_mm:.3f} mm per axis) is that at rest. It misses repeatability, drift and field error."
        )
    elif n.source == "stated":
        yield (
            "Too few joints were visited twice from the same direction in one run, and too few readings were taken at "
            "rest: the scatter of a reading is the sensor jitter as stated. It misses repeatability and drift."
        )
    if accuracy := c.sample.robot.tracker.accuracy_95_mm:
        yield (
            f"Repeated readings do not show the tracker's field error (stated: 95 % below {mm(accuracy)}), "
            f"which is the same at every visit of a position."
        )
    if d is None:
        yield "No joints were visited from opposite directions in one run: hysteresis and delay cannot be examined."
    elif too_few(d):
        yield (
            f"Too few joints were visited from opposite directions in one run to tell whether there is hysteresis: the "
            f"visits lie {mm(d.rms_mm)} RMS apart ({coverage(d)}), where the tracker's scatter gives "
            f"{mm(d.quiet_rms_mm)}."
        )
    yield from _long_pause(c.headline)
    if len(c.runs) == 1:
        yield "There is one run: the findings are not tested on another run."
    if fixed := fixed_names(c.sample):
        yield f"Never varied here, so their influence is unknown: {join(fixed)}."
    if not np.isfinite(c.sample.t).any():
        yield "There are no times: speeds, delay and drift cannot be examined."
    elif not has_speed(c.sample):
        yield "The readings are far apart in time (stops): a delay cannot be seen."
    if c.angle_deg is None:
        yield "No orientation was measured."
    elif c.angle_kind != "orientation":
        yield "The sensor's rotation differs from reading to reading: only the direction of the tip is compared."
    if c.wrong:
        yield "What the error depends on is examined once the conventions are right."
    elif not c.ranking.alone:
        yield (
            f"The readings fall into {counted(c.ranking.blocks, 'independent part')}, too few to judge a constant "
            "offset or dependences."
        )
    if len(c.ranking.rows) < len(c.sample.row) and not c.wrong:
        yield f"Dependences were examined on {len(c.ranking.rows)} of {len(c.sample.row)} readings, evenly spread."
    if len(c.runs) > 1 and not np.isfinite(r.p_value) and not r.found and not c.sessions and not is_noise(c):
        pairs = f"{counted(r.pairs_between, 'pair')} of visits" if r.pairs_between else "no joints"
        yield (
            f"Too few joints were visited in two runs ({pairs}): an offset that belongs to a run (frame, homing, "
            "drift) cannot be separated from an error that belongs to the joints of that run."
        )


def _long_pause(sample: Sample) -> Iterator[str]:
    """The longest pause inside a run, where the run may be two."""
    pause = np.where(np.diff(sample.run) == 0, np.diff(sample.t), 0.0)
    long = np.flatnonzero(pause > settings.LONG_PAUSE_S)
    if len(long):
        after = long[np.argmax(pause[long])]
        others = f", the longest of {len(long)} such pauses" if len(long) > 1 else ""
        yield (
            f"Run {sample.run[after]} pauses for {pause[after] / 3600:.1f} h before row {sample.row[after + 1]}"
            f"{others}. If the robot was switched off or homed there, this is another run: give it another number in "
            f"the column run."
        )
