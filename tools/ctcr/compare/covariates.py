"""What the error may depend on: joints, joint differences, lengths, directions, speeds, load, place and time."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ctcr.compare.sample import Sample

Array = NDArray[np.float64]
HARMONICS = 3
WAVES = 4
STOP_AND_GO_S = 1.0  # readings farther apart than this are taken as stops, whose speed is not in the table


@dataclass(frozen=True)
class Covariate:
    """One quantity at K readings. kind: "angle" (radians, periodic), "number", "direction" (-1, 0, 1)."""

    name: str  # stable id
    label: str  # for people
    symbol: str  # short, for plots
    unit: str  # of value * scale
    scale: float
    kind: str
    value: Array  # (K,)
    tube: int = 0  # that it belongs to alone; 0: to none

    def bases(self) -> list[Array]:
        """Columns (K, P) whose sums are smooth curves of the value, without the constant: plain ones, richer ones.

        A plain curve is found with few runs, a richer one follows more; every column stays within -1..1, so that
        a curve does not run away on values it has not seen.
        """
        if self.kind == "direction":
            return [self.value[:, None]]
        if self.kind == "angle":
            return [self._harmonics(1), self._harmonics(HARMONICS)]
        low, high = np.nanmin(self.value), np.nanmax(self.value)
        unit = np.nan_to_num((self.value - low) / (high - low), nan=0.5)[:, None]
        levels = len(np.unique(self.value[:: max(1, len(self.value) // 5000)]))
        line = 2 * unit - 1
        return [line, np.cos(np.pi * unit * np.arange(1, min(WAVES, levels - 1) + 1))][: 1 if levels < 3 else 2]

    def _harmonics(self, count: int) -> Array:
        turns = self.value[:, None] * np.arange(1, count + 1)
        return np.hstack([np.cos(turns), np.sin(turns)])


def covariates(sample: Sample, screw_pitch_m: float | None = None) -> list[Covariate]:
    """All quantities that vary in this sample.

    screw_pitch_m [m]: travel per motor revolution; given, the phase within a revolution is examined as well.
    """
    return [item for item in _all(sample, screw_pitch_m) if _varies(item)]


def fixed_names(sample: Sample) -> list[str]:
    """Labels of joints and loads that never change in this sample."""
    fixed = [item.label for item in _joints(sample) if not _varies(item)]
    return fixed if any(_varies(item) for item in _load(sample)) else [*fixed, "the tip force"]


def _varies(item: Covariate) -> bool:
    known = item.value[np.isfinite(item.value)]
    return len(known) > 0 and np.ptp(known) > 1e-9 * max(1.0, np.abs(known).max())


def _all(sample: Sample, pitch: float | None) -> Iterator[Covariate]:
    yield from _joints(sample)
    yield from _differences(sample)
    yield from _directions(sample)
    yield from _speeds(sample)
    yield from _load(sample)
    yield from _place(sample)
    if pitch:
        for i, beta in enumerate(sample.beta.T, 1):
            phase = 2 * np.pi * beta / pitch
            yield Covariate(
                f"screw_phase{i}", f"phase of drive screw {i}", f"screw {i}", "deg", 180 / np.pi, "angle", phase, i
            )
    yield Covariate("time", "time since the start", "t", "s", 1.0, "number", sample.t)
    yield Covariate("order", "order of measuring", "row", "", 1.0, "number", sample.row.astype(float))


def _joints(sample: Sample) -> Iterator[Covariate]:
    for i, alpha in enumerate(sample.alpha.T, 1):
        yield replace(_angle(f"alpha{i}", f"base angle α{i}", f"α{i}", alpha), tube=i)
    for i, beta in enumerate(sample.beta.T, 1):
        length = sample.tube_lengths[i - 1] + beta
        label = f"deployed length of tube {i} (moves with β{i})"
        yield replace(_length(f"length{i}", label, f"ℓ{i}", length), tube=i)


def _differences(sample: Sample) -> Iterator[Covariate]:
    count = sample.alpha.shape[1]
    deployed = sample.tube_lengths + sample.beta
    for i in range(count):
        for j in range(i + 1, count):
            pair = f"{i + 1}{j + 1}"
            yield _angle(
                f"alpha{pair}",
                f"joint difference α{i + 1} − α{j + 1}",
                f"α{i + 1}−α{j + 1}",
                sample.alpha[:, i] - sample.alpha[:, j],
            )
            yield _length(
                f"length{pair}",
                f"length of tube {i + 1} beyond tube {j + 1}",
                f"ℓ{i + 1}−ℓ{j + 1}",
                deployed[:, i] - deployed[:, j],
            )


def _directions(sample: Sample) -> Iterator[Covariate]:
    for name, symbol, column, tube in _joint_columns(sample):
        sign = sample.motion.direction[:, column].astype(float)
        yield Covariate(
            f"direction_{name}",
            f"direction of the last motion of {symbol}",
            f"sign of d{symbol}",
            "",
            1.0,
            "direction",
            sign,
            tube,
        )


def _speeds(sample: Sample) -> Iterator[Covariate]:
    if not has_speed(sample):
        return
    for name, symbol, column, tube in _joint_columns(sample):
        turns = name.startswith("alpha")
        yield Covariate(
            f"speed_{name}",
            f"speed of {symbol}",
            f"d{symbol}/dt",
            "deg/s" if turns else "mm/s",
            180 / np.pi if turns else 1e3,
            "number",
            sample.motion.rate[:, column],
            tube,
        )
    speed = np.linalg.norm(sample.tip_velocity, axis=1)
    yield Covariate("tip_speed", "speed of the tip", "tip speed", "mm/s", 1e3, "number", speed)


def has_speed(sample: Sample) -> bool:
    """Whether the readings are a stream with a time axis, so that speeds at the readings are known."""
    elapsed = np.diff(sample.t)[np.diff(sample.run) == 0]
    elapsed = elapsed[np.isfinite(elapsed) & (elapsed > 0)]
    return len(elapsed) > 0 and bool(np.median(elapsed) <= STOP_AND_GO_S)


def _load(sample: Sample) -> Iterator[Covariate]:
    size = np.linalg.norm(sample.force, axis=1)
    yield Covariate("force", "size of the tip force", "|f|", "N", 1.0, "number", size)
    for axis, values in zip("xyz", sample.force.T, strict=True):
        yield Covariate(f"force_{axis}", f"tip force along {axis}", f"f{axis}", "N", 1.0, "number", values)


def _place(sample: Sample) -> Iterator[Covariate]:
    for axis, values in zip("xyz", sample.base_position.T, strict=True):
        yield _length(f"place_{axis}", f"tip position {axis} in the base frame", axis, values)
    x, y = sample.base_position[:, 0], sample.base_position[:, 1]
    yield _length("place_radius", "distance of the tip from the insertion axis", "r", np.hypot(x, y))
    yield _angle("place_azimuth", "direction of the tip around the insertion axis", "azimuth", np.arctan2(y, x))


def _joint_columns(sample: Sample) -> Iterator[tuple[str, str, int, int]]:
    """Name and symbol of each joint, its column, and its tube."""
    count = sample.beta.shape[1]
    for i in range(count):
        yield f"alpha{i + 1}", f"α{i + 1}", count + i, i + 1
    for i in range(count):
        yield f"beta{i + 1}", f"β{i + 1}", i, i + 1


def _angle(name: str, label: str, symbol: str, value: Array) -> Covariate:
    """Periodic if the readings go around at least half a turn, else a plain number."""
    turned = np.sort(np.mod(value, 2 * np.pi))
    widest_gap = np.max(np.diff(np.append(turned, turned[0] + 2 * np.pi)))
    kind = "angle" if widest_gap < np.pi else "number"
    return Covariate(name, label, symbol, "deg", 180 / np.pi, kind, value)


def _length(name: str, label: str, symbol: str, value: Array) -> Covariate:
    return Covariate(name, label, symbol, "mm", 1e3, "number", value)
