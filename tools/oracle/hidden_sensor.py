"""Causes in the tracker and its frame."""

from collections.abc import Callable

import numpy as np
from field import misread
from hidden_cause import Truth, cause, signed, unit
from scipy.spatial.transform import Rotation
from session import ELEMENT_LENGTH, Setup
from specimen import Specimen


@cause("sensor_offset")
def sensor_offset(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    offset = 1e-3 * size * np.append(signed(setup, rng, 2)[:2], rng.uniform(-0.5, 0.5))
    setup.sensings.append(lambda position, rotation, time: (position + rotation.apply(offset), rotation))
    return {"offset_m": offset}


@cause("field_distortion")
def field_distortion(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """A bar of metal beside the workspace; scaled so that 0.15 mm remain when position and scale are fitted."""
    specimen, bench = Specimen(setup.mechanics, 2 * ELEMENT_LENGTH), setup.bench
    few = setup.plan.joints[:: max(1, len(setup.plan.time) // 80)]
    tips = np.array([specimen.settle(*np.split(setup.true_joints(q), 2), np.zeros(3)).position for q in few])
    places = bench.tracker_rotation.apply(tips) + bench.tracker_position
    middle, side = places.mean(axis=0), unit(rng)
    side[2] = -abs(side[2])  # not before the coils
    centre = middle + (np.max((places - middle) @ side) + rng.uniform(0.05, 0.08)) * side
    bar = centre + np.outer(np.linspace(-0.015, 0.015, 5), unit(rng))
    volume = 1e-9
    error = np.array([misread(p, bar, volume)[0] for p in places])
    columns = np.column_stack([places - places.mean(axis=0), np.ones(len(places))])
    left = error - columns @ np.linalg.lstsq(columns, error, rcond=None)[0]
    volume *= 0.15e-3 * size / np.sqrt(np.mean(np.sum(left**2, axis=1)))

    def sensing(position: np.ndarray, rotation: Rotation, time: float) -> tuple[np.ndarray, Rotation]:
        shift, turn = misread(position, bar, volume)
        return position + shift, Rotation.from_rotvec(turn) * rotation

    setup.tracker_sensings.append(sensing)
    return {"ends_m": bar[[0, -1]], "volume_m3": volume}


@cause("frame_drift")
def frame_drift(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """From -1 to 1 over the session, faster at first, as a stand settles."""
    shift, turn = 0.4e-3 * size * unit(rng) * rng.uniform(0.8, 1.2), np.deg2rad(0.05) * size * unit(rng)
    end, decay = setup.plan.time[-1], rng.uniform(0.3, 1.5)

    def progress(time: float) -> float:
        return 2 * (1 - np.exp(-decay * time / end)) / (1 - np.exp(-decay)) - 1

    _move_frame(setup, lambda time: (progress(time) * shift, progress(time) * turn))
    return {"shift_m": shift, "turn_rad": turn}


@cause("frame_jump")
def frame_jump(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    shift, turn = 0.5e-3 * size * unit(rng), np.deg2rad(0.1) * size * unit(rng)
    moment = setup.plan.time[int(rng.uniform(0.3, 0.7) * len(setup.plan.time))]
    _move_frame(setup, lambda time: ((time >= moment) * shift, (time >= moment) * turn))
    return {"time_s": moment, "shift_m": shift, "turn_rad": turn}


def _move_frame(setup: Setup, motion: Callable[[float], tuple[np.ndarray, np.ndarray]]) -> None:
    """The robot's stand moves in the tracker's frame, about the plate."""
    pivot = setup.bench.tracker_position

    def sensing(position: np.ndarray, rotation: Rotation, time: float) -> tuple[np.ndarray, Rotation]:
        shift, turn = motion(time)
        moved = Rotation.from_rotvec(turn)
        return pivot + moved.apply(position - pivot) + shift, moved * rotation

    setup.tracker_sensings.append(sensing)
