"""All numbers of a comparison of the model with measurements: how large the error is, and what it depends on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from ctcr import settings
from ctcr.arrays import Array, Integers
from ctcr.compare.covariates import fixed_names
from ctcr.compare.crossvalidation import group_means, group_quantiles, make_folds, split
from ctcr.compare.dependence import Ranking, rank
from ctcr.compare.noise import DirectionDifference, SensorJitter, direction_difference, sensor_jitter
from ctcr.compare.offsets import FrameTurn, RunOffsets, Shift, find_run_offsets, find_shift, find_turn
from ctcr.compare.same_joints import PairOfRuns, pairs_of_runs
from ctcr.compare.sample import Sample, take_sample
from ctcr.compare.visits import Revisits, Stops, find_revisits, find_stops
from ctcr.conventions import Finding as Convention
from ctcr.errors import InputError, Problem
from ctcr.frames import rigid_motion
from ctcr.model.model import Prediction
from ctcr.robot.description import Robot
from ctcr.show.result import Glance, Result, frame
from ctcr.show.wording import counted
from ctcr.table.measurements import Measurements

if TYPE_CHECKING:
    from pandas import DataFrame

NUMBERS = (
    "robot position_mm percent_of_length angle_deg angle_kind runs noise direction shift turn run_offsets same_joints"
).split()


@dataclass(frozen=True)
class Spread:
    """Size of an error over some readings."""

    count: int
    mean: float
    rms: float
    p95: float
    maximum: float


@dataclass(frozen=True)
class RunErrors:
    """The error in one run, mm, tracker frame."""

    run: int
    position_mm: Spread
    mean_error_mm: tuple[float, float, float]
    angle_deg: Spread | None


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Everything `compare` finds. Lengths in mm, angles in degrees, as the names say."""

    PAGE = "compare.report"
    PICTURE = "compare.figures", "sizes", 5.2, 3.4

    robot: str
    position_mm: Spread
    percent_of_length: Spread
    angle_deg: Spread | None  # None where no orientation was measured
    angle_kind: str  # "orientation", or "tip direction" where the sensor's rotation is unknown
    runs: list[RunErrors]
    noise: SensorJitter
    direction: DirectionDifference | None
    shift: Shift | None  # None when there are too few readings to judge
    turn: FrameTurn | None  # where gross, everything but the errors themselves is computed with the frame fitted
    run_offsets: RunOffsets  # where found, the dependences are those of the error about each run's mean
    same_joints: list[PairOfRuns]
    ranking: Ranking
    headline: Sample  # the readings as they are
    sample: Sample  # the same, with the frame fitted where it is grossly wrong
    stops: Stops
    revisits: Revisits
    conventions: Sequence[Convention]  # that are wrong, the clearest first
    sessions: Sequence[str]  # sentences on what each run has of its own; where any, all but the errors is without it
    # What is known before a comparison.
    notices: Sequence[str] = ()  # what was done: readings left out, a pose found for the sensor
    floors: Mapping[str, float] = field(default_factory=lambda: {"sensor_jitter_mm": nan, "expected_error_mm": nan})
    files: Sequence[str] = ()  # that were compared
    snapped: Sequence[int] = ()  # rows on another stable equilibrium than the one predicted
    unexplained: str = ""  # that something is wrong which no known convention explains

    WRONG = "Wrong conventions: correct these first (errors of the calibrated robot)"

    @property
    def wrong(self) -> list[Convention]:
        """Conventions to correct."""
        return [one for one in self.conventions if one.is_wrong]

    def as_dict(self) -> dict[str, Any]:
        """The numbers for JSON, without the readings themselves."""
        data: dict[str, Any] = {name: getattr(self, name) for name in NUMBERS}
        data["rows"] = {
            "compared": self.position_mm.count,
            "not_measured": self.sample.not_measured.tolist(),
            "not_solved": self.sample.not_solved.tolist(),
        }
        data["dependence"] = {
            "level": settings.LEVEL,
            "blocks": self.ranking.blocks,
            "block_kind": self.ranking.block_kind,
            "rows_used": len(self.ranking.rows),
            "explained_share": self.ranking.explained,
            "found": [item.as_dict() for item in self.ranking.chosen],
            "ranked": [item.as_dict() for item in self.ranking.alone],
        }
        data["never_varied"] = fixed_names(self.sample)
        data["notices"] = list(self.notices)
        data["conventions"] = [one.as_dict() for one in self.conventions]
        data["unexplained"] = self.unexplained
        data["sessions"] = list(self.sessions)
        data["snapped"] = list(self.snapped)
        data |= self.floors
        return data

    def to_frame(self) -> "DataFrame":
        """A row a compared reading: row of the table, run, time, measured and predicted position in the tracker frame,
        size of the error."""
        sample = self.headline
        columns: dict[str, Any] = {"row": sample.row, "run": sample.run, "t_s": sample.t}
        for prefix, positions in (("", sample.measured), ("pred_", sample.predicted)):
            columns |= {f"{prefix}{axis}_m": values for axis, values in zip("xyz", positions.T, strict=True)}
        columns["error_mm"] = 1e3 * np.linalg.norm(sample.error, axis=1)
        if sample.rotation_error is not None:
            columns["angle_deg"] = np.degrees(np.linalg.norm(sample.rotation_error, axis=1))
        return frame(columns)

    def glance(self) -> Glance:
        spreads = [("position", "mm", self.position_mm), (self.angle_kind, "deg", self.angle_deg)]
        rows = [
            [name, unit, *(f"{value:.3g}" for value in (of.mean, of.rms, of.p95, of.maximum))]
            for name, unit, of in spreads
            if of
        ]
        small = {"readings repeat to": self.noise.rms_mm, "expected error": self.floors["expected_error_mm"]}
        rows += [[name, "mm", "", f"{value:.2g}", "", ""] for name, value in small.items() if isfinite(value)]
        count, rms = self.position_mm.count, self.position_mm.rms
        line = f"Comparison {self.robot}: {rms:.3g} mm RMS over {count} readings"
        wrong = [f"{self.WRONG}:", *(one.sentence for one in self.wrong)] if self.wrong else []
        warnings = [*filter(None, [self.unexplained]), *wrong, *self.sample.unsolved, *self.notices]
        return Glance(line, ["error", "unit", "mean", "RMS", "95 %", "max"], rows, (), 2, warnings)


