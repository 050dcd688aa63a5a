"""Quantities that the error may depend on: joints, lengths, directions, speeds, load, tip position and time."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ctcr import settings
from ctcr.arrays import Array
from ctcr.compare.sample import Sample

UNITS = {"deg": 180 / np.pi, "deg/s": 180 / np.pi, "mm": 1e3, "mm/s": 1e3}  # value of an SI unit; others are 1


@dataclass(frozen=True)
class Covariate:
    """One quantity at K readings. kind: "angle" (radians, periodic), "number", "direction" (-1, 0, 1)."""

    name: str  # stable id
    label: str  # for people
    symbol: str  # short, for plots
    unit: str  # of value * scale
    value: Array  # (K,) SI
    kind: str = "number"
    tube: int = 0  # that it belongs to alone; 0: to none

    @property
    def scale(self) -> float:
        """Factor from SI to the unit."""
        return UNITS.get(self.unit, 1.0)

    def bases(self) -> list[Array]:
        """Columns (K, P) whose sums are smooth curves of the value, without the constant: plain ones, richer ones.

        A plain curve is found with few runs, a richer one follows more. Every column stays within -1..1, so that
        a curve does not diverge on held-out values. There are none where the value does not vary.
        """
        if not self.varies:
            return []
        if self.kind == "direction":
            return [self.value[:, None]]
        if self.kind == "angle":
            return [self._harmonics(1), self._harmonics(settings.HARMONICS)]
        low, high = np.nanmin(self.value), np.nanmax(self.value)
        unit = np.nan_to_num((self.value - low) / (high - low), nan=0.5)[:, None]
        levels = len(np.unique(self.value[:: max(1, len(self.value) // 5000)]))
        waves = np.cos(np.pi * unit * np.arange(1, min(settings.WAVES, levels - 1) + 1))
        return [2 * unit - 1, waves][: 1 if levels < 3 else 2]

    def _harmonics(self, count: int) -> Array:
        turns = self.value[:, None] * np.arange(1, count + 1)
        return np.hstack([np.cos(turns), np.sin(turns)])

    @property
    def varies(self) -> bool:
        known = self.value[np.isfinite(self.value)]
        return len(known) > 0 and np.ptp(known) > 1e-9 * max(1.0, np.abs(known).max())


def covariates(sample: Sample) -> list[Covariate]:
    """All quantities that vary in this sample, among them the phases of drive screws of known pitch."""
    return [item for item in _all(sample) if item.varies]


def fixed_names(sample: Sample) -> list[str]:
    """Labels of joints and loads that never change in this sample."""
    fixed = [item.label for item in _joints(sample) if not item.varies]
    return fixed if any(item.varies for item in _load(sample)) else [*fixed, "the tip force"]


def has_speed(sample: Sample) -> bool:
    """Whether the readings are a stream with a time axis, so that speeds at the readings are known."""
    elapsed = np.diff(sample.t)[np.diff(sample.run) == 0]
    elapsed = elapsed[np.isfinite(elapsed) & (elapsed > 0)]
    return len(elapsed) > 0 and bool(np.median(elapsed) <= settings.STOP_AND_GO_S)


def _all(sample: Sample) -> Iterator[Covariate]:
    yield from _joints(sample)
    yield from _differences(sample)
    yield from _motions(sample)
    yield from _load(sample)
    yield from _position(sample)
    if pitch := sample.robot.actuation.screw_pitch:
        for i, beta in enumerate(sample.beta.T, 1):
            phase = 2 * np.pi * beta / pitch
            yield Covariate(f"screw_phase{i}", f"phase of drive screw {i}", f"screw {i}", "deg", phase, "angle", i)
    yield Covariate("time", "time since the start", "t", "s", sample.t)
    yield Covariate("order", "order of measuring", "row", "", sample.row.astype(float))


def _joints(sample: Sample) -> Iterator[Covariate]:
    for i, alpha in enumerate(sample.alpha.T, 1):
        yield _angle(f"alpha{i}", f"base angle α{i}", f"α{i}", alpha, i)
    for i, length in enumerate((sample.robot.lengths + sample.beta).T, 1):
        yield Covariate(f"length{i}", f"deployed length of tube {i} (moves with β{i})", f"ℓ{i}", "mm", length, tube=i)


def _differences(sample: Sample) -> Iterator[Covariate]:
    alpha, deployed = sample.alpha.T, (sample.robot.lengths + sample.beta).T
    for i, j in combinations(range(1, len(alpha) + 1), 2):
        angle, length = alpha[i - 1] - alpha[j - 1], deployed[i - 1] - deployed[j - 1]
        yield _angle(f"alpha{i}{j}", f"joint difference α{i} − α{j}", f"α{i}−α{j}", angle)
        yield Covariate(f"length{i}{j}", f"length of tube {i} beyond tube {j}", f"ℓ{i}−ℓ{j}", "mm", length)


def _motions(sample: Sample) -> Iterator[Covariate]:
    """Direction of the last motion of each joint, and speeds where they are known."""
    count, speeds = sample.beta.shape[1], []
    for joint, letter, unit, first in (("alpha", "α", "deg/s", count), ("beta", "β", "mm/s", 0)):
        for tube in range(1, count + 1):
            symbol, column = f"{letter}{tube}", first + tube - 1
            sign, rate = sample.motion.direction[:, column] * 1.0, sample.motion.rate[:, column]
            label = f"direction of the last motion of {symbol}"
            yield Covariate(f"direction_{joint}{tube}", label, f"sign of d{symbol}", "", sign, "direction", tube)
            name = f"speed_{joint}{tube}"
            speeds.append(Covariate(name, f"speed of {symbol}", f"d{symbol}/dt", unit, rate, tube=tube))
    if not has_speed(sample):
        return
    yield from speeds
    speed = np.linalg.norm(sample.tip_velocity, axis=1)
    yield Covariate("tip_speed", "speed of the tip", "tip speed", "mm/s", speed)


def _load(sample: Sample) -> Iterator[Covariate]:
    yield Covariate("force", "size of the tip force", "|f|", "N", np.linalg.norm(sample.force, axis=1))
    for axis, values in zip("xyz", sample.force.T, strict=True):
        yield Covariate(f"force_{axis}", f"tip force along {axis}", f"f{axis}", "N", values)


def _position(sample: Sample) -> Iterator[Covariate]:
    x, y, _ = sample.base_position.T
    for axis, values in zip("xyz", sample.base_position.T, strict=True):
        yield Covariate(f"place_{axis}", f"tip position {axis} in the base frame", axis, "mm", values)
    yield Covariate("place_radius", "distance of the tip from the insertion axis", "r", "mm", np.hypot(x, y))
    yield _angle("place_azimuth", "direction of the tip around the insertion axis", "azimuth", np.arctan2(y, x))


def _angle(name: str, label: str, symbol: str, value: Array, tube: int = 0) -> Covariate:
    """Periodic if the readings go around at least half a turn, else a plain number."""
    turned = np.sort(np.mod(value, 2 * np.pi))
    widest_gap = np.max(np.diff(np.append(turned, turned[0] + 2 * np.pi)))
    return Covariate(name, label, symbol, "deg", value, "angle" if widest_gap < np.pi else "number", tube)
