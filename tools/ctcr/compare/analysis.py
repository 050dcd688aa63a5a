"""How wrong the model is, and where: all numbers of a comparison, without a picture or a word."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.blocks import FEWEST_RUNS, split
from ctcr.compare.covariates import fixed_names, has_speed
from ctcr.compare.crossvalidation import make_folds
from ctcr.compare.dependence import TRIALS, Dependence, Ranking, rank
from ctcr.compare.noise import DirectionDifference, NoiseFloor, direction_difference, noise_floor
from ctcr.compare.offsets import FrameTurn, RunOffsets, Shift, find_run_offsets, find_shift, find_turn, rigid_motion
from ctcr.compare.sample import Sample, take_sample
from ctcr.compare.visits import Revisits, Stops, find_revisits, find_stops
from ctcr.errors import InputError, Problem

Array = NDArray[np.float64]

# Four questions are asked (shift, runs, direction, dependence); together they raise a false alarm in 5 % of
# the tables whose error is noise alone.
LEVEL = 0.05 / 4


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


@dataclass(frozen=True)
class Comparison:
    """Everything `compare` finds. Lengths in mm, angles in degrees, as the names say."""

    robot: str
    position_mm: Spread
    percent_of_length: Spread
    angle_deg: Spread | None  # None where no orientation was measured
    angle_kind: str  # "orientation", or "tip direction" where the sensor's roll is unknown
    runs: list[RunErrors]
    noise: NoiseFloor
    direction: DirectionDifference | None
    shift: Shift | None  # None when there are too few readings to judge
    turn: FrameTurn | None  # where gross, all but the errors themselves is computed with the frame fitted
    run_offsets: RunOffsets  # where found, the dependences are of the error about each run's mean
    ranking: Ranking
    fixed: list[str]  # joints and loads that never change here
    has_time: bool
    has_speed: bool
    accuracy_95_mm: float  # the tracker's stated figure, NaN if not stated
    plate_mm: Array  # (3,) origin of the base frame in the tracker frame, from the robot file
    headline: Sample  # the readings as they are
    sample: Sample  # the same, with the frame fitted where it is grossly wrong
    stops: Stops
    revisits: Revisits
    notices: Sequence[str]  # what became of the table before it was compared

    @property
    def noise_share(self) -> float:
        """Part of the squared position error that noise of the floor's size accounts for."""
        return min(1.0, (self.noise.rms_mm / self.position_mm.rms) ** 2) if self.position_mm.rms else 1.0

    def as_dict(self) -> dict:
        """The numbers for JSON, without the readings themselves."""
        names = (
            "robot",
            "position_mm",
            "percent_of_length",
            "angle_deg",
            "angle_kind",
            "runs",
            "noise",
            "direction",
            "shift",
            "turn",
            "run_offsets",
        )
        data = {name: _plain(getattr(self, name)) for name in names}
        data["rows"] = {
            "compared": self.position_mm.count,
            "not_measured": self.sample.not_measured.tolist(),
            "not_solved": self.sample.not_solved.tolist(),
        }
        data["dependence"] = {
            "level": LEVEL,
            "blocks": self.ranking.blocks,
            "block_kind": self.ranking.block_kind,
            "rows_used": len(self.ranking.rows),
            "explained_share": self.ranking.explained,
            "found": [_dependence(item) for item in self.ranking.chosen],
            "ranked": [_dependence(item) for item in self.ranking.alone],
        }
        data["never_varied"] = self.fixed
        data["notices"] = list(self.notices)
        return data