def compare(
    robot: Robot,
    measurements: Measurements,
    prediction: Prediction,
    *,
    conventions: Sequence[Convention] = (),
    sessions: Sequence[str] = (),
    **known: Any,
) -> Comparison:
    """Compares measured tip poses with a prediction of all rows.

    conventions    those that `ctcr.conventions.review` found; where none is wrong, the dependences are examined too
    sessions       what `ctcr.diagnose.sessions` says of the runs
    known          fields of the comparison that are known before: notices, floors, files, snapped, unexplained
    Raises InputError where no row can be compared.
    """
    sample = take_sample(robot, measurements, prediction)
    if len(sample.row) == 0:
        lacking = len(sample.not_measured)
        why = [f"{counted(lacking, 'row')} without a measured position."] if lacking else []
        raise InputError(Problem(" ".join(["no row can be compared:", *why, *sample.unsolved])))
    headline = sample
    if sessions:
        sample = _in_one_frame(sample)
    rows, label, _ = split(sample.run, sample.motion.scaled)
    folds, shift, turn = make_folds(label, settings.SIGN_TRIALS), None, None
    is_right = not any(one.is_wrong for one in conventions)
    if is_right and folds.count >= settings.FEWEST_BLOCKS:
        shift = find_shift(sample.error[rows], folds)
        turn = find_turn(sample.predicted[rows], sample.measured[rows], folds)
    if turn and turn.gross:
        rotation, move = rigid_motion(sample.predicted, sample.measured)
        sample = replace(sample, predicted=sample.predicted @ rotation.T + move, rotation=rotation @ sample.rotation)
    stops = find_stops(sample)
    revisits = find_revisits(stops, sample.lever)
    jitter_mm = robot.tracker.jitter_mm
    noise = sensor_jitter(stops, revisits, nan if jitter_mm is None else jitter_mm)
    step, velocity = (motion[stops.first] @ sample.rotation.T for motion in (sample.tip_step, sample.tip_velocity))
    direction = direction_difference(stops, revisits, noise, step, velocity)
    as_taken, visits, pairs = sample, stops, revisits
    if sessions:
        as_taken, visits = headline, find_stops(headline)
        pairs = find_revisits(visits, headline.lever)
    run_offsets = find_run_offsets(as_taken, visits, pairs, noise)
    _, group = np.unique(sample.run if run_offsets.found else np.zeros_like(sample.run), return_inverse=True)
    error = sample.base_error - group_means(sample.base_error, group)[group]
    # The errors of a wrong table are no errors of the model: none of them is ranked.
    ranking = rank(sample, error if is_right else np.zeros_like(error), settings.LEVEL)
    length = np.linalg.norm(headline.error, axis=1) * 1e3
    rotation = headline.rotation_error
    angle = np.full(len(length), np.nan) if rotation is None else np.degrees(np.linalg.norm(rotation, axis=1))
    return Comparison(
        robot=robot.name,
        position_mm=_spread(length),
        percent_of_length=_spread(length * 0.1 / np.maximum(sample.deployed, 1e-6)),
        angle_deg=_spread(angle),
        angle_kind="orientation" if robot.tracker.sensor_rotation_known else "tip direction",
        runs=_run_errors(headline, length, angle),
        noise=noise,
        direction=direction,
        shift=shift,
        turn=turn,
        run_offsets=run_offsets,
        same_joints=pairs_of_runs(measurements),
        ranking=ranking,
        headline=headline,
        sample=sample,
        stops=stops,
        revisits=revisits,
        conventions=conventions,
        sessions=sessions,
        **known,
    )


