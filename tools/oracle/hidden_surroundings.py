"""Causes at the entry, and loads that nobody knows of."""

import numpy as np
from hidden_cause import Truth, cause, unit
from mechanics import Joint
from session import ELEMENT_LENGTH, Setup
from specimen import Specimen


@cause("entry_compliance")
def entry_compliance(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    compliance = 0.5 * size * rng.uniform(0.7, 1.3)
    setup.mechanics.entry = Joint(stiffness=1 / compliance, arm=rng.uniform(0, 0.01))
    return {"compliance_rad_per_Nm": compliance}


@cause("entry_clearance")
def entry_clearance(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    gap = np.deg2rad(0.5) * size * rng.uniform(0.7, 1.3)
    setup.mechanics.entry = Joint(stiffness=100.0, centring=4e-3 / gap, gap=gap, arm=rng.uniform(0, 0.015))
    return {"gap_rad": gap}


@cause("tip_load")
def tip_load(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    return (tip_mass if rng.uniform() < 0.5 else tip_force)(setup, size, rng)


@cause("tip_load")
def tip_mass(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    mass = 1e-3 * size * rng.uniform(0.7, 1.3)
    setup.mechanics.tip_force = setup.mechanics.tip_force + mass * setup.mechanics.robot.gravity
    return {"mass_kg": mass}


@cause("tip_load")
def tip_force(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    force = 0.01 * size * rng.uniform(0.7, 1.3) * unit(rng) * np.sqrt(3)
    setup.mechanics.tip_force = setup.mechanics.tip_force + force
    return {"force_N": force}


@cause("contact")
def contact(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """A rounded obstacle that an eighth of the tips would reach, somewhere beside the robot."""
    specimen, plan = Specimen(setup.mechanics, 2 * ELEMENT_LENGTH), setup.plan
    tips = np.array(
        [
            specimen.settle(*np.split(setup.true_joints(q), 2), np.zeros(3)).position
            for q in plan.joints[:: max(1, len(plan.time) // 300)]
        ]
    )
    side = rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(side), np.sin(side), rng.uniform(-0.2, 0.4)])
    direction /= np.linalg.norm(direction)
    reach = tips @ direction
    level, radius = np.quantile(reach, 0.875), 0.06
    beyond = tips[reach > level].mean(axis=0)
    centre = beyond + (level - beyond @ direction + radius) * direction
    stiffness = 4e3 * size  # soft: some ten millinewtons
    setup.mechanics.obstacle = np.array([[*centre, radius, stiffness]])
    return {"centre_m": centre, "radius_m": radius, "Hertz_stiffness": stiffness}