def compare(robot, measurements, prediction, notices: Sequence[str] = ()) -> Comparison:
    """Compare measured with predicted tip poses; `notices` say what became of the table before.

    robot, measurements and prediction as `ctcr.robot.robot_file.load`, `ctcr.table.measurements.load` and
    `ctcr.Model.predict` give them. Raises InputError when no row can be compared.
    """
    sample = take_sample(robot, measurements, prediction)
    if len(sample.row) == 0:
        raise InputError(
            Problem(
                f"no row can be compared: {len(sample.not_measured)} rows without a measured position, "
                f"{len(sample.not_solved)} rows that the model does not solve"
            )
        )
    tracker = robot.tracker
    shift, turn = _constant_errors(sample)
    headline, sample = sample, _aligned(sample) if turn and turn.gross else sample
    stops = find_stops(sample)
    revisits = find_revisits(stops, sample.lever)
    noise = noise_floor(stops, revisits, _number(tracker.jitter_mm))
    step, velocity = (motion[stops.first] @ sample.rotation.T for motion in (sample.tip_step, sample.tip_velocity))
    direction = direction_difference(stops, revisits, noise, step, velocity)
    run_offsets = find_run_offsets(sample, revisits, LEVEL)
    error = _about_means(sample.base_error, sample.run if run_offsets.found else np.zeros_like(sample.run))
    pitch = robot.actuation.translation_mm_per_rev
    ranking = rank(sample, error, pitch * 1e-3 if pitch else None, LEVEL)
    length = np.linalg.norm(headline.error, axis=1) * 1e3
    angle = _angles(headline)
    return Comparison(
        robot=robot.name,
        position_mm=spread(length),
        percent_of_length=spread(length * 0.1 / np.maximum(sample.deployed, 1e-6)),
        angle_deg=spread(angle) if np.isfinite(angle).any() else None,
        angle_kind="orientation" if sample.roll_known else "tip direction",
        runs=_run_errors(headline, length, angle),
        noise=noise,
        direction=direction,
        shift=shift,
        turn=turn,
        run_offsets=run_offsets,
        ranking=ranking,
        fixed=fixed_names(sample),
        has_time=bool(np.isfinite(sample.t).any()),
        has_speed=has_speed(sample),
        accuracy_95_mm=_number(tracker.accuracy_95_mm),
        plate_mm=np.asarray(tracker.position) * 1e3,
        headline=headline,
        sample=sample,
        stops=stops,
        revisits=revisits,
        notices=notices,
    )


def spread(values: Array) -> Spread:
    """Mean, RMS, 95th percentile and maximum of what is finite in values (K,)."""
    known = values[np.isfinite(values)]
    return Spread(
        len(known),
        float(known.mean()),
        float(np.sqrt(np.mean(known**2))),
        float(np.percentile(known, 95)),
        float(known.max()),
    )


def _constant_errors(sample: Sample) -> tuple[Shift | None, FrameTurn | None]:
    rows, label, _ = split(sample)
    folds = make_folds(label, TRIALS)
    if folds.count < FEWEST_RUNS:
        return None, None
    return (find_shift(sample.error[rows], folds), find_turn(sample.predicted[rows], sample.measured[rows], folds))


def _aligned(sample: Sample) -> Sample:
    """The sample in the tracker frame that fits best."""
    turn, shift = rigid_motion(sample.predicted, sample.measured)
    predicted = sample.predicted @ turn.T + shift
    error, rotation = sample.measured - predicted, turn @ sample.rotation
    return replace(sample, predicted=predicted, error=error, base_error=error @ rotation, rotation=rotation)


def _about_means(error: Array, group: NDArray) -> Array:
    """Error (K, 3) about the mean of each group (K,)."""
    _, label = np.unique(group, return_inverse=True)
    means = np.stack([np.bincount(label, column) / np.bincount(label) for column in error.T], axis=1)
    return error - means[label]


def _angles(sample: Sample) -> Array:
    if sample.rotation_error is None:
        return np.full(len(sample.row), np.nan)
    return np.degrees(np.linalg.norm(sample.rotation_error, axis=1))


def _run_errors(sample: Sample, length: Array, angle: Array) -> list[RunErrors]:
    """Errors of each run; length [mm] and angle [deg] (K,) of all readings."""
    order = np.argsort(sample.run, kind="stable")
    names, starts = np.unique(sample.run[order], return_index=True)
    return [
        RunErrors(
            int(name),
            spread(length[rows]),
            tuple(sample.error[rows].mean(axis=0) * 1e3),
            spread(angle[rows]) if np.isfinite(angle[rows]).any() else None,
        )
        for name, rows in zip(names, np.split(order, starts[1:]), strict=True)
    ]


def _dependence(item: Dependence) -> dict:
    return {
        "name": item.name,
        "label": item.label,
        "frame": item.form.frame,
        "share": item.share,
        "p_value": item.p_value,
        "size_mm": item.size_mm,
        "indistinct": list(item.indistinct),
    }


def _plain(value):
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return asdict(value) if hasattr(value, "__dataclass_fields__") else value


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