def _in_one_frame(sample: Sample) -> Sample:
    """The readings, those of each run moved to where they fit the model best."""
    measured = sample.measured.copy()
    for run in np.unique(sample.run):
        rows = sample.run == run
        rotation, move = rigid_motion(sample.predicted[rows], measured[rows])
        measured[rows] = (measured[rows] - move) @ rotation
    return replace(sample, measured=measured)


def _spread(values: Array) -> Spread | None:
    """Of all finite values (K,); None without any."""
    return _spreads(values, np.zeros(len(values), np.int64), 1)[0]


def _spreads(values: Array, label: Integers, groups: int) -> list[Spread | None]:
    """Mean, RMS, 95th percentile and maximum of the finite values (K,) of each group; None without any."""
    known = np.isfinite(values)
    there, label = np.unique(label[known], return_inverse=True)
    values, count = values[known], np.bincount(label)
    found: list[Spread | None] = [None] * groups
    largest = np.zeros(len(there))
    np.maximum.at(largest, label, values)
    mean, square = (np.bincount(label, power) / count for power in (values, values**2))
    columns = (count, mean, np.sqrt(square), group_quantiles(values, label, 0.95), largest)
    for group, *numbers in zip(there, *columns, strict=True):
        found[group] = Spread(*(one.item() for one in numbers))
    return found


def _run_errors(sample: Sample, length: Array, angle: Array) -> list[RunErrors]:
    """Errors of each run; length [mm] and angle [deg] (K,) of all readings."""
    runs, label = np.unique(sample.run, return_inverse=True)
    spreads = (_spreads(values, label, len(runs)) for values in (length, angle))
    means = map(tuple, 1e3 * group_means(sample.error, label))
    return [
        RunErrors(int(run), of_length, mean, of_angle)
        for run, of_length, of_angle, mean in zip(runs, *spreads, means, strict=True)
    ]
