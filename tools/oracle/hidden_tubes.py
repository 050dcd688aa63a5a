"""Causes in the tubes and between them."""

from collections.abc import Callable

import numpy as np
from bore import radial_gaps
from friction import FrictionLaw
from hidden_cause import Truth, cause, n_tubes, signed
from mechanics import Joint, standard_profile
from numpy.polynomial.legendre import leggauss
from robot import Tube
from scipy.interpolate import BSpline
from scipy.optimize import brentq
from session import Setup


@cause("friction", slow=True)
def friction(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    law = FrictionLaw(0.02 * size * rng.uniform(0.8, 1.2), rng.uniform(0.03, 0.1))
    setup.mechanics.friction = law
    return {"coefficient": law.coefficient, "contact_stiffness": law.contact_stiffness}


@cause("clearance")
def clearance(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    gap = np.deg2rad(0.5) * size * rng.uniform(0.7, 1.3, n_tubes(setup) - 1)
    setup.mechanics.sleeve = {
        i + 1: Joint(stiffness=100.0, centring=2e-3 / angle, gap=angle) for i, angle in enumerate(gap)
    }
    return {"gap_rad": gap}


@cause("clearance")
def loose_bores(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    setup.mechanics.bore_gap = size * rng.uniform(0.7, 1.3, n_tubes(setup) - 1) * radial_gaps(setup.mechanics.robot)
    return {"radial_gap_m": setup.mechanics.bore_gap}


def _over_curved_part(tube: Tube, shape: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """Precurvature (kappa f_x, kappa f_y, f_z) with f = shape(position in the curved part from 0 to 1) (n, 3)."""
    start = tube.length - tube.curved_length

    def profile(distance: np.ndarray) -> np.ndarray:
        inside = distance >= start
        scale = np.array([tube.curvature, tube.curvature, 1.0])
        return inside[:, None] * scale * shape(np.clip((distance - start) / tube.curved_length, 0.0, 1.0))

    return profile


@cause("precurvature_profile")
def precurvature_profile(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    truth, profiles = [], []
    for tube in setup.mechanics.robot.tubes:
        knots = np.concatenate([np.zeros(4), np.sort(rng.uniform(0.1, 0.9, 6)), np.ones(4)])
        place = np.linspace(0, 1, 401)
        tilt = rng.choice([-1.0, 1.0]) * (2 * np.linspace(0, 1, 10) - 1)  # a gradient, and what the shaping left
        spline = BSpline(knots, tilt + rng.normal(0, 0.4, 10), 3)
        values = spline(place) - spline(place).mean()
        scale = 0.15 / np.sqrt(3) * size * rng.uniform(0.7, 1.3) / values.std()

        def shape(x: np.ndarray, values: np.ndarray = scale * values, place: np.ndarray = place) -> np.ndarray:
            along = 1 + np.interp(x, place, values)
            return np.stack([along, np.zeros_like(x), np.zeros_like(x)], axis=1)

        profiles.append(_over_curved_part(tube, shape))
        truth.append(3 * np.mean(scale * values * (2 * place - 1)))
    setup.mechanics.profile = profiles
    return {"relative_gradient": np.array(truth)}


@cause("helical_precurvature")
def helical_precurvature(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    rate = size * signed(setup, rng)  # [rad/m]
    bend = rng.uniform(-0.2, 0.2, rate.size)  # the plane does not turn quite evenly
    profiles = []
    for tube, r, b in zip(setup.mechanics.robot.tubes, rate, bend, strict=True):

        def shape(x: np.ndarray, turn: float = r * tube.curved_length, b: float = b) -> np.ndarray:
            angle = turn * (x + b * x * (1 - x))
            return np.stack([np.cos(angle), np.sin(angle), np.zeros_like(x)], axis=1)

        profiles.append(_over_curved_part(tube, shape))
    setup.mechanics.profile = profiles
    return {"rate_rad_per_m": rate}


@cause("straight_curvature")
def straight_curvature(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    curvature = 0.2 * size * signed(setup, rng)
    profiles = []
    for tube, k in zip(setup.mechanics.robot.tubes, curvature, strict=True):
        tilt, wave, phase = rng.normal(0, np.deg2rad(5)), rng.uniform(0.05, 0.15), rng.uniform(0, 2 * np.pi)
        standard, start = standard_profile(tube), tube.length - tube.curved_length

        def profile(d: np.ndarray, standard=standard, start=start, k=k, tilt=tilt, wave=wave, phase=phase):
            coil = k * (1 + 0.25 * np.sin(d / wave + phase)) * (d < start)
            return standard(d) + coil[:, None] * np.array([np.cos(tilt), np.sin(tilt), 0.0])

        profiles.append(profile)
    setup.mechanics.profile = profiles
    return {"curvature_per_m": curvature}


@cause("creep")
def creep(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    """Polymer tubes with relaxation times from seconds to hours, each of which takes its part of the curvature."""
    end, first = setup.plan.time[-1], setup.plan.time[0]
    times = end * np.array([0.02, 0.1, 0.5, 2.5])
    parts = rng.dirichlet(np.full(4, 2.0), n_tubes(setup))  # (N, 4)
    loss = 0.02 * size * signed(setup, rng)  # during the session

    def done(time: float) -> np.ndarray:
        return parts @ (1 - np.exp(-max(0.0, time - first) / times))

    setup.mechanics.ageing = lambda time: -loss * done(time) / done(end)
    return {"relative_loss": loss, "parts": parts}


def fibre_tangent(tube: Tube, yield_strain: float, ratio: float, bending: np.ndarray) -> np.ndarray:
    """Tangent over initial bending stiffness at each bending (n,) [1/m] of a tube whose fibres are bilinear."""
    angle, weight = leggauss(200)
    angle, weight = 0.25 * np.pi * (angle + 1), weight / weight.sum()
    radius = np.linspace(0.5 * tube.inner_diameter, 0.5 * tube.outer_diameter, 21)
    height = radius[:, None] * np.sin(angle)
    share = weight * height**2 * radius[:, None]
    # a fibre's transition is spread over a tenth of the yield strain, so that the tangent is continuous
    strain = bending[:, None, None] * height
    softened = np.clip((strain / yield_strain - 0.95) / 0.1, 0.0, 1.0)
    return (share * (1 - (1 - ratio) * softened)).sum(axis=(1, 2)) / share.sum()


@cause("softening")
def softening(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    bent, squared = (8.0, 0.004 * size * rng.uniform(0.7, 1.3))  # as much as a smooth law that loses 10 % at 5 /m
    loss = 1 - 1 / (1 + squared * bent**2)  # of the secant stiffness
    ratio, step = rng.uniform(0.2, 0.45), setup.mechanics.table_step
    bending = step * np.arange(161)
    rows, strains = [], []
    for tube in setup.mechanics.robot.tubes:

        def lost(strain: float, tube: Tube = tube) -> float:
            upwards = np.linspace(0, bent, 101)
            return 1 - np.trapezoid(fibre_tangent(tube, strain, ratio, upwards), upwards) / bent - loss

        strains.append(brentq(lost, 1e-4, bent * tube.outer_diameter))
        rows.append(fibre_tangent(tube, strains[-1], ratio, bending))
    setup.mechanics.tangent = np.array(rows)
    return {"loss_at_8_per_m": loss, "yield_strain": np.array(strains), "tangent_ratio": ratio}


@cause("anisotropy")
def anisotropy(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    relative, direction = 0.03 * size * np.abs(signed(setup, rng)), rng.uniform(0, np.pi, n_tubes(setup))
    setup.mechanics.ellipticity = relative[:, None] * np.stack([np.cos(2 * direction), np.sin(2 * direction)], axis=1)
    return {"relative": relative, "direction_rad": direction}


@cause("torsional_compliance")
def torsional_compliance(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    return (drive_compliance if rng.uniform() < 0.5 else shear_stiffness)(setup, size, rng)


@cause("torsional_compliance")
def drive_compliance(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    compliance = 2.0 * size * np.abs(signed(setup, rng))
    setup.mechanics.drive_compliance = compliance
    setup.mechanics.drive_hardening = 200.0
    return {"compliance_rad_per_Nm": compliance}


@cause("torsional_compliance")
def shear_stiffness(setup: Setup, size: float, rng: np.random.Generator) -> Truth:
    relative = -0.08 * size * rng.uniform(0.7, 1.3, n_tubes(setup))
    setup.mechanics.torsion_factor = 1 + relative
    return {"relative_shear_stiffness": relative}
