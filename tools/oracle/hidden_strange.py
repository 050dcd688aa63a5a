"""Causes that no catalogue has, and causes that calibration swallows."""

import numpy as np
from drives import Coupling, Ratio, Slipped, StickSlip
from hidden_cause import Truth, cause, n_tubes, signed
from hidden_drives import add_periodic
from mechanics import Yielding
from scipy.spatial.transform import Rotation
from session import Setup


@cause()
def rotation_with_translation(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    gain = np.deg2rad(60.0) * size * signed(setup, rng)  # [rad/m]
    setup.drives.append(Coupling(setup.plan.knot_joints[0, : n_tubes(setup)], gain))
    return {"gain_rad_per_m": gain}


@cause(slow=True)
def material_hysteresis(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    setup.mechanics.yielding = Yielding(share=min(0.08 * size, 0.5), curvature=rng.uniform(1.5, 3.0))
    return {"share": setup.mechanics.yielding.share, "curvature_per_m": setup.mechanics.yielding.curvature}


@cause()
def cable_pull(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    setup.mechanics.cable_pull = 0.05 * size * rng.uniform(0.8, 1.2)
    return {"pull_N": setup.mechanics.cable_pull}


@cause()
def temperature(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    cycles, phase, end = rng.uniform(1.2, 2.5), rng.uniform(0, 2 * np.pi), setup.plan.time[-1]
    setup.mechanics.warming = lambda time: 0.015 * size * np.sin(2 * np.pi * cycles * time / end + phase)
    return {"relative": 0.015 * size, "cycles": cycles}


@cause()
def plate_vibration(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """The plate rocks at a few hertz about an axis across the tubes; every reading catches another phase."""
    axis, frequency = (
        Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)]).apply([1.0, 0, 0]),
        rng.uniform(6.0, 9.0),
    )
    amplitude = np.deg2rad(0.12) * size

    def sensing(position: np.ndarray, rotation: Rotation, time: float) -> tuple[np.ndarray, Rotation]:
        rock = Rotation.from_rotvec(amplitude * np.sin(2 * np.pi * frequency * time) * axis)
        return rock.apply(position), rock * rotation

    setup.sensings.append(sensing)
    return {"amplitude_rad": amplitude, "frequency_Hz": frequency}


@cause()
def insertion_stick_slip(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    gap = 0.8e-3 * size * np.abs(signed(setup, rng))
    setup.drives.append(StickSlip(np.arange(n_tubes(setup)), gap))
    return {"gap_m": gap}


@cause()
def tooth_error(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    teeth, first = int(rng.integers(7, 12)), np.deg2rad(0.7) * size * np.abs(signed(setup, rng))
    joint = n_tubes(setup) + np.arange(n_tubes(setup))
    return {"teeth": teeth} | add_periodic(setup, joint, 2 * np.pi / teeth, first, rng)


@cause(absorbed=True)
def load_not_as_known(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """The same as softer or stiffer tubes: without load only the ratios of the moduli matter."""
    setup.load_scale = 1 + 0.12 * size * float(rng.choice([-1.0, 1.0]))
    return {"load_scale": setup.load_scale}


@cause()
def grip_slip(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    tube, offset = int(rng.integers(n_tubes(setup))), np.deg2rad(2.5) * size * float(rng.choice([-1.0, 1.0]))
    reading = int(rng.uniform(0.3, 0.7) * len(setup.plan.time))
    setup.drives.append(Slipped(n_tubes(setup) + tube, offset, setup.plan.joints[reading]))
    return {"tube": tube + 1, "slip_rad": offset, "time_s": setup.plan.time[reading]}


@cause(absorbed=True)
def bending_plane(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """The whole precurved part bends out of the described plane: the same as an offset of rotation."""
    angle = 0.015 * size * signed(setup, rng)
    setup.drives.append(lambda joints: joints + np.concatenate([np.zeros(n_tubes(setup)), angle]))
    return {"angle_rad": angle}


@cause(absorbed=True)
def translation_ratio(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    excess = 0.0004 * size * float(rng.choice([-1.0, 1.0])) * np.ones(n_tubes(setup))
    setup.drives.append(Ratio(np.arange(n_tubes(setup)), excess))
    return {"relative": excess}


@cause(absorbed=True)
def tracker_yaw(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """The plate turned about the insertion axis: the same as a common offset of rotation."""
    yaw = np.deg2rad(0.5) * size * float(rng.choice([-1.0, 1.0]))
    turn = Rotation.from_rotvec([0, 0, yaw])
    setup.sensings.append(lambda position, rotation, time: (turn.apply(position), turn * rotation))
    return {"yaw_rad": yaw}
